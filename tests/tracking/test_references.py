"""References of a tracker: only what no robot can do is slowed."""

from dataclasses import replace

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.control.retiming import GROUNDED_FALL, path_limits
from loco_drake.evaluation.recorded import load_to_score
from loco_drake.models.robots import get_robot
from loco_drake.motion.motion import FPS, make_motion
from loco_drake.motion.motion_file import save_motion
from loco_drake.motion.packing import pack
from loco_drake.systems.diagram import MakeLocomotionDiagram
from loco_drake.systems.scenario import (
    ExternalAction,
    MotionReference,
    Scenario,
    SmootherConfig,
)
from loco_drake.tracking.references import read_motions, smooth_motions
from tests.synthetic_motion import synthetic_motion


@pytest.fixture
def hops():
    """A trunk that falls at 1.5 g, in motion as it is and said to be grounded."""
    motion = synthetic_motion("dog-trot", 3.0)
    time = np.arange(len(motion)) / FPS
    size = 1.5 * 9.81 / (2 * np.pi * 3) ** 2
    position = motion.base_position.copy()
    height = get_robot("go2").stand_height
    position[:, 2] = height + size * (1.1 + np.sin(2 * np.pi * 3 * time))
    hop = make_motion(
        robot="go2",
        label=motion.label,
        joint_names=motion.joint_names,
        base_position=position,
        base_quaternion=motion.base_quaternion,
        joint_positions=motion.joint_positions,
        contacts=motion.contacts,
        provenance=motion.provenance,
    )
    told = replace(hop, provenance={**hop.provenance, "momentum_error": "0.01"})
    return hop, told


def test_trunk_of_grounded_motion_may_fall_faster_than_a_body(hops):
    """A trunk that falls at 1.5 g is slowed, unless legs that are drawn up push it."""
    robot = get_robot("go2")
    hop, told = hops
    assert (hop.grounded, told.grounded) == (False, True)
    slowed, kept = smooth_motions(robot, [hop, told])
    assert len(slowed) > 1.05 * len(hop)
    assert len(kept) == pytest.approx(len(hop), abs=2)
    assert path_limits(robot, GROUNDED_FALL).acceleration[-1, 0] == -2 * 9.81


def test_the_smoother_of_a_diagram_takes_the_same_limit(hops, tmp_path):
    """Without one in the scenario; a second of smooth plan ends where it does above."""
    ends = []
    for motion, fall in zip((*hops, hops[1]), (None, None, 1.0), strict=True):
        save_motion(motion, tmp_path / "hop.npz")
        scenario = Scenario(
            reference=MotionReference(path=tmp_path / "hop.npz"),
            smoother=SmootherConfig(fall=fall),
            policy=ExternalAction(),
        )
        diagram = MakeLocomotionDiagram(scenario)
        context = diagram.CreateDefaultContext()
        diagram.ExecuteInitializationEvents(context)
        plan = diagram.GetOutputPort("plan").Eval(context)
        # How far the trunk gets in .9 s.
        ends.append(plan.q[plan.index(0.9), 4])
    slowed, kept, limited = ends
    assert limited == slowed < 0.97 * kept


def test_references_may_be_packed(tmp_path):
    """Of two that were packed from several folders, one could not be told apart."""
    robot = get_robot("go2")
    for folder, name, speed in (("a", "x", 0.5), ("a", "y", 0.6), ("b", "x", 0.7)):
        motion = synthetic_motion("dog-trot", 0.4, speed)
        save_motion(motion, tmp_path / folder / f"{name}.npz")
    pack([tmp_path / "a"], tmp_path / "one")
    plain, packed = (read_motions(robot, tmp_path / name) for name in ("a", "one"))
    assert [path.name for path in packed] == ["x.npz", "y.npz"]
    for a, b in zip(plain.values(), packed.values(), strict=True):
        np.testing.assert_array_equal(a.base_position, b.base_position)
    assert len(load_to_score(tmp_path / "one", robot)) == 2
    pack([tmp_path / "a", tmp_path / "b"], tmp_path / "two")
    with pytest.raises(InputError, match=r"There are 2 motions called 'x\.npz' in"):
        read_motions(robot, tmp_path / "two")
