from pathlib import Path

import numpy as np
import pytest

from loco_drake.datasets.segments import Segment, read_segments
from loco_drake.engine.local import Local
from loco_drake.evaluation.retargeting import (
    ClipScore,
    FailedClip,
    GaitFidelity,
    figures,
    score_segments,
    summarize,
)
from loco_drake.models.robots import get_robot
from loco_drake.retargeting.report import RetargetReport


def score(gait="trot", name="a", frames=100, fidelity=None, slips=(), **changes):
    """A score of a dog's clip with figures of 1 mm and none beyond limits."""
    report = {
        "frames_per_second": 500.0,
        "toe_error_rmse_m": 0.001,
        "correction_rmse_m": 0.001,
        "trunk_correction_rmse_m": 0.001,
        "stance_slip_median_mps": float(np.median(slips)) if len(slips) else None,
        "penetration_max_m": 0.001,
        "joint_limit_violations": 0,
        "joint_speed_ratio_max": 0.5,
        "scale": 1.0,
        "time_scale": 1.0,
        "mirrored": False,
        "on_feet_share": None,
        "on_feet_frames": None,
        "trunk_height_ratio": 1.0,
        "toes_in_place_share": 1.0,
        "source_track_m": 0.1,
        "unsolved_frames": 0,
    }
    return ClipScore(
        segment=Segment("dog", Path(f"{name}.txt"), gait, 0, 100, 60.0),
        report=RetargetReport(frames=frames, **{**report, **changes}),
        slip_speeds=np.array(slips),
        fidelity=fidelity and GaitFidelity(*fidelity),
    )


def test_aggregation_by_hand():
    """Errors 3 mm in 100 frames and 1 mm in 300: the root of (9 + 3) / 4 is 3^.5 mm."""
    one = score(
        slips=(0.1, 0.2, 0.9),
        toe_error_rmse_m=0.003,
        penetration_max_m=0.002,
        joint_limit_violations=2,
        fidelity=(0.1, 0.3, 0.2),
    )
    two = score(
        name="b",
        frames=300,
        slips=(0.0, 0.0),
        joint_limit_violations=5,
        joint_speed_ratio_max=1.2,
        fidelity=(0.3, 0.1, 0.0),
    )
    short = score(name="c", frames=50, slips=(), toe_error_rmse_m=0.0)
    got = figures([one, two])
    assert got["stance_slip_median_mps"] == pytest.approx(0.1)
    assert got["penetration_max_m"] == 0.002
    assert got["joint_limit_violations"] == 7
    assert got["joint_speed_ratio_max"] == 1.2
    assert got["toe_error_rmse_m"] == pytest.approx(np.sqrt(3) * 1e-3)
    assert got["stride_period_error"] == pytest.approx(0.2)
    assert got["phase_lag_error"] == pytest.approx(0.2)
    assert got["duty_factor_error"] == pytest.approx(0.1)
    assert got["clips"] == 2
    assert "reason" not in got
    name = "dog-trot-a-0-100"
    assert got["worst"]["phase_lag_error"] == {"value": 0.3, "clip": name}
    # A clip without three strides counts in all but the rhythm.
    more = figures([one, two, short])
    assert more["stride_period_error"] == got["stride_period_error"]
    assert (more["clips"], more["clips_of_three_strides"]) == (3, 2)


def test_null_comes_with_its_reason():
    got = figures([score()])
    assert got["stance_slip_median_mps"] is got["stride_period_error"] is None
    assert got["reason"] == "no toe ever stands; no clip holds three strides"
    assert figures([])["reason"] == "no clip could be retargeted"
    assert figures([])["clips"] == 0


def test_other_labels_and_failures_are_told_apart():
    """400 frames in 1 s, 100 in .5 s: 333 frames/s. A turn is none of the fifteen."""
    turn = score("turn_left", frames=400, frames_per_second=400.0, toe_error_rmse_m=1)
    trot = score(frames_per_second=200.0)
    bad = FailedClip(Segment("dog", Path("d.txt"), "pace", 0, 9, 60.0), "It is cut.")
    got = summarize([turn, trot, bad])
    assert set(got["labels"]) == {"dog-trot", "dog-pace"}
    assert set(got["other"]) == {"dog-turn_left"}
    assert got["all"]["clips"] == 1
    assert got["all"]["toe_error_rmse_m"] == pytest.approx(0.001)
    assert got["frames_per_second"] == pytest.approx(500 / 1.5)
    assert got["library"] is None
    assert got["failed"] == {"dog-pace-d-0-9": "It is cut."}
    assert got["labels"]["dog-pace"]["reason"] == "no clip could be retargeted"


def test_made_dogs_are_scored_alike_by_one_process_and_by_two(made_data):
    segments = read_segments(made_data)
    robot = get_robot("go2")
    alone = list(score_segments(segments, robot))
    shared = list(score_segments(segments, robot, Local(2)))
    assert [s.segment for s in shared] == [s.segment for s in alone] == segments
    for a, b in zip(alone, shared, strict=True):
        np.testing.assert_array_equal(a.slip_speeds, b.slip_speeds)
        assert a.fidelity == b.fidelity
        assert a.point.label == b.point.label
        np.testing.assert_array_equal(a.point.summaries, b.point.summaries)
        assert a.fidelity.stride_period_error < 0.01
        assert a.fidelity.phase_lag_error < 0.02
