from dataclasses import replace

import numpy as np
import pytest

from loco_drake.evaluation.drift import RESOLUTION, beyond_recorded, drift, worst
from loco_drake.models.robots import get_robot
from loco_drake.motion.motion import Motion, make_motion
from tests.synthetic_motion import synthetic_motion

GO2 = get_robot("go2")
SPEEDS = (0.70, 0.75, 0.8, 0.85)


def then(first: Motion, second: Motion) -> Motion:
    """One motion after the other; the base goes on from where it was."""
    step = first.base_position[-1] * [1, 1, 0]
    joined = {
        name: np.concatenate((getattr(first, name), getattr(second, name)))
        for name in ("base_quaternion", "joint_positions", "contacts")
    }
    position = np.concatenate((first.base_position, second.base_position + step))
    return make_motion(
        robot=first.robot,
        label=first.label,
        joint_names=first.joint_names,
        base_position=position,
        provenance={},
        **joined,
    )


def halves(change):
    """Motions of 24 s whose second half is made with other arguments."""
    return [
        then(
            synthetic_motion(seconds=12.0, speed=speed),
            synthetic_motion(seconds=12.0, **{"speed": speed, **change(speed)}),
        )
        for speed in SPEEDS
    ]


def test_steady_motion_does_not_drift():
    figures = drift(GO2, halves(lambda speed: {}))
    assert set(figures) == set(RESOLUTION)
    assert max(f["drift"] for f in figures.values()) < 0.2
    assert figures["speed_mps"]["first"] == pytest.approx(np.mean(SPEEDS), abs=0.01)
    assert figures["stride_period_s"]["first"] == pytest.approx(0.5, abs=0.005)


def test_tolerance_by_hand():
    """Differences .05 (3 times), .10 (2), .15: 95 % are within .1375 by interpolation.

    All slow down by .2 m/s: 1.45 times that.
    """
    figures = drift(GO2, halves(lambda speed: {"speed": speed - 0.2}))
    assert figures["speed_mps"]["tolerance"] == pytest.approx(0.1375, abs=0.003)
    assert figures["speed_mps"]["change"] == pytest.approx(0.2, abs=0.005)
    assert figures["speed_mps"]["drift"] == pytest.approx(0.2 / 0.1375, rel=0.04)


def test_sinking_and_other_rhythm_and_slipping_are_drift():
    slower = drift(GO2, halves(lambda speed: {"period": 0.55}))
    assert slower["stride_period_s"]["drift"] > 1
    motions = halves(lambda speed: {})
    late = np.arange(len(motions[0])) > len(motions[0]) // 2
    lower = [
        replace(m, base_position=m.base_position - 0.01 * late[:, None] * [0, 0, 1])
        for m in motions
    ]
    figures = drift(GO2, lower)
    assert figures["height_m"]["drift"] > 5
    assert figures["speed_mps"]["drift"] < 0.2
    way = 0.3 * np.cumsum(late) / 50
    skating = [
        replace(m, base_position=m.base_position + way[:, None] * [0, 1, 0])
        for m in motions
    ]
    assert drift(GO2, skating)["stance_slip_median_mps"]["drift"] > 5


def test_turning_late_is_drift():
    """By .2 rad/s, ten times the least that matters; a steady turn is none."""
    figures = drift(GO2, halves(lambda speed: {"turn": 0.2}))
    assert figures["turn_rate_radps"]["last"] == pytest.approx(0.2, abs=0.01)
    assert figures["turn_rate_radps"]["drift"] == pytest.approx(10.0, rel=0.05)
    steady = [synthetic_motion(seconds=24.0, speed=v, turn=0.2) for v in SPEEDS]
    assert drift(GO2, steady)["turn_rate_radps"]["drift"] < 0.1


def test_turning_and_sinking_beyond_recordings_by_hand():
    """The last 10 s turn by .4 rad in 2 s, recordings by .1; .198 over 99 steps.

    The trunk sinks by 1 cm, and recordings are two heights of which 4 mm lie between.
    """
    recorded = [synthetic_motion(seconds=3.0, turn=0.05) for _ in range(2)]
    recorded[1] = replace(
        recorded[1], base_position=recorded[1].base_position - [0, 0, 0.004]
    )
    motions = halves(lambda speed: {"turn": 0.2})
    late = np.arange(len(motions[0])) > len(motions[0]) // 2
    lower = [
        replace(m, base_position=m.base_position - 0.01 * late[:, None] * [0, 0, 1])
        for m in motions
    ]
    found = beyond_recorded(lower, recorded)
    assert found["recorded_turn_2s_rad"] == pytest.approx(0.05 * 99 / 50, rel=1e-3)
    assert found["turn_2s_rad"] == pytest.approx(0.2 * 99 / 50, rel=1e-3)
    assert found["turn_over_recorded"] == pytest.approx(4.0, rel=1e-3)
    assert found["height_over_recorded"] == pytest.approx(2.5, rel=0.02)
    assert max(
        beyond_recorded([synthetic_motion(seconds=24.0, turn=0.05)], recorded).values()
    ) == pytest.approx(1.0, rel=1e-3)


def test_recordings_that_hardly_turn_allow_what_does_not_matter():
    """A turn of .01 rad/s against none: .01 / .02 of the least that matters."""
    found = beyond_recorded(
        [synthetic_motion(seconds=24.0, turn=0.01)], [synthetic_motion(seconds=3.0)]
    )
    assert found["recorded_turn_2s_rad"] == pytest.approx(0.0, abs=1e-9)
    assert found["turn_over_recorded"] == pytest.approx(0.5, rel=1e-3)


def test_a_lost_rhythm_is_drift():
    """The robot stops and stands; its speed tells as well."""
    motions = []
    for moving in halves(lambda speed: {}):
        still = np.minimum(np.arange(len(moving)), len(moving) // 2)
        motions.append(
            replace(
                moving,
                base_position=moving.base_position[still],
                base_quaternion=moving.base_quaternion[still],
                joint_positions=moving.joint_positions[still],
            )
        )
    figures = drift(GO2, motions)["stride_period_s"]
    assert figures["lost"] == 1.0
    assert figures["last"] is None
    assert figures["drift"] > 10


def test_the_worst_of_all():
    drifts = {
        "dog-trot": {"speed_mps": {"drift": 0.2}, "height_m": {"drift": 0.9}},
        "dog-pace": {"speed_mps": {"drift": 0.4}},
    }
    assert worst(drifts) == {"drift": 0.9, "label": "dog-trot", "figure": "height_m"}
    assert worst({}) is None
