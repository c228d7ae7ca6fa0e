"""Tables of the report as text, ready for layout."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from loco_drake.evaluation.report.content import CONTENT, Column
from loco_drake.evaluation.report.goals import Measured, read_measured
from loco_drake.evaluation.report.results import Figures
from loco_drake.motion.gaits import LABELS

NOTHING = "–"
NOT_MEASURED = "not measured"  # of what others released
Theirs = Callable[[str, str], "Cell"]  # what is known, of a source and a comparison
_TITLES = {"go2": "Go2", "a1": "A1"}


def robot_title(name: str) -> str:
    """Returns the name of a robot as its maker writes it."""
    return _TITLES.get(name, name)


@dataclass(frozen=True)
class Cell:
    """One entry."""

    text: str  # what is shown
    note: str = ""  # smaller, below it: an interval, a price
    reason: str = ""  # why there is nothing, if so


@dataclass(frozen=True)
class Row:
    """One line: what it is of, and its entries."""

    title: str
    cells: tuple[Cell, ...]
    total: bool = False


@dataclass(frozen=True)
class Table:
    """A table."""

    title: str  # over it
    first: str  # title of the rows' titles
    columns: tuple[str, ...]  # titles, with units
    rows: tuple[Row, ...]  # the entries
    note: str = ""  # below it
    groups: tuple[str, ...] = ()  # titles over as many columns each, if any

    @property
    def reasons(self) -> list[str]:
        """Why entries are missing, each once, with the rows that it is about."""
        rows: dict[str, list[str]] = {}
        for row in self.rows:
            for reason in dict.fromkeys(cell.reason for cell in row.cells):
                if reason:
                    rows.setdefault(reason, []).append(row.title)
        return [f"{', '.join(titles)}: {reason}" for reason, titles in rows.items()]


def number(value: float, digits: int) -> str:
    """Returns a number as text; of what is too small to show, a bound."""
    text = f"{value:.{digits}f}"
    if value and float(text) == 0:
        return f"< {10.0**-digits:.{digits}f}"
    if value == 0:
        return "0"
    return f"{value:,.{digits}f}" if abs(value) >= 1e4 else text


def figure_cell(found: Measured | None, digits: int = 3, reason: str = "") -> Cell:
    """Returns a figure, with its 95 % interval and its price below it."""
    if found is None:
        return Cell(NOTHING, reason=reason)
    notes = list(found.notes)
    if found.low is not None and found.high is not None:
        notes.insert(0, f"{number(found.low, digits)}–{number(found.high, digits)}")
    return Cell(number(found.value, digits), note="; ".join(notes))


def column_cell(column: Column, figures: Figures, otherwise: str = "") -> Cell:
    """Returns the entry that figures make in a column.

    Args:
        column: its key may lead to the mean of an estimate, which has an interval.
        figures: those of a row.
        otherwise: why there is nothing, if figures do not say so.
    """
    *path, last = column.key.split(".")
    part = figures
    for key in path:
        if part.values.get(key) is None:
            return Cell(NOTHING, reason=part.reason(key) or otherwise)
        part = part.part(key)
    if last == "mean":
        return figure_cell(read_measured(part, last, column.factor), column.digits)
    value = part.number(last)
    if value is None:
        return Cell(NOTHING, reason=part.reason(last) or otherwise)
    return Cell(number(column.factor * value, column.digits))


def figures_table(
    title: str,
    first: str,
    columns: Sequence[Column],
    rows: Mapping[str, Figures],
    note: str = "",
) -> Table:
    """Returns figures by the titles of their rows; a row "all" is a total."""
    return Table(
        title,
        first,
        tuple(column.title for column in columns),
        tuple(
            Row(name, tuple(column_cell(c, own) for c in columns), name == "all")
            for name, own in rows.items()
        ),
        note,
    )


def label_table(
    title: str, columns: Sequence[Column], figures: Figures, note: str = ""
) -> Table:
    """Returns the figures of one robot, label by label, and of all labels.

    Args:
        title: over the table.
        columns: to show.
        figures: with "labels" and "all".
        note: below the table.
    """
    found = dict(figures.parts("labels"))
    known = {str(label): found[str(label)] for label in LABELS if str(label) in found}
    rows = {**known, "all": figures.part("all")}
    return figures_table(title, "gait", columns, rows, note)


def recognition_tables(generation: dict[str, Figures]) -> dict[str, Table]:
    """Returns what classifiers recognized, figures by robot, as three tables.

    "transformer" is Table 1 of the paper, a row for each source; "linear" the same by a
    linear classifier, with the paper's clips beside ours; "matched" the diversity that
    is left when there are no more samples than real.
    """

    def published(source: str, comparison: str) -> Cell:
        entry = CONTENT.published(source, comparison)
        return figure_cell(Measured(entry.mean, entry.low, entry.high))

    def of_clips(source: str, comparison: str) -> Cell:
        known = source == "all"
        return Cell(f"{CONTENT.linear[comparison]:.3f}" if known else NOT_MEASURED)

    def recognized(figures: Figures, *keys: str, otherwise: str = "") -> Cell:
        column = Column(key=".".join(("classifiers", *keys, "mean")))
        return column_cell(column, figures, otherwise)

    def table_1(title: str, kind: str, whose: str, theirs: Theirs) -> Table:
        def cells(source: str) -> Iterable[Cell]:
            for comparison in CONTENT.comparisons:
                yield theirs(source, comparison)
                for own in generation.values():
                    none = "there is no motion of this source"
                    yield recognized(own, kind, comparison, source, otherwise=none)

        return Table(
            f"{title}, share of trajectories recognized",
            "source",
            (whose, *robots) * len(CONTENT.comparisons),
            tuple(
                Row(name, tuple(cells(source)), total=source == "all")
                for source, name in CONTENT.sources.items()
            ),
            groups=tuple(CONTENT.comparisons.values()),
        )

    robots = tuple(map(robot_title, generation))
    linear = "Linear classifier on summaries"
    return {
        "transformer": table_1("Transformer", "transformer", "paper", published),
        "linear": table_1(linear, "linear", "paper's clips", of_clips),
        "matched": Table(
            "Diversity, from as many generated trajectories as there are recorded ones",
            "classifier",
            robots,
            tuple(
                Row(
                    kind,
                    tuple(
                        recognized(own, kind, "generated_to_real_matched", "all")
                        for own in generation.values()
                    ),
                )
                for kind in ("transformer", "linear")
            ),
        ),
    }
