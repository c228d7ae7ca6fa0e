"""Trainings by a recipe: interrupted anywhere, they end as if they had not been."""

import json
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.common.files import read_json
from loco_drake.common.run_folder import locked, read_checkpoint
from loco_drake.control.actor_file import load_actor, read_actor
from loco_drake.control.observation import OBSERVATION_SIZE
from loco_drake.models.plant import PlantConfig
from loco_drake.models.robots import get_robot
from loco_drake.motion.motion_file import load_motion
from loco_drake.tracking.exact_return import exact_returns
from loco_drake.tracking.joining import recovery_of
from loco_drake.tracking.laws import load_found
from loco_drake.tracking.recipe import Before, Recipe, read_recipe
from loco_drake.tracking.recipe_folder import recipe_curve
from loco_drake.tracking.recipe_parts import Evaluation, ReferenceSet, Stage
from loco_drake.tracking.recipe_references import make_references
from loco_drake.tracking.recipe_run import run_recipe
from loco_drake.tracking.references import load_references
from tests.process import LIMIT

pytestmark = pytest.mark.slow

CHECKPOINT, POLICY = "checkpoint.safetensors", "policy.safetensors"
# Kills the process when the function of the module is called for the n-th time, before
# or after its work.
KILLED = """
import os, signal, sys
from pathlib import Path
from loco_drake.tracking import recipe_references, recipe_run
from loco_drake.tracking.recipe import read_recipe

recipe, folder, module, name, count, after = sys.argv[1:]
module = {"run": recipe_run, "references": recipe_references}[module]
works, calls = getattr(module, name), 0

def killed(*arguments, **options):
    global calls
    calls += 1
    if calls == int(count) and after == "before":
        os.kill(os.getpid(), signal.SIGKILL)
    result = works(*arguments, **options)
    if calls == int(count):
        os.kill(os.getpid(), signal.SIGKILL)
    return result

if __name__ == "__main__":
    setattr(module, name, killed)
    recipe_run.run_recipe(Path(folder), read_recipe(Path(recipe)))
"""


def make_recipe():
    return Recipe(
        environments=4,
        references={
            "plain": ReferenceSet(labels=["dog-trot"], count=2, seconds=3.0),
            "steered": ReferenceSet(
                labels=["dog-pace", "dog-trot"], count=1, seconds=3.0, steered=True
            ),
        },
        stages=[
            Stage(name="first", steps=192, references=["plain"]),
            Stage(name="second", steps=128, environment={"fall_cost": 15.0}),
        ],
        evaluation=Evaluation(
            every=100, motions=ReferenceSet(labels=["dog-trot"], count=1, seconds=2.0)
        ),
    )


@pytest.fixture(scope="module")
def recipe():
    recipe = make_recipe()
    recipe.common.environment = {"episode_steps": 20}
    recipe.common.ppo = {"batch": 64, "minibatch": 32, "epochs": 2, "hidden": [16, 16]}
    return recipe


@pytest.fixture(scope="module")
def ended(recipe, tmp_path_factory):
    """A recipe that was never interrupted."""
    folder = tmp_path_factory.mktemp("recipe") / "run"
    return folder, run_recipe(folder, recipe)


def test_a_guided_stage_between_two(recipe, tmp_path):
    """Its networks are those of the policy before, and the next stage begins there."""
    stretch = {"length": 30, "tail": 4, "lead": 0, "ilqr": {"iterations": 1}}
    options = {"stretches": 2, "updates": 20, "minibatch": 32, "stretch": stretch}
    shown = Stage(
        name="shown", steps=1, guided=options, references=["plain"], recovery="first"
    )
    stages = [recipe.stages[0], shown, replace(recipe.stages[1], steps=64)]
    figures = run_recipe(tmp_path / "run", replace(recipe, stages=stages))
    folder = tmp_path / "run"
    laws = sorted((folder / "2-shown" / "laws" / "001").iterdir())
    assert laws
    begun = read_actor(folder / "2-shown" / "start.safetensors")[0].state_dict()
    first = read_actor(folder / "1-first" / POLICY)[0].state_dict()
    assert all((begun[name] == first[name]).all() for name in first)
    assert not (folder / "both.safetensors").exists()
    periods = read_json(folder / "2-shown" / "figures.json")["steps"]
    assert periods == sum(load_found(path).periods for path in laws)
    assert figures["steps"] == 192 + periods + 64
    shown, last = (
        read_actor(folder / name / POLICY)[0].layers[0].weight.detach()
        for name in ("2-shown", "3-second")
    )
    assert 0 < (last - shown).abs().max() < 0.02
    assert (shown - read_actor(folder / "1-first" / POLICY)[0].layers[0].weight).any()
    # What acts far from the plan is what the guided stage ended with.
    far, whole = (
        recovery_of(read_actor(folder / name)[0])
        for name in (f"2-shown/{POLICY}", POLICY)
    )
    noise = 0.5 * torch.randn(5, OBSERVATION_SIZE)
    seen = far.mean + noise * far.variance.sqrt()
    torch.testing.assert_close(far(seen), whole(seen), rtol=1e-2, atol=1e-2)
    again = run_recipe(folder, resume=True)
    assert again["steps"] == figures["steps"]


