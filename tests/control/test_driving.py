import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.control.driving import (
    COMMAND,
    GAIT,
    PUSH,
    RESET,
    OrderTable,
    check_command,
    order_table,
    read_commands,
)
from loco_drake.control.plan import PLAN_DT

TABLE = """time, forward, sideways, yaw_rate, gait, push, reset
0,0.5,0,0,,,
1,0.5,0.1,-0.5,dog-pace,,
1.03,0,0,0,,4,
1.05,0,0,0,,-1.5,1
"""


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "commands.csv"
        path.write_text(text)
        return path

    return write


def test_a_command_lasts_until_the_next_row_and_a_push_for_one_period(write):
    table = read_commands(write(TABLE), "dog-trot")
    orders = {k: table.at(k * PLAN_DT) for k in range(56)}
    for k in (0, 20, 49):
        np.testing.assert_array_equal(orders[k], [0.5, 0, 0, 1, 0, 0])
    for k in (50, 51):
        np.testing.assert_array_equal(orders[k], [0.5, 0.1, -0.5, 0, 0, 0])
    # That of 1.03 s is in the period from 1.04 s on, that of 1.05 s in the next.
    np.testing.assert_array_equal(orders[52], [0, 0, 0, 0, 4, 0])
    np.testing.assert_array_equal(orders[53], [0, 0, 0, 0, -1.5, 1])
    np.testing.assert_array_equal(orders[54], [0, 0, 0, 0, 0, 0])


def test_a_table_may_ask_for_any_gait(write):
    table = read_commands(write(TABLE.replace("dog-pace", "any")), "dog-trot")
    assert [table.at(time)[GAIT] for time in (0.5, 1.0, 2.0)] == [1, -1, -1]
    assert read_commands(write(TABLE), "any").at(0.5)[GAIT] == -1


def test_pushes_of_one_period_add_up():
    rows = np.zeros((3, 6))
    rows[1:, PUSH] = 2.0, 3.0
    rows[1, RESET] = 1.0
    table = OrderTable(np.array([0.0, 0.103, 0.109]), rows)
    assert table.at(6 * PLAN_DT)[PUSH] == 5.0
    assert table.at(6 * PLAN_DT)[RESET] == 1.0
    assert sum(table.at(k * PLAN_DT)[PUSH] for k in range(20)) == 5.0


def test_every_event_happens_once_at_whichever_time():
    """Also where times in binary are a bit off those of control periods."""
    times = np.concatenate(([0.0], np.arange(1, 400) * 0.07))
    rows = np.zeros((400, 6))
    rows[1:, PUSH] = 1.0
    table = OrderTable(times, rows)
    assert sum(table.at(k * PLAN_DT)[PUSH] for k in range(1500)) == 399


def test_until_the_first_row_the_robot_stays_with_its_gait(write):
    text = "time,yaw_rate,sideways,forward\n2,0.3,0.2,0.1\n"
    table = read_commands(write(text), "horse-walk")
    np.testing.assert_array_equal(table.at(1.9)[COMMAND], 0)
    np.testing.assert_array_equal(table.at(2.0)[COMMAND], [0.1, 0.2, 0.3])
    assert table.at(0.0)[GAIT] == table.at(9.0)[GAIT] == 3


HEAD = "time,forward,sideways,yaw_rate"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "its first line must name the columns time, forward"),
        ("0,1,2,3\n", "its first line must name the columns"),
        (f"{HEAD},speed\n", "its first line must name the columns"),
        (f"{HEAD},time\n", "its first line must name the columns"),
        (f"{HEAD}\n0,1,2\n", "line 2: There are 3 cells for 4 names"),
        (f"{HEAD}\n0,1,2,x\n", "line 2: The yaw_rate must be a finite number, not 'x'"),
        (f"{HEAD}\n0,1_0,0,0\n", "line 2: The forward must be a finite number"),
        (f"{HEAD}\n0,nan,0,0\n", "line 2: The forward must be a finite number"),
        (f"{HEAD}\n0,0,inf,0\n", "line 2: The sideways must be a finite number"),
        (f"{HEAD}\n0,0,0,0\n1,9,0,0\n", "line 3: A command's forward .* -4 to 4"),
        (f"{HEAD}\n-1,0,0,0\n", "line 2: The time of a command .* at least 0"),
        (f"{HEAD}\n2,0,0,0\n1,0,0,0\n", "line 3: .* must rise, and 1 s comes after 2"),
        (f"{HEAD}\n2,0,0,0\n2,0,0,0\n", "line 3: .* must rise"),
        (f"{HEAD}\n0,0,0,{'9' * 200_000}\n", "is no table of commands: field larger"),
        (f"{HEAD}\n\n,,,\n", "is no table of commands: it lists none"),
        (
            f"{HEAD},gait\n0,0,0,0,fly\n",
            "Unknown gait 'fly'; the choices are any, dog-pace",
        ),
        (f"{HEAD},push\n0,0,0,0,1e9\n", "line 2: A push must be a number from -100"),
        (f"{HEAD},reset\n0,0,0,0,2\n", "line 2: A reset must be 0 or 1"),
    ],
)
def test_a_table_that_is_amiss_is_refused_with_its_line(write, text, message):
    with pytest.raises(InputError, match=message):
        read_commands(write(text), "dog-trot")


def test_a_file_that_is_no_text_is_refused(tmp_path):
    with pytest.raises(InputError, match="There is no file"):
        read_commands(tmp_path / "none.csv", "dog-trot")
    (tmp_path / "a.csv").write_bytes(b"\xff\x00\x80")
    with pytest.raises(InputError, match="not plain text"):
        read_commands(tmp_path / "a.csv", "dog-trot")


@pytest.mark.parametrize("value", [np.nan, np.inf, -2.5])
def test_a_command_beyond_sense_is_refused(value):
    with pytest.raises(InputError, match="A command's sideways must be a number from"):
        check_command([0.0, value, 0.0])


def test_a_table_needs_rows_and_rising_times():
    with pytest.raises(InputError, match="1 to 1000000 rows, not 0"):
        order_table([], [])
