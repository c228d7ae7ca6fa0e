from pathlib import Path

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.segments import Segment, read_segments
from loco_drake.evaluation.tracking_table import (
    Episode,
    Trial,
    figures,
    generated_trials,
    retargeted_trials,
    run_trials,
    summarize,
)
from loco_drake.systems.scenario import GeneratedReference, PlanReference, Scenario
from loco_drake.tracking.randomization import RandomizationConfig


def episode(label="dog-trot", score=80.0, error=0.01, samples=101, slip=(), **changes):
    """An episode whose errors, in rad and m, are all alike."""
    return Episode(
        trial=Trial(label, 0, 2.0),
        figures={
            "normalized_return": score,
            "joint_rmse_rad": error,
            "base_position_rmse_m": error,
            "base_orientation_rmse_rad": error,
            "stretch": 1.0,
            "speed_mps": 0.5,
            "torque_saturation": 0.0,
            "speed_saturation": 0.0,
            "cost_of_transport": 1.0,
        },
        slip=np.array(slip),
        samples=samples,
        **{"fell": False, "wall": 0.5, **changes},
    )


def test_aggregation_by_hand():
    """Errors .03 in 100 samples and .01 in 300: the root of (9 + 3) / 4 is .01 3^.5."""
    got = figures(
        [
            episode(score=60.0, error=0.03, samples=100, slip=(0.1, 0.9), fell=True),
            episode(score=90.0, error=0.01, samples=300, slip=(0.2,)),
        ]
    )
    assert got["normalized_return"] == 75.0
    assert got["normalized_return_worst"] == 60.0
    assert got["fall_rate"] == 0.5
    assert got["joint_rmse_rad"] == pytest.approx(0.01 * np.sqrt(3))
    assert got["stance_slip_median_mps"] == 0.2
    assert "reason" not in got


def test_without_stance_there_is_a_reason():
    got = figures([episode()])
    assert got["stance_slip_median_mps"] is None
    assert got["reason"] == "no toe ever stands"


def test_a_trials_world_is_that_of_its_label_and_seed():
    """Whatever was simulated before; .5 s of a push make joints err more than none."""
    first, second = generated_trials(["dog-pace"], [3, 4], 0.5)
    scenario = Scenario(reference=GeneratedReference(gait="dog-pace"))

    def errors(trials, randomization):
        episodes = run_trials(scenario, trials, randomization=randomization)
        return [episode.figures["joint_rmse_rad"] for episode in episodes]

    drawn = errors(
        [first, second, first],
        RandomizationConfig(push=(1, 1), push_interval=(0.2, 0.2), friction=(0.5, 1)),
    )
    assert drawn[0] == drawn[2]
    plain = errors([first, second], None)
    assert all(a > b for a, b in zip(drawn, plain, strict=False))


def test_labels_and_all_of_them():
    """101 samples are 2 s; two episodes in 1 s of wall time: 4 times real time."""
    got = summarize([episode("dog-trot", 80.0), episode("dog-pace", 90.0)])
    assert list(got["labels"]) == ["dog-trot", "dog-pace"]
    assert got["labels"]["dog-pace"]["normalized_return"] == 90.0
    assert got["all"]["normalized_return"] == 85.0
    assert got["real_time_factor"] == pytest.approx(4.0)


def test_trials_of_recordings_are_spread_over_all_of_a_label():
    segments = [Segment("dog", Path(f"{k}.txt"), "trot", 0, 99, 60.0) for k in range(9)]
    segments.insert(3, Segment("dog", Path("other.txt"), "pace", 0, 99, 60.0))
    chosen = retargeted_trials(segments, ["dog-trot"], 3, 10.0)
    assert [trial.segment.path.stem for trial in chosen] == ["0", "4", "8"]
    assert len(retargeted_trials(segments, ["dog-trot"], 50, 10.0)) == 9
    with pytest.raises(InputError, match="'mpc-trot'; the choices are"):
        retargeted_trials(segments, ["mpc-trot"], 3, 10.0)


def test_a_trial_is_the_same_whatever_ran_before():
    """Seed 1 alone, and after seed 0, to the last bit."""
    scenario = Scenario(reference=GeneratedReference())
    trials = generated_trials(["dog-trot"], [0, 1], 0.6)
    both = list(run_trials(scenario, trials))
    (alone,) = run_trials(scenario, trials[1:])
    assert alone.figures == both[1].figures
    assert alone.figures != both[0].figures
    assert both[0].samples == 31


def test_recordings_are_followed_for_as_long_as_they_are(made_data):
    """The made trot lasts 4 s, and a second of it is asked for."""
    segments = read_segments(made_data)
    scenario = Scenario(reference=PlanReference())
    trials = retargeted_trials(segments, ["dog-trot"], 1, 1.0)
    trials += retargeted_trials(segments, ["dog-pace"], 1, 99.0)
    short, whole = run_trials(scenario, trials)
    assert short.samples == 51
    assert whole.fell or whole.samples == pytest.approx(200, abs=2)
    # As fast as the recording scaled to the robot: .32 m over .44 m times 1.8 m/s.
    assert 0.8 < short.figures["speed_mps"] < 1.6


def test_kinds_of_references_are_not_mixed():
    trials = generated_trials(["dog-trot"], [0], 1.0)
    with pytest.raises(ValueError, match="kind of reference"):
        run_trials(Scenario(reference=PlanReference()), trials)
