import ast
import re
from pathlib import Path

import numpy as np
import pytest

from loco_drake.cli.main import main
from loco_drake.control.actor_file import load_actor
from loco_drake.evaluation.tracking import joint_rmse
from loco_drake.models.robots import get_robot
from loco_drake.motion.motion_file import load_motion
from loco_drake.motion.quality import toe_trajectories
from loco_drake.systems.scenario import GeneratedReference, Scenario
from tests.process import run_python
from tests.synthetic import write_dog_recording

ROOT = Path(__file__).parents[2]


def run(cwd, name, *arguments):
    """Runs an example from another folder; returns what it printed."""
    environment = {"PYTHONPATH": str(ROOT), "LOCO_DRAKE_CACHE": str(cwd)}
    script = ROOT / "examples" / name
    return run_python(script, *arguments, cwd=cwd, **environment)


@pytest.mark.slow
def test_simulate_walks_ahead(tmp_path):
    printed = run(tmp_path, "simulate.py", "--duration", "2")
    speed = float(re.search(r"([\d.]+) m/s", printed).group(1))
    assert 0.3 < speed < 2.0


@pytest.mark.slow
def test_change_gait_does_both_changes(tmp_path):
    """The scheduled one when it is due, the one through the port within 1 s."""
    printed = run(tmp_path, "change_gait.py", "--duration", "14")
    rows = re.findall(r"^ *(\d+) s  (\S+), ([\d.]+) m/s", printed, re.MULTILINE)
    gaits = {int(second): gait for second, gait, _ in rows}
    assert sorted(gaits) == list(range(1, 15))
    assert {gaits[second] for second in (1, 2, 3)} == {"dog-pace"}
    assert {gaits[second] for second in (5, 6, 7)} == {"dog-trot"}
    assert {gaits[second] for second in range(8, 15)} == {"horse-walk"}
    speeds = {gait: float(speed) for _, gait, speed in rows}  # the last one of each
    assert speeds["dog-pace"] < 1.0 < speeds["dog-trot"]
    assert speeds["horse-walk"] < speeds["dog-trot"]


@pytest.mark.slow
def test_a_figure_of_eight_comes_back_to_its_start(tmp_path):
    """The first circle is left of the start, the second right of it."""
    printed = run(tmp_path, "figure_of_eight.py", "--yaw-rate", "1.0")
    rows = re.findall(r"(\d+) s  x ([+-][\d.]+) m  y ([+-][\d.]+) m", printed)
    y = {int(second): float(y) for second, _, y in rows}
    assert list(y) == list(range(1, 14))
    # The diameter is 2 v / w = 1.6 m.
    assert 1.2 < max(y.values()) < 2.3
    assert -2.3 < min(y.values()) < -0.8
    assert max(y, key=y.get) < 6 < min(y, key=y.get)
    assert float(re.search(r"ends ([\d.]+) m from", printed).group(1)) < 1.0


@pytest.mark.slow
def test_the_robot_goes_to_a_point(tmp_path):
    arguments = ("--x", "1.5", "--y", "-1.0", "--duration", "9")
    printed = run(tmp_path, "go_to_point.py", *arguments)
    far = [float(x) for x in re.findall(r"([\d.]+) m from the point", printed)]
    assert len(far) == 9
    assert far[0] > 0.8
    assert max(far[-2:]) < 0.25


@pytest.mark.slow
def test_retarget_saves_a_replay_of_the_recording(tmp_path):
    write_dog_recording(tmp_path / "dog.txt", "trot", seconds=2.0)
    arguments = ("--gait", "trot", "--end", "90", "--html", "replay.html")
    printed = run(tmp_path, "retarget.py", "dog.txt", *arguments)
    # 89 steps of 1/60 s hold 74 whole ones of 20 ms.
    assert "75 frames" in printed
    page = (tmp_path / "replay.html").read_text()
    assert "<html" in page
    assert 1e6 < len(page) < 10e6


