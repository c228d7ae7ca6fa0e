"""A tokenizer that learns another robot, and forgets nothing."""

import numpy as np
import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.generation.features import JOINTS
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.generation.motion_model import MotionModel
from loco_drake.generation.tokenizer import load_tokenizer
from loco_drake.generation.train_bodies import train_bodies
from loco_drake.generation.training_motions import (
    Library,
    read_training_record,
)
from loco_drake.models.robots import get_robot
from tests.generation.one_clip import clip
from tests.robot_files import OWN

NAMES = ("go2", "anymal")


@pytest.fixture(scope="module")
def library():
    get_robot(str(OWN["anymal"]))
    clips = [clip(robot, mirrored) for mirrored in (False, True) for robot in NAMES]
    return Library(tuple(clips), ())


@pytest.fixture(scope="module")
def grown(library, base, tmp_path_factory):
    out = tmp_path_factory.mktemp("grown")
    train_bodies(library, base, LoopSettings(out, 30, 2e-2, log_every=5))
    return out / "tokenizer.safetensors"


def test_what_it_knew_is_the_same_to_the_last_bit(base, grown):
    before, after = load_tokenizer(base), load_tokenizer(grown)
    assert (after.config.robots, after.config.added) == (NAMES, ("anymal",))
    kept = dict(after.state_dict())
    for name, value in before.half().float().state_dict().items():
        rows = len(value) if name.endswith("_robot.weight") else None
        assert torch.equal(kept[name][:rows] if rows else kept[name], value), name


def test_codes_mean_the_same_so_the_generator_stays(model, base, grown):
    """The tokenizer's fingerprint, by which the generator knows its codes."""
    tokenizer = load_tokenizer(grown)
    assert tokenizer.fingerprint == model.tokenizer.fingerprint
    for robot in NAMES:
        writer = MotionModel(tokenizer, model.generator, robot)
        _, frames = writer.extend(writer.start(np.array([1])), np.array([1]))
        assert np.isfinite(frames.q).all()
        assert frames.q.shape == (1, 48, 19)


def test_the_new_body_is_decoded_better_than_by_the_old_row(library, grown):
    tokenizer = load_tokenizer(grown)
    one = library.train[1]
    assert one.robot == "anymal"
    target = torch.tensor(one.features[None, :100], dtype=torch.float32)
    errors = []
    for row in (0, 1):
        robot = torch.tensor([row])
        output = tokenizer.decode(tokenizer.encode(target, robot), robot)
        errors.append((output - target)[..., JOINTS].square().mean().item())
    assert errors[1] < errors[0]


def test_the_file_says_what_both_trainings_learned_from(grown):
    recordings = read_training_record(grown, "tokenizer")["recordings"]
    assert recordings["dog-other"] == {"go2": 3.0}
    assert any("anymal" in seconds for seconds in recordings.values())


def test_there_must_be_something_to_learn(library, base, tmp_path):
    known = Library(tuple(c for c in library.train if c.robot == "go2"), ())
    with pytest.raises(InputError, match="knows go2 already"):
        train_bodies(known, base, LoopSettings(tmp_path / "out", 3, 1e-3))
    assert not (tmp_path / "out").exists()
