"""Figures that the docs print, measured anew with the weights that are shipped."""

import json

import pytest
from threadpoolctl import threadpool_limits

from loco_drake.evaluation.effort import Effort
from loco_drake.evaluation.model_figures import generate_for_scoring
from loco_drake.evaluation.motion_scores import compare, measure
from loco_drake.evaluation.report.results import results_dir
from loco_drake.evaluation.tracking_table import (
    generated_trials,
    run_trials,
    summarize,
)
from loco_drake.generation.motion_model import pretrained_motion_model
from loco_drake.models.robots import ROBOTS
from loco_drake.motion.gaits import parse_label
from loco_drake.systems.scenario import GeneratedReference, Scenario

pytestmark = pytest.mark.slow
LABEL = "horse-walk"


def stored(name):
    return json.loads((results_dir() / f"{name}.json").read_text())


@pytest.mark.parametrize("robot", ROBOTS)
def test_tokenizer_and_generator_write_the_motion_that_was_scored(robot):
    """72 motions of 2 s slip, sink and walk as in generation.json, to 9 digits."""
    figures = stored("generation")["robots"][robot]["labels"][LABEL]
    model = pretrained_motion_model(robot)
    with threadpool_limits(1):
        made = generate_for_scoring(model, [parse_label(LABEL)], Effort(minutes=0), 0)
    motions = [motion for each in made.sets for motion in each]
    assert len(motions) == 72
    found = compare(measure(model.robot, motions), None)
    for name in ("stance_slip_median_mps", "penetration_max_m", "speed_mps"):
        assert found[name] == pytest.approx(figures[name], rel=1e-9, abs=1e-12), name


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_policy_tracks_as_well_as_was_scored(robot):
    """20 episodes of 10 s, within a thousandth of tracking-ROBOT-generated.json."""
    figures = stored(f"tracking-{robot}-generated")["labels"][LABEL]
    scenario = Scenario(robot=robot, reference=GeneratedReference(gait=LABEL))
    trials = generated_trials([LABEL], range(figures["episodes"]), 10.0)
    found = summarize(list(run_trials(scenario, trials)))["labels"][LABEL]
    assert found["fall_rate"] == figures["fall_rate"]
    for name in ("normalized_return", "joint_rmse_rad", "stretch", "speed_mps"):
        assert found[name] == pytest.approx(figures[name], rel=1e-3), name