def contents(folder):
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in files}


def check_same_results(folder, other):
    """Policies and checkpoints are those of ``other``, bit for bit."""
    assert (folder / POLICY).read_bytes() == (other / POLICY).read_bytes()
    for stage in ("1-first", "2-second"):
        own, theirs = (
            read_checkpoint(run / stage / CHECKPOINT, "tracker")
            for run in (folder, other)
        )
        assert own.state == theirs.state
        assert own.run == theirs.run
        assert own.tensors.keys() == theirs.tensors.keys()
        for name, value in own.tensors.items():
            assert torch.equal(value.nan_to_num(), theirs.tensors[name].nan_to_num())


def test_a_recipe_leaves_motions_stages_and_the_policy(ended, recipe):
    folder, figures = ended
    assert not figures["interrupted"]
    assert figures["steps"] == 320
    assert read_recipe(folder / "recipe.yaml") == recipe
    references = {path.relative_to(folder) for path in folder.rglob("*.npz")}
    names = ("plain/dog-trot-1000", "plain/dog-trot-1001")
    names += ("steered/dog-pace-1000", "steered/dog-trot-1000")
    names += ("evaluation/dog-trot-1000",)
    assert references == {Path(f"references/{name}.npz") for name in names}
    steered = [load_motion(folder / x).provenance.get("steered") for x in references]
    assert sum(x is not None for x in steered) == 2
    policy = load_actor(folder / POLICY, get_robot("go2"))
    exact = load_actor(folder / "2-second" / POLICY, get_robot("go2"))
    for name, value in policy.state_dict().items():
        torch.testing.assert_close(
            value, exact.state_dict()[name], rtol=1e-3, atol=1e-4
        )
    second = read_checkpoint(folder / "2-second" / CHECKPOINT, "tracker").run
    assert second["references"].startswith("4 motions")
    assert (second["fall_cost"], second["seed"]) == (15.0, 1)


def test_a_stage_begins_with_the_networks_of_the_one_before(ended):
    """They have moved little since; a new one's are elsewhere."""
    first, second = (
        read_checkpoint(ended[0] / stage / CHECKPOINT, "tracker")
        for stage in ("1-first", "2-second")
    )
    assert second.state["steps"] == 128
    assert second.state["normalizer_count"] > first.state["normalizer_count"] + 127
    name = "module/mlp_extractor.policy_net.0.weight"
    moved = (second.tensors[name] - first.tensors[name]).abs().max()
    assert 0 < moved < 0.02 < first.tensors[name].abs().max()


def test_the_curve_counts_the_steps_of_all_stages(ended):
    folder, figures = ended
    written = json.loads((folder / "curve.json").read_text())
    assert written == {k: figures[k] for k in written}
    starts = [(stage["name"], stage["first_step"]) for stage in written["stages"]]
    assert starts == [("first", 0), ("second", 192)]
    # A run that ends writes no line for its last batch.
    assert written["curve"]["steps"] == [64, 128, 192 + 64]
    assert written["curve"]["seconds"] == sorted(written["curve"]["seconds"])
    log = (folder / "2-second" / "progress.jsonl").read_text().splitlines()
    last = json.loads(log[-1])
    own = [last[f"return/{label}"] for label in ("dog-pace", "dog-trot")]
    assert written["curve"]["return"][-1] == pytest.approx(sum(own) / 2, abs=0.01)


