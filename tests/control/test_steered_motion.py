import numpy as np
import pytest

from loco_drake.control.steered_motion import steered_motion, training_range
from loco_drake.motion.conventions import check_conventions
from loco_drake.motion.motion_file import load_motion, save_motion
from loco_drake.motion.quality import stance_slip_speeds, toe_trajectories
from tests.synthetic_motion import synthetic_motion


def test_a_trot_is_steered_backwards_and_a_gallop_is_not():
    trot = training_range(synthetic_motion("dog-trot", 4.0, 1.0))
    assert trot.low == (-0.5, -0.35, -1.2)
    assert trot.high == pytest.approx((1.5, 0.35, 1.2))
    motion = synthetic_motion("dog-pace", 4.0, 1.0)
    gallop = training_range(type(motion)(**{**vars(motion), "gait": "gallop"}))
    assert gallop.low == pytest.approx((0.3, -0.35, -0.6))


def test_steered_motion_is_sound_motion(go2, tmp_path):
    """It passes the checks of files, its feet stay, and its provenance says what."""
    motion = synthetic_motion("dog-trot", 8.0, 0.7)
    steered = steered_motion(go2, motion, seed=3)
    check_conventions(steered)
    save_motion(steered, tmp_path / "steered.npz")
    assert load_motion(tmp_path / "steered.npz").provenance == steered.provenance
    slip, before = (
        stance_slip_speeds(toe_trajectories(m, go2), go2.foot_radius, 50.0)
        for m in (steered, motion)
    )
    assert np.median(slip) <= np.median(before) + 1e-3
    assert len(steered.provenance["steered"].split(";")) == 4
    assert "m/s forward" in steered.provenance["steered_by"]
    assert steered.label == motion.label


def test_its_commands_are_those_of_its_seed(go2):
    motion = synthetic_motion("dog-trot", 6.0, 0.7)
    first, again, other = (steered_motion(go2, motion, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.joint_positions, again.joint_positions)
    assert (first.base_position != other.base_position).any()
    assert np.abs(first.base_position - motion.base_position).max() > 0.3
