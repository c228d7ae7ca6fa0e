import pytest

from loco_drake.cli.evaluate_steering import EvaluateSteering
from loco_drake.common.errors import InputError
from loco_drake.control.command import CommandRange
from loco_drake.evaluation.naturalness import WAYS
from loco_drake.evaluation.steering_courses import Course
from loco_drake.evaluation.steering_ways import compare_ways
from loco_drake.systems.scenario import GeneratedReference, Scenario, SteeringConfig


@pytest.mark.slow
def test_a_generator_that_is_told_a_turn_leaves_less_of_it_to_bend():
    """The Go2's pace at .6 m/s and .6 rad/s: one point, since the range is one."""
    turn = CommandRange((0.6, 0.0, 0.6), (0.6, 0.0, 0.6))
    scenario = Scenario(
        reference=GeneratedReference(gait="dog-pace", duration=60.0),
        steering=SteeringConfig(measured_ranges=False),
    )
    ((label, figures),) = compare_ways(scenario, [Course("dog-pace", [0], turn)])
    assert (label, figures["points"]) == ("dog-pace", 1)
    assert set(figures) == {"range", "points", *WAYS}
    for way in WAYS:
        assert figures[way]["fall_rate"] == 0
        assert figures[way]["normalized_return"] > 70
        assert figures[way]["plan_slip_median_mps"] < 0.03
    bending, telling, both = (figures[way] for way in ("bending", "telling", "both"))
    assert telling["bend_radps"] == telling["bend_mps"] == 0
    assert both["bend_radps"] < 0.5 * bending["bend_radps"]
    for way in (bending, both):
        assert way["plan_yaw_rate_rmse_radps"] < 0.1
        assert way["yaw_rate_rmse_radps"] < 0.2
    assert telling["plan_yaw_rate_rmse_radps"] < 0.35


def test_ways_are_compared_in_published_ranges_only():
    command = EvaluateSteering(labels=("dog-pace",), search=True, compare=True)
    with pytest.raises(InputError, match="no published range of dog-pace"):
        command.run()