def test_policies_are_evaluated_on_the_way_and_after_each_stage(ended, recipe):
    """Every 100 steps, when a batch of 64 is done; twice after the second stage."""
    folder, figures = ended
    points = figures["evaluation"]
    assert [x["steps"] for x in points] == [128, 192, 256, 320]
    assert [x["stage"] for x in points] == ["first", "first", "second", "second"]
    assert json.loads((folder / "evaluation.json").read_text())["points"] == points
    robot = get_robot("go2")
    plans = load_references(robot, folder / "references" / "evaluation")
    policy = load_actor(folder / "2-second" / POLICY, robot)
    returns = exact_returns(policy, plans, 100, PlantConfig())
    assert points[-1]["by_label"] == {"dog-trot": round(returns["dog-trot"], 2)}
    assert points[-1]["mean_return"] == points[-1]["by_label"]["dog-trot"]
    assert figures["steps_to_90"] is None


def test_two_stages_can_come_after_one_and_their_networks_act_together(
    ended, recipe, tmp_path
):
    second = recipe.stages[1]
    third = Stage(name="third", after="first", steps=64)
    two = replace(recipe, stages=[recipe.stages[0], second, third], recovery="second")
    folder = tmp_path / "run"
    shutil.copytree(ended[0], folder)
    for name in (POLICY, "curve.json"):
        (folder / name).unlink()
    figures = run_recipe(folder, two, resume=True)
    assert read_recipe(folder / "recipe.yaml") == two
    assert figures["steps"] == 192 + 128 + 64
    last, result = figures["evaluation"][-2:]
    assert (last["stage"], last["steps"]) == ("third", 384)
    assert (result["stage"], result["steps"]) == ("result", 384)
    networks = [
        read_checkpoint(folder / stage / CHECKPOINT, "tracker").tensors
        for stage in ("1-first", "2-second", "3-third")
    ]
    name = "module/mlp_extractor.policy_net.0.weight"
    first, other, own = (tensors[name] for tensors in networks)
    assert (own - first).abs().max() < (own - other).abs().max()
    go2 = get_robot("go2")
    policy = load_actor(folder / POLICY, go2)
    assert not list(folder.glob("both*"))
    alone = load_actor(folder / "2-second" / POLICY, go2)
    seen = alone.mean + 0.3 * alone.variance.sqrt() * torch.randn(8, OBSERVATION_SIZE)
    with torch.inference_mode():
        far, kept = alone(seen), recovery_of(policy)(seen)
    torch.testing.assert_close(kept, far, rtol=2e-2, atol=2e-3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"recovery": "second"}, "Unknown stage for recovery 'second'"),
        ({"recovery": "none"}, "the choices are first"),
        ({"after": "second"}, "Unknown stage before second 'second'"),
    ],
)
def test_stages_that_are_named_must_be_there_before(recipe, change, message):
    second = replace(recipe.stages[1], after=change.get("after"))
    stages = [recipe.stages[0], second]
    wrong = replace(recipe, stages=stages, recovery=change.get("recovery"))
    with pytest.raises(InputError, match=message):
        wrong.check()


def test_the_steps_to_a_return_of_90_are_those_of_its_first_time(ended, tmp_path):
    points = json.loads((ended[0] / "evaluation.json").read_text())["points"]
    for point, mean in zip(points, (89.99, 90.0, 89.0, 95.0), strict=True):
        point["mean_return"] = mean
    (tmp_path / "evaluation.json").write_text(json.dumps({"points": points}))
    assert recipe_curve(tmp_path, Recipe())["steps_to_90"] == 192
    points[0]["by_label"] = 3
    (tmp_path / "evaluation.json").write_text(json.dumps({"points": points}))
    with pytest.raises(InputError, match=r"evaluation.json is damaged: .*by_label"):
        recipe_curve(tmp_path, Recipe())


def test_results_do_not_depend_on_the_number_of_processes(ended, recipe, tmp_path):
    run_recipe(tmp_path / "run", recipe, workers=2)
    check_same_results(tmp_path / "run", ended[0])


