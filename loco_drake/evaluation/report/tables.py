"""Tables of the report as text, ready for layout."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace

from loco_drake.evaluation.report.content import CONTENT, Column
from loco_drake.evaluation.report.figures import Figures
from loco_drake.evaluation.report.goals import Measured, read_measured
from loco_drake.motion.gaits import LABELS

NOTHING = "–"
NOT_MEASURED = "not measured"  # of what others released
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

    def beside(
        self, columns: Iterable[str], cells: Iterable[tuple[Cell, ...]]
    ) -> "Table":
        """Returns the table with further columns, their cells row by row."""
        rows = tuple(
            replace(row, cells=row.cells + more)
            for row, more in zip(self.rows, cells, strict=True)
        )
        return replace(self, columns=(*self.columns, *columns), rows=rows)


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

    The key may lead to the mean of an estimate, which has an interval. ``otherwise``
    says why there is nothing, if the figures do not.
    """
    *path, last = column.key.split(".")
    part = figures
    for key in path:
        if part.values.get(key) is None:
            return Cell(NOTHING, reason=part.reason(key) or otherwise)
        part = part.part(key)
    if last == "mean":
        return figure_cell(read_measured(part, last, column.factor), column.digits)
    value = part.entry(last)
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
    titles = tuple(column.title for column in columns)
    entries = tuple(
        Row(name, tuple(column_cell(c, own) for c in columns), name == "all")
        for name, own in rows.items()
    )
    return Table(title, first, titles, entries, note)


def label_table(
    title: str, columns: Sequence[Column], figures: Figures, note: str = ""
) -> Table:
    """Returns the figures of one robot, label by label, and of all labels."""
    found = dict(figures.parts("labels"))
    known = {label: found[label] for label in map(str, LABELS) if label in found}
    rows = {**known, "all": figures.part("all")}
    return figures_table(title, "gait", columns, rows, note)


def robots_table(
    title: str,
    first: str,
    rows: Sequence[Column],
    robots: Mapping[str, Figures],
    *,
    clips: bool = False,
) -> Table:
    """Returns a row for each figure: of the paper's clips, if asked, and each robot."""
    entries = []
    for row in rows:
        cells = [of_clips(row.key)] if clips else []
        cells += [column_cell(row, own) for own in robots.values()]
        entries.append(Row(row.title, tuple(cells)))
    columns = ("paper's clips",) * clips + tuple(map(robot_title, robots))
    return Table(title, first, columns, tuple(entries))


def of_clips(key: str) -> Cell:
    """Returns a figure of generation of the paper's clips."""
    value = CONTENT.clips.get(key)
    return Cell(NOT_MEASURED if value is None else f"{value:.3f}")


def recognition_tables(generation: Mapping[str, Figures]) -> dict[str, Table]:
    """Returns what classifiers recognized, figures by robot, as three tables.

    "transformer" is Table 1 of the paper, a row for each source; "linear" the same by a
    linear classifier, with the paper's clips beside ours; "matched" the diversity that
    is left when there are no more samples than real.
    """

    def cells(kind: str, source: str) -> Iterator[Cell]:
        for comparison in CONTENT.comparisons:
            key = f"classifiers.{kind}.{comparison}.{source}.mean"
            published = Measured(*astuple(CONTENT.published(source, comparison)))
            yield figure_cell(published) if kind == "transformer" else of_clips(key)
            for own in generation.values():
                none = "there is no motion of this source"
                yield column_cell(Column(key=key), own, none)

    def table_1(kind: str, title: str, whose: str) -> Table:
        return Table(
            f"{title}, share of trajectories recognized",
            "source",
            (whose, *map(robot_title, generation)) * len(CONTENT.comparisons),
            tuple(
                Row(name, tuple(cells(kind, source)), total=source == "all")
                for source, name in CONTENT.sources.items()
            ),
            groups=tuple(CONTENT.comparisons.values()),
        )

    return {
        "transformer": table_1("transformer", "Transformer", "paper"),
        "linear": table_1("linear", "Linear classifier on summaries", "paper's clips"),
        "matched": robots_table(
            "Diversity, from as many generated trajectories as there are recorded ones",
            "classifier",
            CONTENT.columns["matched"],
            generation,
        ),
    }
