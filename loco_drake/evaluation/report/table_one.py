"""Table 1 of the paper, theirs beside ours."""

from collections.abc import Callable

from loco_drake.evaluation.report.goal import Measured
from loco_drake.evaluation.report.measures import read_estimate
from loco_drake.evaluation.report.published import (
    COMPARISONS,
    LINEAR,
    SOURCES,
    table_1,
)
from loco_drake.evaluation.report.results import Figures
from loco_drake.evaluation.report.tables import NOT_MEASURED, NOTHING, Cell, Row, Table
from loco_drake.evaluation.report.words import robot_title

_MATCHED = "generated_to_real_matched"


def estimate_cell(found: Measured | None, reason: str = "") -> Cell:
    """Returns an estimate with its 95 % interval below it."""
    if found is None:
        return Cell(NOTHING, reason=reason)
    if found.low is None or found.high is None:
        return Cell(f"{found.value:.3f}")
    return Cell(f"{found.value:.3f}", note=f"{found.low:.3f}–{found.high:.3f}")


def transformer_table(generation: dict[str, Figures]) -> Table:
    """Returns the paper's table, a row for each source.

    Args:
        generation: figures of each robot.
    """

    def theirs(source: str, comparison: str) -> Cell:
        entry = table_1(source, comparison)
        return estimate_cell(Measured(entry.mean, entry.low, entry.high))

    title = "Transformer, share of trajectories recognized"
    return _table(title, "transformer", generation, "paper", theirs)


def linear_table(generation: dict[str, Figures]) -> Table:
    """Returns the same by a linear classifier, with the paper's clips beside ours."""

    def theirs(source: str, comparison: str) -> Cell:
        known = source == "all"
        return Cell(f"{LINEAR[comparison]:.3f}" if known else NOT_MEASURED)

    title = "Linear classifier on summaries, share of trajectories recognized"
    return _table(title, "linear", generation, "paper's clips", theirs)


def matched_table(generation: dict[str, Figures]) -> Table:
    """Returns the diversity that is left when there are no more samples than real."""
    rows = [
        Row(
            kind,
            tuple(
                _ours(figures, kind, _MATCHED, "all") for figures in generation.values()
            ),
        )
        for kind in ("transformer", "linear")
    ]
    return Table(
        "Diversity, from as many generated trajectories as there are recorded ones",
        "classifier",
        tuple(robot_title(name) for name in generation),
        tuple(rows),
    )


def _table(
    title: str,
    kind: str,
    generation: dict[str, Figures],
    whose: str,
    theirs: Callable[[str, str], Cell],
) -> Table:
    rows = []
    for source, name in SOURCES.items():
        cells: list[Cell] = []
        for comparison in COMPARISONS:
            cells.append(theirs(source, comparison))
            cells += [
                _ours(figures, kind, comparison, source)
                for figures in generation.values()
            ]
        rows.append(Row(name, tuple(cells), total=source == "all"))
    return Table(
        title,
        "source",
        (whose, *map(robot_title, generation)) * len(COMPARISONS),
        tuple(rows),
        groups=tuple(COMPARISONS.values()),
    )


def _ours(figures: Figures, kind: str, comparison: str, source: str) -> Cell:
    part = figures.part("classifiers", kind)
    if comparison == _MATCHED and comparison not in part.values:
        return Cell(NOTHING)
    if part.part(comparison).values.get(source) is None:
        reason = figures.reason("classifiers") or "there is no motion of this source"
        return Cell(NOTHING, reason=reason)
    return estimate_cell(read_estimate(part, comparison, source))