def test_own_motion_bows_over_feet_that_stand(tmp_path):
    run(tmp_path, "own_motion.py", "--out", "bow.npz", "--depth", "0.05")
    motion = load_motion(tmp_path / "bow.npz")
    assert (str(motion.label), len(motion)) == ("own-bow", 200)
    assert np.ptp(motion.base_position[:, 2]) == pytest.approx(0.05, abs=1e-3)
    toes = toe_trajectories(motion, get_robot("go2"))
    assert np.ptp(toes, axis=0).max() < 1e-4


@pytest.mark.slow
def test_train_tracker_learns_and_leaves_a_policy_that_loads(tmp_path):
    arguments = ("--steps", "512", "--batch", "256", "--references", "1")
    few = ("--seconds", "3", "--workers", "1", "--out", "out")
    printed = run(tmp_path, "train_tracker.py", *arguments, *few)
    for steps in (256, 512):
        assert f"{steps} of 512 steps: dog-pace" in printed
    actor = load_actor(tmp_path / "out" / "policy.safetensors", get_robot("go2"))
    assert actor.config.labels == ["dog-pace", "dog-trot"]
    assert np.isfinite(actor.mean.numpy()).all()
    assert (actor.mean.numpy() != 0).any()  # it has seen observations


@pytest.mark.slow
def test_an_exported_policy_trots_in_mujoco_without_a_fall(tmp_path, monkeypatch):
    """As well as evaluate tracking finds, though it shares no code with it."""
    pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")
    from loco_drake.evaluation.mujoco import MujocoRecorder
    from loco_drake.models.mujoco_plant import MujocoConfig

    monkeypatch.chdir(tmp_path)
    files = "--onnx policy.onnx --plans plans.npz --mjcf go2.xml"
    line = f"export {files} --gait dog-trot --duration 3 --seed 5"
    assert main(line.split()) == 0
    printed = run(tmp_path, "deploy_onnx.py")
    figures = dict(re.findall(r"^(.+): (\S+)$", printed, re.MULTILINE))
    assert float(figures["Largest error in the test vectors"]) < 1e-5
    assert (figures["fell"], figures["simulated_s"]) == ("False", "3.000")
    scenario = Scenario(reference=GeneratedReference(gait="dog-trot", duration=3.0))
    recorder = MujocoRecorder(scenario, MujocoConfig())
    recorder.start(seed=5)
    expected = joint_rmse(recorder.run(3.0)[0])
    assert float(figures["joint_rmse_rad"]) == pytest.approx(expected, abs=2e-3)
    assert float(figures["from_plan_m"]) < 0.2


def test_readme_shows_the_first_example_as_it_is():
    source = (ROOT / "examples" / "simulate.py").read_text()
    docstring = ast.parse(source).body[0]
    body = "".join(source.splitlines(keepends=True)[docstring.end_lineno :]).lstrip()
    (block,) = re.findall(
        r"^```python\n(.*?)^```$",
        (ROOT / "README.md").read_text(),
        flags=re.DOTALL | re.MULTILINE,
    )
    assert block == body


def test_every_example_is_run_here():
    run_here = re.findall(r'run\(tmp_path, "(\w+\.py)"', Path(__file__).read_text())
    assert sorted(run_here) == sorted(p.name for p in (ROOT / "examples").glob("*.py"))


@pytest.mark.parametrize("path", sorted((ROOT / "examples").glob("*.py")))
def test_main_guard_keeps_imports_free_of_work(path):
    """Worker processes import the script again, so only the guard may do work."""
    *statements, guard = ast.parse(path.read_text()).body
    assert ast.unparse(guard).startswith("if __name__ == '__main__':")
    allowed = (ast.Import, ast.ImportFrom, ast.FunctionDef, ast.ClassDef, ast.Assign)
    docstring, *others = statements
    assert isinstance(docstring.value.value, str)
    assert all(isinstance(statement, allowed) for statement in others)
