"""``report.yaml``: its figures exist, bounds say what texts say, Table 1 is printed."""

import re

import pytest
from pydrake.common.yaml import yaml_load_typed

from loco_drake.common.errors import InputError
from loco_drake.evaluation.report.content import CONTENT, Content
from loco_drake.evaluation.report.goals import measure
from loco_drake.evaluation.report.results import load_results, results_dir
from loco_drake.models.robots import ROBOTS

PRINTED = {
    "all": (0.933, 0.736, 0.833),
    "dog": (0.889, 0.611, 1.000),
    "horse": (1.000, 0.708, 0.778),
    "mpc": (0.867, 0.833, 0.933),
    "solo8": (0.963, 0.743, 0.741),
}
COMPARISONS = ("real_to_real", "real_to_generated", "generated_to_real")


GOALS = {
    f"{part}: {goal.title}": goal for part, own in CONTENT.goals.items() for goal in own
}


@pytest.fixture(scope="module")
def shipped():
    return load_results(results_dir())


@pytest.mark.parametrize("name", GOALS)
def test_every_figure_of_a_goal_is_in_the_shipped_results(name, shipped):
    """Not only there but measured, for both robots, and so is its price."""
    for robot in ROBOTS:
        measured = measure(GOALS[name], shipped, robot)
        assert measured is not None
        assert not any("not measured" in note for note in measured.notes)


@pytest.mark.parametrize(
    ("file", "path"),
    [
        ("tokenizer", "all.joint_rmse"),
        ("tokenizer", "every.joint_rmse_rad"),
        ("tracking-generated", "labels.*.return"),
        ("learning", "learning.hours[-1]"),
    ],
)
def test_a_path_that_leads_nowhere_is_an_error(file, path, shipped):
    text = f"{{goals: {{A: [{{figure: {{file: {file}, path: '{path}'}}}}]}}}}"
    (goal,) = yaml_load_typed(schema=Content, data=text).goals["A"]
    with pytest.raises(InputError, match="is damaged: "):
        measure(goal, shipped, "go2")


def test_an_entry_that_is_misspelt_is_an_error():
    with pytest.raises(RuntimeError, match="'leest'"):
        yaml_load_typed(schema=Content, data="{goals: {A: [{aim: {leest: 1}}]}}")


@pytest.mark.parametrize("name", GOALS)
def test_texts_of_a_goal_have_the_numbers_of_its_bounds(name):
    """And a dream lies within the aim."""
    goal = GOALS[name]
    for bound in filter(None, (goal.aim, goal.dream)):
        numbers = {float(text) for text in re.findall(r"-?\d*\.?\d+", str(bound))}
        bounds = {x for x in (bound.least, bound.most) if abs(x) < float("inf")}
        assert bounds
        assert bounds <= numbers
        assert all(x in goal.aim for x in bounds)


@pytest.mark.parametrize("source", CONTENT.sources)
def test_shares_are_as_printed_and_inside_their_intervals(source):
    for comparison, printed in zip(COMPARISONS, PRINTED[source], strict=True):
        entry = CONTENT.published(source, comparison)
        assert entry.mean == pytest.approx(printed, abs=0.0005)
        assert entry.low < entry.mean <= entry.high


def test_wilson_s_interval_of_50_of_60():
    """By hand: z = 1.96, n = 60, p = 5/6."""
    entry = CONTENT.published("all", "generated_to_real")
    z, n, p = 1.96, 60, 5 / 6
    middle = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z * (p * (1 - p) / n + z**2 / (4 * n**2)) ** 0.5 / (1 + z**2 / n)
    assert entry.low == pytest.approx(middle - half, abs=1e-4)
    assert entry.high == pytest.approx(middle + half, abs=1e-4)
