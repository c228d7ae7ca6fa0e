"""A tokenizer learns a robot of one's own from generated motion of the Go2."""

from dataclasses import replace

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.control.actor_file import load_actor
from loco_drake.generation.motion_model import motion_model_of
from loco_drake.generation.tokenizer import load_tokenizer
from loco_drake.models.robots import get_robot
from loco_drake.models.shipped import pretrained_path, weights_in
from loco_drake.motion.motion_file import load_motion
from loco_drake.tracking.recipe import Recipe
from loco_drake.tracking.recipe_body import knows, make_body
from loco_drake.tracking.recipe_parts import Body, ReferenceSet, Stage
from loco_drake.tracking.recipe_run import run_recipe
from tests.robot_files import without_weights

pytestmark = pytest.mark.slow

LABELS = ["dog-trot", "horse-walk"]
BODY = Body(motions=ReferenceSet(labels=LABELS, count=1, seconds=2.0), steps=3)


@pytest.fixture(scope="module")
def anymal(tmp_path_factory):
    """The file of a robot that no weights know."""
    return str(without_weights("anymal", tmp_path_factory.mktemp("robot")))


@pytest.fixture(scope="module")
def ended(anymal, tmp_path_factory):
    """The run of a recipe for ANYmal."""
    one = ReferenceSet(labels=["dog-trot"], count=1, seconds=2.0)
    recipe = Recipe(
        robot=anymal,
        environments=2,
        body=BODY,
        references={"one": one},
        evaluation=None,
        stages=[Stage(name="own", steps=64, ppo={"batch": 64, "minibatch": 32})],
    )
    folder = tmp_path_factory.mktemp("run") / "own"
    figures = run_recipe(folder, recipe)
    assert not figures["interrupted"]
    return folder


def test_the_run_has_all_that_the_robot_needs(anymal, ended):
    """Its tokenizer and its policy are found, and go with the shipped generator."""
    robot = get_robot(anymal)
    found = weights_in(ended)
    assert found["tokenizer"] == ended / "tokenizer" / "tokenizer.safetensors"
    assert found["policy"] == ended / "policy.safetensors"
    assert load_actor(found["policy"], robot)
    model = motion_model_of(anymal, tokenizer=found["tokenizer"])
    shipped = load_tokenizer(pretrained_path("tokenizer"))
    assert model.tokenizer.fingerprint == shipped.fingerprint
    made = load_motion(ended / "references" / "one" / "dog-trot-1000.npz")
    assert made.robot == "anymal"


def test_motions_of_both_robots_belong_together(ended):
    folder = ended / "references" / "body"
    assert len(list(folder.glob("*.npz"))) == 4
    for label in LABELS:
        given, moved = (
            load_motion(folder / f"{name}-{label}-1000.npz")
            for name in ("go2", "anymal")
        )
        assert given.provenance["file"] == moved.provenance["file"]
        assert len(given) == len(moved) == 101
        assert moved.grounded
        scale = get_robot("anymal").stand_height / get_robot("go2").stand_height
        travelled = (
            np.linalg.norm(np.diff(x.base_position[:, :2], axis=0), axis=1).sum()
            for x in (moved, given)
        )
        assert next(travelled) / next(travelled) == pytest.approx(scale, rel=0.1)


def test_it_goes_on_where_it_was_stopped(anymal, tmp_path):
    robot = get_robot(anymal)
    assert not knows(robot)
    motions, out = tmp_path / "motions", tmp_path / "tokenizer"
    asked = iter([False, True])
    assert make_body(robot, BODY, motions, out, stopped=lambda: next(asked)) is None
    first = {path.name: path.stat().st_mtime_ns for path in motions.glob("*.npz")}
    assert sorted(first) == ["anymal-dog-trot-1000.npz", "go2-dog-trot-1000.npz"]
    (motions / ".torn.npz").write_bytes(b"")
    told = []
    weights = make_body(
        robot, BODY, motions, out, report=lambda done, total: told.append((done, total))
    )
    assert weights == out / "tokenizer.safetensors"
    assert told == [(1, 2), (2, 2)]
    assert not (motions / ".torn.npz").exists()
    assert all((motions / x).stat().st_mtime_ns == t for x, t in first.items())
    assert load_tokenizer(weights).config.added == ("anymal",)
    told.clear()
    assert make_body(robot, BODY, motions, out, report=told.append) == weights
    assert not told


def test_a_body_that_cannot_be_learned_is_refused():
    with pytest.raises(InputError, match="body: steps must be 1 or more"):
        Body(steps=0).check()
    steered = replace(BODY, motions=ReferenceSet(steered=True))
    with pytest.raises(InputError, match="has no steered, grounded or folder"):
        steered.check()
