"""Damaged files of every kind, a few of each: see the package for all."""

import pytest

from tests.fuzzing.kinds import KINDS
from tests.fuzzing.run import Fuzzer

pytestmark = pytest.mark.slow

# How many inputs, where each takes a training or seconds; 8 of the others.
FEW = {
    "results": 2,
    "tracker": 2,
    "start from": 2,
    "trained on": 5,
    "of a token": 5,
    "scenario": 4,
    "drive": 4,
}


def cases():
    for name in KINDS:
        part = next((part for part in FEW if part in name), None)
        yield pytest.param(name, FEW.get(part, 8), id=name)


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
