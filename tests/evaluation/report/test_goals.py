"""Whether goals are met, against results made by hand."""

import math

import pytest

from loco_drake.evaluation.report.content import CONTENT
from loco_drake.evaluation.report.goals import (
    BEST,
    MET,
    MISSED,
    UNKNOWN,
    counts,
    scoreboard,
)
from loco_drake.evaluation.report.results import load_results
from loco_drake.evaluation.report.tables import figure_cell
from tests.report_results import (
    learning,
    retargeting,
    steering,
    tokenizer,
    tracking,
    write_results,
)

GOALS = sum(map(len, CONTENT.goals.values()))


def score(folder, title, robot="go2"):
    """Text, note and verdict of the first goal whose title begins so."""
    parts = scoreboard(load_results(folder)).values()
    lines = [line for part in parts for line in part]
    line = next(line for line in lines if line.goal.title.startswith(title))
    place = ("go2", "a1").index(robot)
    cell = figure_cell(line.measured[place], line.goal.digits)
    return cell.text, cell.note, line.verdicts[place]


@pytest.mark.parametrize(
    ("slip", "moved", "verdict"),
    [
        (0.0099, 0.0299, BEST),
        (0.0101, 0.0299, MET),
        (0.0301, 0.0001, MISSED),
        (0.0001, 0.0301, MISSED),
    ],
)
def test_slip_is_not_bought_with_corrections(tmp_path, slip, moved, verdict):
    figures = retargeting(stance_slip_median_mps=slip, correction_rmse_m=moved)
    write_results(tmp_path, retargeting={"robots": {"go2": figures}})
    text, note, found = score(tmp_path, "slip of feet")
    assert (text, found) == (f"{slip:.4f}", verdict)
    assert f"{1000 * moved:.1f} mm" in note


@pytest.mark.parametrize(
    ("title", "text", "verdict"),
    [
        ("normalized return, mean", "77.0", MISSED),
        ("normalized return, worst", "60.0", MISSED),
        ("episodes that end", "1.5", MET),
        ("joint error of the robot", f"{math.degrees(0.03):.1f}", MET),
        ("position error", "4.4", MISSED),
        ("orientation error", f"{math.degrees(0.05):.1f}", MISSED),
        ("stretch", "1.021", MET),
        ("whole diagram", "6.5", MET),
    ],
)
def test_tracking_in_the_units_of_the_goals(tmp_path, title, text, verdict):
    write_results(tmp_path, tracking_go2_generated=tracking())
    assert score(tmp_path, title)[::2] == (text, verdict)


def test_a_share_is_of_the_return_as_trained(tmp_path):
    """70.84 of 77; of the gaits' 60 and 94 are kept 57 and 84.6."""
    write_results(tmp_path, tracking_go2_lagged=tracking())
    title = "lagged, 1 ms, share of"
    assert score(tmp_path, title)[::2] == ("–", UNKNOWN)
    lagged = tracking(normalized_return=70.84)
    for part, value in zip(lagged["labels"].values(), (57.0, 84.6), strict=True):
        part["normalized_return"] = value
    write_results(
        tmp_path, tracking_go2_generated=tracking(), tracking_go2_lagged=lagged
    )
    assert score(tmp_path, title) == ("92", "", MISSED)
    last = list(lagged["labels"])[-1]
    assert score(tmp_path, "lagged, 1 ms, share that") == ("90", last, MET)


def test_scores_come_with_their_price(tmp_path):
    write_results(tmp_path, tracking_go2_generated=tracking())
    assert score(tmp_path, "normalized return, mean")[1] == "at stretch 1.021"
    assert score(tmp_path, "normalized return, worst")[1] == "dog-trot"


@pytest.mark.parametrize(
    ("title", "text", "note", "verdict"),
    [
        ("velocity off the command, all", "0.082", "at stretch 1.010", MISSED),
        ("velocity off the command, worst", "0.100", "mpc-trot", MET),
        ("yaw rate off", "0.050", "", BEST),
        ("forward in trot, slowest", "-0.50", "", MET),
        ("forward in trot, fastest", "2.00", "", MET),
        ("sideways in trot", "0.30", "", MET),
        ("turning in trot", "0.90", "", MISSED),
        ("from a command to the first", "0.26", "", MET),
        ("from a command to 90", "0.90", "", MET),
        ("drives that end", "3.0", "", MISSED),
        ("farthest from the plan in a drive", "0.31", "mpc-trot", MET),
    ],
)
def test_steering_in_the_units_of_the_goals(tmp_path, title, text, note, verdict):
    write_results(tmp_path, steering_go2=steering())
    assert score(tmp_path, title) == (text, note, verdict)
    assert score(tmp_path, title, "a1")[2] == UNKNOWN


def test_a_small_error_does_not_count_if_the_plan_was_slowed_down(tmp_path):
    for stretch, verdict in ((1.05, BEST), (1.06, MISSED)):
        figures = steering(velocity_rmse_mps=0.03, stretch=stretch)
        write_results(tmp_path, steering_go2=figures)
        assert score(tmp_path, "velocity off the command, all")[2] == verdict


def test_a_gait_that_was_not_evaluated_is_not_measured(tmp_path):
    figures = steering()
    del figures["labels"]["mpc-trot"]
    write_results(tmp_path, steering_go2=figures)
    assert score(tmp_path, "turning in trot")[::2] == ("–", UNKNOWN)
    assert score(tmp_path, "velocity off the command, worst")[0] == "0.060"


def test_steps_that_no_gait_covers_are_not_measured(tmp_path):
    write_results(tmp_path, steering_go2=steering(latency_robot_s=None))
    assert score(tmp_path, "from a command to 90")[::2] == ("–", UNKNOWN)


@pytest.mark.parametrize(
    ("result", "verdict"), [(89.9, MISSED), (90.1, BEST), (None, MISSED)]
)
def test_steps_count_only_for_the_return_that_they_are_for(tmp_path, result, verdict):
    write_results(tmp_path, learning_go2=learning())
    if result is not None:
        figures = tracking(normalized_return=result)
        write_results(tmp_path, tracking_go2_generated=figures)
    text, _, found = score(tmp_path, "steps of training")
    assert (text, found) == ("4.5", verdict)
    assert score(tmp_path, "time of training")[::2] == ("2.0", MET)


def test_what_was_not_measured_is_neither_met_nor_missed(tmp_path):
    robots = {"go2": tokenizer(), "a1": tokenizer(joint_rmse_rad=None)}
    write_results(tmp_path, tokenizer={"robots": robots})
    assert score(tmp_path, "joint error, rec")[::2] == ("0.0271", MET)
    assert score(tmp_path, "toe error")[::2] == ("16.3", MISSED)
    assert score(tmp_path, "joint error, rec", "a1")[::2] == ("–", UNKNOWN)
    counted = counts(scoreboard(load_results(tmp_path)))
    assert counted["go2"] == {"met": 2, "measured": 3, "goals": GOALS}
    assert counted["a1"] == {"met": 1, "measured": 2, "goals": GOALS}
