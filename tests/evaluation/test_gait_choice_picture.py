import numpy as np

from loco_drake.control.command import CommandRange
from loco_drake.control.gait_choice import MeasuredGait
from loco_drake.evaluation.gait_choice_picture import choice_figure, choice_map, sweep
from loco_drake.evaluation.steering_courses import grid

WALK, TROT = 3, 1


def gait(low, high, score):
    within = CommandRange((low, -0.1, -0.5), (high, 0.1, 0.5))
    commands = np.array(grid(within))
    return MeasuredGait(within, commands, np.full(len(commands), score))


GAITS = {WALK: gait(-0.5, 1.0, 1.0), TROT: gait(0.0, 2.0, 2.0)}


def test_the_bars_show_hysteresis_and_the_map_has_none():
    """The walk is the better one; it is left .1 m/s beyond the end of its range."""
    speeds = np.round(np.arange(-0.5, 2.01, 0.05), 6)
    up, down = sweep(GAITS, speeds), sweep(GAITS, speeds[::-1])[::-1]
    assert speeds[up == WALK].max() == 1.1
    assert speeds[down == WALK].max() == 1.0
    assert set(up) == set(down) == {WALK, TROT}
    ahead = choice_map(GAITS)[0]
    # From -1 to 1 m/s in steps of .05.
    np.testing.assert_array_equal(ahead, [WALK] * 41 + [TROT] * (len(ahead) - 41))


def test_the_picture_has_a_map_of_each_robot_and_names_what_is_chosen():
    figure = choice_figure({"go2": GAITS, "a1": {TROT: GAITS[TROT]}})
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles == ["go2", "", "a1", ""]
    (legend,) = figure.legends
    assert [t.get_text() for t in legend.get_texts()] == ["dog-trot", "horse-walk"]
