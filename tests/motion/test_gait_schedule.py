import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.motion.gaits import LABELS, GaitSchedule, parse_label, parse_schedule

PACE, TROT, GALLOP = (parse_label(f"dog-{g}") for g in ("pace", "trot", "gallop"))


def test_one_label_holds_all_the_time():
    schedule = parse_schedule("dog-trot")
    assert schedule == GaitSchedule((TROT,))
    assert str(schedule) == "dog-trot"
    assert schedule.at([0.0, 1e6]).tolist() == [TROT.index] * 2


def test_later_gaits_begin_at_their_times():
    schedule = parse_schedule("dog-pace,dog-trot@3,dog-gallop@6.5")
    assert schedule.labels == (PACE, TROT, GALLOP)
    assert schedule.starts == (0.0, 3.0, 6.5)
    assert parse_schedule(str(schedule)) == schedule
    times = np.array([0.0, 2.999, 3.0, 6.4, 6.5, 60.0])
    names = [str(LABELS[i]) for i in schedule.at(times)]
    assert names == ["dog-pace"] * 2 + ["dog-trot"] * 2 + ["dog-gallop"] * 2
    schedule.check_ends_by(6.6)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "Unknown gait ''; the choices are dog-pace"),
        ("dog-waltz", "Unknown gait 'dog-waltz'; the choices are dog-pace"),
        ("dog-trot@3", "Unknown gait 'dog-trot@3'"),
        ("dog-pace,dog-waltz@2", "Unknown gait 'dog-waltz'; the choices are dog-pace"),
        ("dog-pace,dog-trot", "such as .*dog-trot@3.*'dog-trot' lacks"),
        ("dog-pace,dog-trot@soon", "'dog-trot@soon' lacks"),
        ("dog-pace,dog-trot@nan", "'dog-trot@nan' lacks"),
        ("dog-pace,dog-trot@inf", "'dog-trot@inf' lacks"),
        ("dog-pace,dog-trot@0", "rising times above 0 s, .*not at 0 s after 0 s"),
        ("dog-pace,dog-trot@-1", "rising times"),
        ("dog-pace,dog-trot@5,dog-pace@4", "not at 4 s after 5 s"),
        ("dog-pace,dog-trot@5,dog-pace@5", "not at 5 s after 5 s"),
    ],
)
def test_what_is_no_schedule_is_refused_by_name(text, message):
    with pytest.raises(InputError, match=message):
        parse_schedule(text)


def test_changes_after_the_end_are_refused():
    with pytest.raises(InputError, match=r"dog-trot starts at 9 s.* at 9 s"):
        parse_schedule("dog-pace,dog-trot@9").check_ends_by(9.0)
