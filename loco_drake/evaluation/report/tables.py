"""Tables of the report, as text that a page only has to lay out."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from loco_drake.evaluation.report.results import Figures
from loco_drake.motion.gaits import LABELS

NOTHING = "–"
NOT_MEASURED = "not measured"  # of what others released


@dataclass(frozen=True)
class Cell:
    """One entry.

    Attributes:
        text: what is shown.
        note: smaller, below it: an interval, a price.
        reason: why there is nothing, if so.
    """

    text: str
    note: str = ""
    reason: str = ""


@dataclass(frozen=True)
class Row:
    """One line: what it is of, and its entries."""

    title: str
    cells: tuple[Cell, ...]
    total: bool = False


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        title: over it.
        first: title of the rows' titles.
        columns: titles, with units.
        rows: the entries.
        note: below it.
        groups: titles over as many columns each, if any.
    """

    title: str
    first: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    note: str = ""
    groups: tuple[str, ...] = ()

    @property
    def reasons(self) -> list[str]:
        """Why entries are missing, each once, with the rows that it is about."""
        rows: dict[str, list[str]] = {}
        for row in self.rows:
            for reason in dict.fromkeys(cell.reason for cell in row.cells):
                if reason:
                    rows.setdefault(reason, []).append(row.title)
        return [f"{', '.join(titles)}: {reason}" for reason, titles in rows.items()]


@dataclass(frozen=True)
class Column:
    """What a column shows.

    Attributes:
        title: with the unit.
        key: of the figure.
        factor: from the figure's unit to the one shown.
        digits: after the point.
        within: keys of the object that the figure is in.
    """

    title: str
    key: str
    factor: float = 1.0
    digits: int = 3
    within: tuple[str, ...] = ()

    def cell(self, figures: Figures) -> Cell:
        """Returns the entry that ``figures`` make."""
        part = figures
        for key in self.within:
            if part.values.get(key) is None:
                return Cell(NOTHING, reason=figures.reason(self.key) or "")
            part = part.part(key)
        value = part.number(self.key)
        if value is None:
            return Cell(NOTHING, reason=part.reason(self.key) or "")
        return Cell(number(self.factor * value, self.digits))


def number(value: float, digits: int) -> str:
    """Returns a number as text; of what is too small to show, a bound."""
    text = f"{value:.{digits}f}"
    if value and float(text) == 0:
        return f"< {10.0**-digits:.{digits}f}"
    if value == 0:
        return "0"
    if abs(value) >= 1e4:
        return f"{value:,.{digits}f}"
    return text


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
    by_label = dict(figures.parts("labels"))
    known = [str(label) for label in LABELS if str(label) in by_label]
    rows = [
        Row(label, tuple(column.cell(by_label[label]) for column in columns))
        for label in known
    ]
    whole = figures.part("all")
    rows.append(Row("all", tuple(column.cell(whole) for column in columns), total=True))
    return Table(title, "gait", tuple(c.title for c in columns), tuple(rows), note)


def row_table(
    title: str,
    first: str,
    columns: Sequence[Column],
    rows: Iterable[tuple[str, Figures]],
    note: str = "",
    extra: Sequence[tuple[str, Callable[[Figures], Cell]]] = (),
) -> Table:
    """Returns figures in rows of any kind, such as robots or contact solvers.

    Args:
        title: over the table.
        first: title of the first column.
        columns: to show.
        rows: title and figures of each.
        note: below the table.
        extra: further columns: title, and what makes the entry of a row's figures.
    """
    made = tuple(
        Row(
            name,
            (
                *(column.cell(figures) for column in columns),
                *(make(figures) for _, make in extra),
            ),
        )
        for name, figures in rows
    )
    titles = (*(c.title for c in columns), *(title for title, _ in extra))
    return Table(title, first, titles, made, note)