@pytest.mark.parametrize(
    "point",
    [
        "references save_motion 2 after",  # within a batch of motions
        "references write_json 2 before",  # all motions, not yet marked as such
        "run train_tracker 1 after",  # trained, not yet marked as such
        "run train_tracker 2 before",
        "run halve_policy 1 before",
    ],
)
def test_a_killed_recipe_goes_on_to_the_same_policy(point, ended, recipe, tmp_path):
    folder = tmp_path / "run"
    arguments = [ended[0] / "recipe.yaml", folder, *point.split()]
    process = subprocess.run(
        [sys.executable, "-c", KILLED, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )
    assert process.returncode == -signal.SIGKILL, process.stderr
    with pytest.raises(InputError, match="holds a run already"):
        run_recipe(folder, recipe)
    before = contents(folder)
    figures = run_recipe(folder, resume=True)
    assert not figures["interrupted"]
    assert figures["steps"] == 320
    check_same_results(folder, ended[0])
    after = contents(folder)
    for path, (content, time) in before.items():
        if path.suffix == ".npz":
            assert after[path] == (content, time)
        elif path.suffix == ".jsonl":
            assert after[path][0].startswith(content)


def test_an_interrupted_stage_goes_on_with_its_next_batch(recipe, ended, tmp_path):
    def interrupt(what, done, total, note):
        if (what, done) == ("2 second", 64):
            signal.raise_signal(signal.SIGINT)

    figures = run_recipe(tmp_path, recipe, report=interrupt)
    assert figures["interrupted"]
    assert figures["steps"] == 192 + 64
    assert not (tmp_path / POLICY).exists()
    assert not run_recipe(tmp_path, resume=True)["interrupted"]
    state = read_checkpoint(tmp_path / "2-second" / CHECKPOINT, "tracker").state
    assert state["steps"] == 128
    assert load_actor(tmp_path / POLICY, get_robot("go2"))


def test_an_interruption_between_stages_is_heard(recipe, tmp_path):
    """While motions are made, and it does not begin to train then."""
    figures = run_recipe(
        tmp_path, recipe, report=lambda *told: signal.raise_signal(signal.SIGINT)
    )
    assert figures["interrupted"]
    assert figures["steps"] == 0
    assert len(list(tmp_path.rglob("*.npz"))) == 2
    assert not (tmp_path / "1-first").exists()


def test_nothing_is_done_again_and_nothing_overwritten(recipe, ended, tmp_path):
    folder = ended[0]
    before = contents(folder)
    with pytest.raises(InputError, match=r"holds a run already.*--resume.*--out"):
        run_recipe(folder, recipe)
    with (
        locked(folder),
        pytest.raises(InputError, match="Another training is at work"),
    ):
        run_recipe(folder, resume=True)
    with pytest.raises(InputError, match=r"no recipe to resume.*recipe.yaml"):
        run_recipe(folder / "1-first", resume=True)
    assert contents(folder) == before
    (tmp_path / "1-first").mkdir()
    with pytest.raises(InputError, match=r"holds a run already \(1-first\)"):
        run_recipe(tmp_path, recipe)
    run_recipe(folder, recipe, resume=True)
    changed = {path for path, x in contents(folder).items() if x != before.get(path)}
    assert changed <= {folder / "curve.json", folder / POLICY}
    assert all(path.read_bytes() == before[path][0] for path in before)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"seed": 3}, "other seed;"),
        ({"robot": "a1", "environments": 8}, "other robot, environments;"),
        ({"start_from": Path("go2")}, "other start_from;"),
        ({"references": {}}, "other references"),
        ({"stages": []}, "'first', which has begun, the stage 'second', which has"),
    ],
)
def test_a_recipe_cannot_change_what_has_begun(change, said, recipe, ended):
    other = replace(recipe, **change)
    if "references" in change:
        sets = dict(recipe.references)
        other.references = {**sets, "plain": replace(sets["plain"], count=3)}
    if "stages" in change:
        other.stages = [replace(stage, steps=64) for stage in recipe.stages]
    before = contents(ended[0])
    with pytest.raises(InputError, match=said):
        run_recipe(ended[0], other, resume=True)
    assert contents(ended[0]) == before


def test_stages_that_have_not_begun_may_change(recipe, ended, tmp_path):
    """The result is that of the recipe as it is in the end."""
    one = replace(recipe, stages=recipe.stages[:1])
    one.references = {"plain": recipe.references["plain"]}
    assert not run_recipe(tmp_path, one)["interrupted"]
    assert run_recipe(tmp_path, recipe, resume=True)["steps"] == 320
    check_same_results(tmp_path, ended[0])
    assert read_recipe(tmp_path / "recipe.yaml") == recipe


def test_a_recipe_can_start_from_a_policy_which_it_keeps(recipe, ended, tmp_path):
    """The A1's from the Go2's; the file may change or vanish afterwards."""
    file = tmp_path / "go2.safetensors"
    file.write_bytes((ended[0] / POLICY).read_bytes())
    one = replace(recipe, robot="a1", start_from=file, stages=recipe.stages[:1])
    one.references = {"plain": recipe.references["plain"]}
    run = tmp_path / "run"
    run_recipe(run, one, report=lambda *told: signal.raise_signal(signal.SIGINT))
    kept = (run / "start.safetensors").read_bytes()
    assert kept == file.read_bytes()
    file.unlink()
    assert run_recipe(run, resume=True)["steps"] == 192
    count = read_checkpoint(run / "1-first" / CHECKPOINT, "tracker").state
    policy = read_checkpoint(ended[0] / "2-second" / CHECKPOINT, "tracker").state
    assert count["normalizer_count"] > policy["normalizer_count"] + 191


