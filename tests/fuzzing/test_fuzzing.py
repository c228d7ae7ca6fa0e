"""Damaged files of every kind, a few of each: see the package for all."""

import pytest

from tests.fuzzing.kinds import KINDS
from tests.fuzzing.run import Fuzzer

# What takes a training, or seconds of CPU time for each input.
SLOW = {
    "results": 2,
    "tracker": 2,
    "start from": 2,
    "trained on": 5,
    "of a token": 5,
    "scenario": 4,
}


def cases():
    for name in KINDS:
        slow = next((part for part in SLOW if part in name), None)
        marks = pytest.mark.slow if slow else ()
        yield pytest.param(name, SLOW.get(slow, 8), marks=marks, id=name)


@pytest.fixture(scope="module")
def fuzzer(tmp_path_factory):
    with Fuzzer(tmp_path_factory.mktemp("kept")) as made:
        yield made


@pytest.mark.parametrize(("name", "count"), list(cases()))
def test_damaged_file_is_refused_or_changes_nothing(fuzzer, name, count):
    """No traceback, no silent change, nothing half-written, for a few of the kind."""
    kind = KINDS[name]
    for k, damage in enumerate(fuzzer.inputs(kind, count, seed=1)):
        verdict, why = fuzzer.attempt(kind, damage, str(k))
        assert verdict != "BAD", f"{damage.what}: {why}"
