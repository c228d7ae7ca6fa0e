"""The content of the report from ``report.yaml``: goals, published figures, columns."""

from dataclasses import dataclass, field
from math import inf
from pathlib import Path

from pydrake.common.yaml import yaml_load_typed

from loco_drake.evaluation.confidence import Estimate, wilson

_ROUNDING = 1e-9


@dataclass
class Figure:
    """Where a figure lies, see ``report.yaml``; ``factor`` takes it to its unit."""

    file: str = ""
    path: str = ""
    factor: float = 1.0
    over: str = ""  # the file whose figure at this path it is divided by, if any


@dataclass
class Bound:
    """The range from ``least`` to ``most``, and a text that says so."""

    least: float = -inf
    most: float = inf
    text: str = ""

    def __str__(self) -> str:
        sign, value = ("≥", self.least) if self.least > -inf else ("≤", self.most)
        return self.text or f"{sign} {f'{value:g}'.removeprefix('0')}"

    def __contains__(self, value: float) -> bool:
        return self.least - _ROUNDING <= value <= self.most + _ROUNDING


@dataclass
class Price(Figure, Bound):
    """A second figure for a goal, which is missed if it is out of bounds."""


@dataclass
class Goal:
    """A number to reach."""

    title: str = ""  # what is measured
    unit: str = ""  # of the figures, for people
    known: str = ""  # the paper's figure or the best known, for people
    aim: Bound = field(default_factory=Bound)  # what is to be reached
    dream: Bound | None = None  # beyond the aim
    figure: Figure = field(default_factory=Figure)  # what is measured
    price: Price | None = None  # what it was bought with
    digits: int = 3  # of figures, after the point


@dataclass
class Column:
    """A column of a table, or a row: its title with the unit, key, factor, digits.

    Points in the key lead into objects.
    """

    title: str = ""
    key: str = ""
    factor: float = 1.0
    digits: int = 3


@dataclass
class Result:
    """The command that writes a file of results, and a key of each robot's figures."""

    name: str = ""
    command: str = ""
    holds: str = "labels"


@dataclass
class Condition:
    """A condition of tracking, and the options that ask for it."""

    title: str = ""
    what: str = ""
    options: str = ""


@dataclass
class Policy:
    """A shipped policy; the main one has no name."""

    name: str = ""
    title: str = ""
    robots: list[str] = field(default_factory=list)


@dataclass
class Content:
    """All of ``report.yaml``, which explains each entry."""

    goals: dict[str, list[Goal]] = field(default_factory=dict)
    table_1: dict[str, list[list[int]]] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)
    comparisons: dict[str, str] = field(default_factory=dict)
    clips: dict[str, float] = field(default_factory=dict)
    parts: dict[str, dict[str, str]] = field(default_factory=dict)
    results: list[Result] = field(default_factory=list)
    conditions: dict[str, Condition] = field(default_factory=dict)
    policies: list[Policy] = field(default_factory=list)
    worlds: dict[str, str] = field(default_factory=dict)
    columns: dict[str, list[Column]] = field(default_factory=dict)

    def published(self, source: str, comparison: str) -> Estimate:
        """Returns an entry of the paper's Table 1, with Wilson's 95 % interval."""
        right, of = self.table_1[source][list(self.comparisons).index(comparison)]
        return Estimate(right / of, *wilson(right / of, of))


CONTENT: Content = yaml_load_typed(
    schema=Content, filename=str(Path(__file__).with_name("report.yaml"))
)