def test_ones_own_motions_are_copied(ended, tmp_path):
    own = ReferenceSet(folder=ended[0] / "references" / "plain")
    assert make_references(get_robot("go2"), own, tmp_path)
    names = [f"dog-trot-{seed}.npz" for seed in (1000, 1001)]
    assert sorted(path.name for path in tmp_path.glob("*.npz")) == names
    for name in names:
        assert (tmp_path / name).read_bytes() == (own.folder / name).read_bytes()
    with pytest.raises(InputError, match="holds other references"):
        make_references(get_robot("go2"), ReferenceSet(), tmp_path)


def test_motions_are_grounded_if_asked_for(tmp_path):
    """The trunk moves; in a folder of before there was the field it did not."""
    trunks = []
    for grounded in (False, True):
        one = ReferenceSet(labels=["dog-trot"], count=1, seconds=2.0, grounded=grounded)
        folder = tmp_path / str(grounded)
        assert make_references(get_robot("go2"), one, folder)
        trunks.append(load_motion(folder / "dog-trot-1000.npz").base_position)
    moved = abs(trunks[1] - trunks[0]).max()
    assert 1e-4 < moved < 0.1
    mark = tmp_path / "False" / "references.json"
    text = json.loads(mark.read_text())
    del text["set"]["grounded"]
    mark.write_text(json.dumps(text))
    same = ReferenceSet(labels=["dog-trot"], count=1, seconds=2.0)
    assert make_references(get_robot("go2"), same, mark.parent)
    with pytest.raises(InputError, match="holds other references"):
        make_references(get_robot("go2"), one, mark.parent)


def test_motions_of_other_weights_are_not_mixed(tmp_path):
    one = ReferenceSet(labels=["dog-trot", "dog-pace"], count=1, seconds=2.0)
    asked = iter([False, True])
    assert not make_references(
        get_robot("go2"), one, tmp_path, stopped=lambda: next(asked)
    )
    mark = tmp_path / "references.json"
    text = json.loads(mark.read_text())
    assert text["complete"] is False
    text["made_by"]["generator"] = "another"
    mark.write_text(json.dumps(text))
    with pytest.raises(InputError, match="begun with other weights"):
        make_references(get_robot("go2"), one, tmp_path)


def test_stages_of_another_recipe_can_be_done_before(recipe, ended, tmp_path):
    """Interrupted within them, too; they end as they do there, and count."""
    path = ended[0] / "recipe.yaml"
    one = replace(recipe, robot="a1", before=Before(recipe=path, stages=1))
    one.stages = [replace(recipe.stages[0], steps=64)]
    run = tmp_path / "run"

    def interrupt(what, done, total, note):
        if (what, done) == ("before: 1 first", 64):
            signal.raise_signal(signal.SIGINT)

    assert run_recipe(run, one, report=interrupt)["steps"] == 64
    figures = run_recipe(run, resume=True)
    assert not figures["interrupted"]
    assert figures["steps"] == 192 + 64
    assert figures["stages"] == [{"name": "first", "first_step": 192}]
    assert [x["steps"] for x in figures["evaluation"]] == [256]
    assert figures["curve"]["steps"] == sorted(figures["curve"]["steps"])
    kept, other = (folder / "1-first" for folder in (run / "before", ended[0]))
    states = [read_checkpoint(x / CHECKPOINT, "tracker").state for x in (kept, other)]
    assert states[0]["steps"] == states[1]["steps"] == 192
    assert (run / "start.safetensors").read_bytes() == (kept / CHECKPOINT).read_bytes()
    count = read_checkpoint(run / "1-first" / CHECKPOINT, "tracker").state
    assert count["normalizer_count"] > states[0]["normalizer_count"]
    assert load_actor(run / POLICY, get_robot("a1"))
    assert read_recipe(run / "recipe.yaml") == one
    with pytest.raises(InputError, match="at most 2, not 3"):
        replace(one, before=Before(recipe=path, stages=3)).check()
    with pytest.raises(InputError, match="either start_from or before"):
        replace(one, start_from=path).check()
