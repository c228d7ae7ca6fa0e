from dataclasses import replace

import numpy as np
import pytest

from loco_drake.evaluation.motion_scores import (
    compare,
    joint_jerk,
    mean_speed,
    measure,
    overall,
)
from loco_drake.models.robots import get_robot
from loco_drake.motion.quality import (
    penetration_max,
    stance_slip_median,
    toe_trajectories,
)
from tests.synthetic_motion import synthetic_motion
from tests.varied_motion import shaken, varied_motions

GO2 = get_robot("go2")


def test_jerk_by_hand():
    """q = c t^3 / 6 has the jerk c: 3 on one joint, 4 on another, 0 on ten."""
    motion = synthetic_motion()
    time = np.arange(len(motion)) / motion.fps
    joints = np.zeros((len(motion), 12))
    joints[:, 0], joints[:, 7] = 3 * time**3 / 6, 4 * time**3 / 6
    cubic = replace(motion, joint_positions=joints)
    assert joint_jerk([cubic, cubic]) == pytest.approx(np.sqrt((9 + 16) / 12))
    assert joint_jerk([cubic.slice(0, 3)]) is None


@pytest.mark.parametrize("turn", [0.0, 0.5])
def test_speed_is_along_the_heading(turn):
    motion = synthetic_motion(speed=0.8, turn=turn)
    assert mean_speed(GO2, motion) == pytest.approx(0.8, abs=0.005)
    sideways = replace(motion, base_position=motion.base_position[:, [1, 0, 2]])
    if not turn:
        assert mean_speed(GO2, sideways) == pytest.approx(0.0, abs=1e-9)


def test_the_same_motion_compares_as_equal():
    motions = varied_motions("dog-trot", 4)
    figures = compare(measure(GO2, motions), measure(GO2, motions))
    assert figures["jerk_ratio"] == pytest.approx(1.0)
    assert figures["speed_error_mps"] == figures["speed_distance_mps"] == 0.0
    toes = [toe_trajectories(m, GO2) for m in motions[:1]]
    alone = compare(measure(GO2, motions[:1]), None)
    radius = GO2.foot_radius
    assert alone["stance_slip_median_mps"] == stance_slip_median(toes[0], radius, 50.0)
    assert alone["penetration_max_m"] == penetration_max(toes[0], radius)
    assert alone["jerk_ratio"] is alone["speed_error_mps"] is None
    assert "no recordings" in alone["reason"]


def test_bad_motion_scores_badly():
    """Shaken joints jerk, slip and sink; motion a tenth too fast is off by a tenth."""
    motions = varied_motions("dog-trot", 4)
    real = measure(GO2, motions)
    good = compare(real, real)
    bad = compare(measure(GO2, [shaken(m, 0.02) for m in motions]), real)
    assert bad["jerk_ratio"] > 3
    assert bad["stance_slip_median_mps"] > 10 * good["stance_slip_median_mps"] + 0.1
    assert bad["penetration_max_m"] > good["penetration_max_m"] + 0.005
    fast = [
        replace(m, base_position=m.base_position * [1.1, 1.1, 1.0]) for m in motions
    ]
    error = compare(measure(GO2, fast), real)["speed_error_mps"]
    assert error == pytest.approx(0.1 * real.speeds.mean(), rel=0.02)


def test_the_right_mean_with_the_wrong_spread():
    """Speeds .4 and 1.2 against .8 and .8: no error of the mean, .4 to be moved."""
    split = [synthetic_motion(speed=speed) for speed in (0.4, 1.2)]
    same = [synthetic_motion(speed=0.8)] * 2
    figures = compare(measure(GO2, split), measure(GO2, same))
    assert figures["speed_error_mps"] == pytest.approx(0.0, abs=0.005)
    assert figures["speed_distance_mps"] == pytest.approx(0.4, abs=0.01)


def test_all_labels_together():
    """Jerk half and twice as strong: 1 on average; the deepest; the mean error."""
    motions = {k: measure(GO2, varied_motions(k, 2)) for k in ("dog-pace", "dog-trot")}
    labels = {
        "dog-pace": {"jerk_ratio": 0.5, "speed_error_mps": 0.1},
        "dog-trot": {"jerk_ratio": 2.0, "speed_error_mps": 0.3},
        "mpc-trot": {"jerk_ratio": None, "speed_error_mps": None},
    }
    figures = overall(labels, list(motions.values()))
    assert figures["jerk_ratio"] == pytest.approx(1.0)
    assert figures["speed_error_mps"] == pytest.approx(0.2)
    assert figures["speed_distance_mps"] is None
    deepest = max(m.penetration for m in motions.values())
    assert figures["penetration_max_m"] == deepest
    assert overall({}, [])["stance_slip_median_mps"] is None
