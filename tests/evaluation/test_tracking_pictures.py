import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.evaluation.report.figures import Figures
from loco_drake.evaluation.tracking import Rollout
from loco_drake.evaluation.tracking_pictures import learning_figure, traces_figure


def curves(steps, **returns):
    learned = {
        "steps": steps,
        "return": {k.replace("_", "-"): v for k, v in returns.items()},
    }
    return {"go2": Figures({"learning": learned})}


def lines(figure):
    """Thin lines by their values, and bold ones by their source."""
    drawn = [line for line in figure.axes[0].lines if line.get_linestyle() == "-"]
    bold = {line.get_label(): line for line in drawn if line.get_linewidth() > 2}
    return [line for line in drawn if line not in bold.values()], bold


def test_a_curve_does_not_bridge_steps_without_a_record():
    """Ten points a hundred thousand steps apart, two million steps between two."""
    steps = [100_000 * k for k in range(1, 6)] + [
        2_500_000 + 100_000 * k for k in range(5)
    ]
    figure, ends = learning_figure(curves(steps, dog_trot=list(range(10))))
    (thin,), bold = lines(figure)
    for line in (thin, bold["dog"]):
        x, y = line.get_data()
        assert np.flatnonzero(np.isnan(y)).tolist() == [5]
        assert np.isnan(x[5])
        assert (x[4], x[6]) == (0.5, 2.5)
    assert ends == ["go2 dog 9"]


def test_a_mean_does_not_bridge_a_gait_that_joins():
    steps = [1000 * k for k in range(1, 7)]
    returns = {"dog_trot": [80.0] * 6, "dog_pace": [None] * 3 + [10.0] * 3}
    thin, bold = lines(learning_figure(curves(steps, **returns))[0])
    assert [np.isnan(line.get_ydata()).sum() for line in thin] == [0, 3]
    y = bold["dog"].get_ydata()
    assert np.flatnonzero(np.isnan(y)).tolist() == [3]
    assert (y[2], y[4]) == (80.0, 45.0)


def test_curves_of_what_is_no_gait_are_refused():
    with pytest.raises(InputError, match=r"learning.return.cat-sneak is no curve"):
        learning_figure(curves([1, 2], cat_sneak=[1.0, 2.0]))


def test_plan_and_robot_are_drawn_over_the_last_two_seconds():
    """The robot is 5 cm higher than its plan, and .1 m/s faster."""
    count = 201
    plan = np.zeros((count, 37))
    plan[:, 0], plan[:, 6], plan[:, 22] = 1.0, 0.3, 0.5
    robot = plan + np.eye(37)[6] * 0.05 + np.eye(37)[22] * 0.1
    zero = np.zeros(count)
    rollout = Rollout(robot, plan, zero, np.zeros((count, 12)), zero, count - 1, False)
    figure = traces_figure({"go2": rollout, "a1": rollout})
    assert len(figure.axes) == 8
    for column in (0, 1):
        for cell, own, planned in ((0, 0.6, 0.5), (2, 0.35, 0.3)):
            made, wanted = figure.axes[cell + column].lines[:2]
            assert made.get_xdata()[[0, -1]] == pytest.approx([2.0, 4.0])
            np.testing.assert_allclose(made.get_ydata(), own)
            np.testing.assert_allclose(wanted.get_ydata(), planned)
