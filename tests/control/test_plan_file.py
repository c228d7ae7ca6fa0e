"""Plans in files that NumPy reads."""

import json

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from loco_drake.cli.main import main
from loco_drake.control.observation import LOOK_AHEAD
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.plan_file import ARRAYS, save_plan
from loco_drake.evaluation.tracking import Recorder
from loco_drake.systems.control import JointTargets, PlanPlayer
from loco_drake.systems.scenario import ExternalAction, GeneratedReference, Scenario

SECONDS = 1.2


def read(path):
    with np.load(path, allow_pickle=False) as archive:
        return dict(archive)


def test_set_points_are_what_joint_targets_outputs_without_an_action(
    go2, trot, tmp_path
):
    save_plan(go2, trot, 1.0, tmp_path / "plans.npz")
    arrays = read(tmp_path / "plans.npz")
    builder = DiagramBuilder()
    player = builder.AddNamedSystem("player", PlanPlayer(go2, trot))
    targets = builder.AddNamedSystem("targets", JointTargets(go2))
    builder.Connect(player.GetOutputPort("plan"), targets.GetInputPort("plan"))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    own = targets.GetMyMutableContextFromRoot(context)
    targets.GetInputPort("action").FixValue(own, np.zeros(12))
    for n in (0, 7, 49):
        simulator.AdvanceTo((n + 0.5) * PLAN_DT)
        desired = targets.GetOutputPort("desired_state").Eval(own)
        np.testing.assert_array_equal(desired[:12], arrays["set_points"][n + 1])
    # By hand: kp is 100 Nm/rad, and 2 Nm s/rad of the planned velocity, which is the
    # mean of two samples, are added.
    v = arrays["v"][:, 6:]
    expected = arrays["q"][1:, 7:] + (v[:-1] + v[1:]) * 0.01
    expected += arrays["feed_forward"][1:] / 100
    np.testing.assert_allclose(arrays["set_points"][1:], expected, atol=1e-12)


def test_it_holds_the_samples_that_a_policy_needs(go2, trot, tmp_path):
    save_plan(go2, trot, 1.0, tmp_path / "plans.npz")
    arrays = read(tmp_path / "plans.npz")
    header = json.loads(str(arrays.pop("header")))
    assert header["schema_version"] == 1
    assert header["robot"] == "go2"
    assert header["joint_names"] == list(go2.joint_names)
    assert header["arrays"] == ARRAYS
    assert sorted(arrays) == sorted(ARRAYS)
    # 50 periods, and all that is seen at the last of their ends.
    count = 51 + LOOK_AHEAD[-1]
    assert {len(array) for array in arrays.values()} == {count}
    np.testing.assert_allclose(np.diff(arrays["time"]), 0.02)
    np.testing.assert_array_equal(arrays["labels"], ["dog-trot"] * count)
    for name in ("q", "v", "vdot", "contacts"):
        np.testing.assert_array_equal(arrays[name], getattr(trot, name)[:count])


def test_a_plan_that_ends_is_written_to_its_end(go2, trot, tmp_path):
    save_plan(go2, trot, trot.end_time, tmp_path / "plans.npz")
    assert len(read(tmp_path / "plans.npz")["q"]) == len(trot)


def test_exported_plans_are_what_a_robot_tracks_in_drake(tmp_path, capsys):
    """To the last bit, with the same gait, seed and duration."""
    path = tmp_path / "plans.npz"
    line = f"export --plans {path} --gait horse-walk --seed 3 --duration {SECONDS}"
    assert main(line.split()) == 0
    assert "horse-walk" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == [path]  # and no policy
    arrays = read(path)
    scenario = Scenario(
        reference=GeneratedReference(gait="horse-walk", seed=3, duration=SECONDS),
        policy=ExternalAction(),
    )
    recorder = Recorder(scenario)
    recorder.diagram.GetInputPort("action").FixValue(recorder.context, np.zeros(12))
    recorder.start()
    rollout, _ = recorder.run(1.0)
    assert len(rollout.state) == 51
    state = np.hstack((arrays["q"], arrays["v"]))
    np.testing.assert_array_equal(rollout.plan_state, state[:51])
    np.testing.assert_array_equal(rollout.path_time, arrays["path_time"][:51])
    sent = rollout.desired_joints[1:]
    np.testing.assert_array_equal(sent, arrays["set_points"][1:51])
