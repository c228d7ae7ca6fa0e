"""The map of errors over the grid, against points worked by hand."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from loco_drake.common.errors import InputError
from loco_drake.control.command import CommandRange
from loco_drake.evaluation.report.figures import Figures
from loco_drake.evaluation.steering_courses import grid
from loco_drake.evaluation.steering_grid import COLUMNS, draw_grid, grid_errors

BOX = CommandRange((0.0, -0.2, -1.0), (2.0, 0.2, 1.0))


def points(within, error=(0.03, 0.04, -0.05)):
    """Results of the whole grid, each off by the same error."""
    return [
        {"command": c.tolist(), "velocity": (c + error).tolist(), "fell": False}
        for c in grid(within)
    ]


def figures(within, found, label="dog-trot"):
    return Figures({"labels": {label: {"range": within.figures(), "points": found}}})


def test_every_point_of_the_grid_has_its_column():
    found = grid_errors(figures(BOX, points(BOX)))["dog-trot"]
    assert len(found.velocity) == len(COLUMNS) == 21
    np.testing.assert_allclose(found.velocity, 0.05)
    np.testing.assert_allclose(found.yaw_rate, 0.05)
    assert not found.fell.any()


def test_a_point_lies_where_it_is_in_its_range():
    """By hand: .5 m/s is a quarter of 0 to 2; the other axes are in the middle."""
    one = {"command": [0.5, 0.0, 0.0], "velocity": [0.8, 0.4, 0.2], "fell": True}
    found = grid_errors(figures(BOX, [one]))["dog-trot"]
    (column,) = np.flatnonzero(~np.isnan(found.velocity))
    assert COLUMNS[column].tolist() == [0.25, 0.5, 0.5]
    assert found.velocity[column] == pytest.approx(0.5)  # hypot(.3, .4)
    assert found.yaw_rate[column] == pytest.approx(0.2)
    assert np.flatnonzero(found.fell).tolist() == [column]


def test_an_axis_without_width_has_no_columns_of_its_own_but_corners():
    flat = CommandRange((0.0, 0.1, -1.0), (2.0, 0.1, 1.0))
    found = grid_errors(figures(flat, points(flat)))["dog-trot"]
    missing = np.flatnonzero(np.isnan(found.velocity))
    assert COLUMNS[missing].tolist() == [[0.5, s, 0.5] for s in (0, 0.25, 0.75, 1)]


def test_a_robot_that_fell_before_it_counts_has_no_error():
    one = {"command": [1.0, 0.0, 0.0], "velocity": None, "fell": True}
    found = grid_errors(figures(BOX, [one]))["dog-trot"]
    assert found.fell[0]
    assert np.isnan(found.velocity).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"points": 3}, "points is no list"),
        ({"points": [3]}, "points has an entry that is no object"),
        ({"points": [{"fell": False}]}, "a point has no command"),
        ({"points": [{"command": [1, 2], "fell": False}]}, "command is no list of 3"),
        ({"points": [{"command": [1, 2, 3]}]}, "fell is None, not true or false"),
        ({"points": [{"command": [1, 2, None], "fell": True}]}, "command is no list"),
        ({"range": {"forward_mps": [0, 1]}}, "a range has no ends"),
        ({"range": None}, "it has no range"),
    ],
)
def test_damaged_results_are_refused_in_one_sentence(changes, message):
    values = {"range": BOX.figures(), "points": points(BOX), **changes}
    with pytest.raises(InputError, match=f"is damaged: {message}"):
        grid_errors(Figures({"labels": {"dog-trot": values}}))


def test_the_map_shows_each_error_and_fall_once():
    """By hand: twice 21 points of .05, one of which fell; a row for each label."""
    fallen = points(BOX)
    fallen[0]["fell"] = True
    labels = {
        label: {"range": BOX.figures(), "points": found}
        for label, found in {"solo8-wave": points(BOX), "dog-trot": fallen}.items()
    }
    errors = grid_errors(Figures({"labels": labels}))
    assert list(errors) == ["dog-trot", "solo8-wave"]
    figure = Figure()
    draw_grid(figure, errors)
    for axes in figure.axes[:2]:
        shown = [text.get_text() for text in axes.texts if text.get_size() == 7]
        assert shown.count("fell") == 1
        assert shown.count(".05") == 41
        rows = [text.get_text() for text in axes.get_yticklabels()]
        assert rows == ["dog-trot", "solo8-wave"]
