"""Checks of numbers, whatever is given for one."""

import math

import pytest

from loco_drake.common.errors import InputError, check_number


@pytest.mark.parametrize("value", [0, 0.5, 1, 1.0])
def test_numbers_within_the_bounds_pass(value):
    check_number("The share", value, 0.0, 1.0)


@pytest.mark.parametrize(
    ("value", "given"),
    [
        (-1, "-1"),
        (math.nan, "nan"),
        (math.inf, "inf"),
        (True, "'True'"),
        ("1", "'1'"),
        (None, "'None'"),
        (10**400, "an integer beyond 1e308"),
        (-(10**400), "an integer beyond 1e308"),
        # Python does not write so many digits.
        (10**5000, "an integer beyond 1e308"),
    ],
    ids=lambda value: value if isinstance(value, str) else type(value).__name__,
)
def test_others_are_refused_in_a_sentence(value, given):
    with pytest.raises(
        InputError, match=f"must be a number of at least 0, not {given}"
    ):
        check_number("The duration", value, 0.0)
