"""The paper's Table 1, to the three digits that it prints."""

import pytest

from loco_drake.evaluation.report.published import SOURCES, table_1

PRINTED = {
    "all": (0.933, 0.736, 0.833),
    "dog": (0.889, 0.611, 1.000),
    "horse": (1.000, 0.708, 0.778),
    "mpc": (0.867, 0.833, 0.933),
    "solo8": (0.963, 0.743, 0.741),
}
COMPARISONS = ("real_to_real", "real_to_generated", "generated_to_real")


@pytest.mark.parametrize("source", SOURCES)
def test_shares_are_as_printed_and_inside_their_intervals(source):
    for comparison, printed in zip(COMPARISONS, PRINTED[source], strict=True):
        entry = table_1(source, comparison)
        assert entry.mean == pytest.approx(printed, abs=0.0005)
        assert entry.low < entry.mean <= entry.high


def test_wilson_s_interval_of_50_of_60():
    """By hand: z = 1.96, n = 60, p = 5/6."""
    entry = table_1("all", "generated_to_real")
    z, n, p = 1.96, 60, 5 / 6
    middle = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z * (p * (1 - p) / n + z**2 / (4 * n**2)) ** 0.5 / (1 + z**2 / n)
    assert entry.low == pytest.approx(middle - half, abs=1e-4)
    assert entry.high == pytest.approx(middle + half, abs=1e-4)
