"""Puts the committed results into the tables of the documentation.

    python docs/tables.py

A table is found by the line before it. ``tests/test_docs.py`` checks that the pages
show the results.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from loco_drake.common.files import atomic_path, read_json
from loco_drake.evaluation.report.figures import Figures
from loco_drake.evaluation.report.goals import MISSED, UNKNOWN, scoreboard
from loco_drake.evaluation.report.results import (
    Results,
    load_results,
    results_dir,
)
from loco_drake.evaluation.report.sections import (
    disturbed_table,
    generation_table,
    policies_table,
    realism_table,
    robustness_table,
    tokenizer_table,
)
from loco_drake.evaluation.report.tables import (
    Table,
    figure_cell,
    recognition_tables,
)
from loco_drake.evaluation.robustness_pictures import levels_table
from loco_drake.models.robots import ROBOTS

DOCS = Path(__file__).parent
TITLES = {"go2": "Go2", "a1": "A1"}
MISSING = "–"
MARKS = ("✓", "✗")  # a goal is met, missed

Rows = list[list[str]]
# Key of the figure, factor, digits.
Columns = tuple[tuple[str, float, int], ...]

TRACKING: Columns = (
    ("normalized_return", 1, 1),
    ("normalized_return_worst", 1, 1),
    ("fall_rate", 100, 0),
    ("joint_rmse_rad", 1, 3),
    ("base_position_rmse_m", 1, 3),
    ("base_orientation_rmse_rad", 1, 3),
    ("stance_slip_median_mps", 1, 3),
    ("stretch", 1, 3),
    ("speed_mps", 1, 2),
    ("cost_of_transport", 1, 2),
)
STEERING: Columns = (
    ("velocity_rmse_mps", 1, 3),
    ("yaw_rate_rmse_radps", 1, 3),
    ("fall_rate", 100, 0),
    ("normalized_return", 1, 1),
    ("latency_reference_s", 1, 2),
    ("latency_robot_s", 1, 2),
)


def tracking_rows(results: dict[str, Any]) -> Rows:
    """Returns the rows of a table by gait of docs/tracking_results.md."""
    return [[name, *_cells(own, TRACKING)] for name, own in _by_label(results)]


def steering_rows(results: dict[str, Any]) -> Rows:
    """Returns the rows of a table of docs/steering.md."""
    rows = []
    for name, own in _by_label(results):
        ranges, covered = [MISSING] * 3, MISSING  # of all labels together
        if "range" in own:
            ends = own["range"].values()
            ranges = [f"{low:.2f} to {high:.2f}" for low, high in ends]
            covered = f"{own['steps_covered']} of {own['steps']}"
        rows.append([name, *ranges, *_cells(own, STEERING), covered])
    return rows


def disturbed_rows(results: dict[str, Any]) -> Rows:
    """Returns the rows of a table by gait of docs/robustness.md."""
    return _texts(disturbed_table(str(results["robot"]), Figures(results)))


def level_rows(results: dict[str, Any]) -> Rows:
    """Returns the rows of a table of all gaits of docs/robustness.md."""
    return [list(row) for row in levels_table(results["all"])[1]]


def table_1_rows(results: Results) -> Rows:
    """Returns the rows of Table 1 of docs/results.md."""
    return _texts(recognition_tables(results.of_robots("generation"))["transformer"])


def world_rows(results: Results) -> Rows:
    """Returns the rows of the table of all worlds of docs/tracking_results.md."""
    rows = _noted(robustness_table(results))
    return [row[:-1] for row in rows]  # without what it was measured on


def policy_rows(results: Results) -> Rows:
    """Returns the rows of the table of all policies of docs/tracking_results.md."""
    return _texts(policies_table(results))


def matched_rows(results: Results) -> Rows:
    """Returns the rows of recognition of docs/generation_results.md."""
    return _noted(recognition_tables(results.of_robots("generation"))["matched"])


def realism_rows(results: Results) -> Rows:
    """Returns the rows of what tells real from generated of the same page."""
    rows = _noted(realism_table(results.of_robots("generation")))
    return [[title, *texts] for title, _, *texts in rows]  # without the paper's clips


def generation_rows(robot: str) -> Callable[[Results], Rows]:
    """Returns what makes the rows by gait of a robot of the same page."""

    def rows(results: Results) -> Rows:
        found = results.of("generation", robot)
        return _noted(generation_table(robot, found) if found else None)

    return rows


def tokenizer_rows(results: Results) -> Rows:
    """Returns the rows of the errors of the tokenizer of the model card."""
    found = results.of_robots("tokenizer").items()
    tables = [tokenizer_table(robot, own).rows for robot, own in found]
    return [
        [rows[0].title, *(cell.text for row in rows for cell in row.cells[:2])]
        for rows in zip(*tables, strict=True)
    ]


def goal_rows(results: Results) -> Rows:
    """Returns the rows of the goals of docs/results.md."""
    rows = []
    for part, lines in scoreboard(results).items():
        for number, line in enumerate(lines):
            goal, cells = line.goal, []
            for found, verdict in zip(line.measured, line.verdicts, strict=True):
                text = figure_cell(found, goal.digits).text
                mark = MARKS[verdict == MISSED]
                cells.append("not measured" if verdict == UNKNOWN else f"{text} {mark}")
            title = goal.title if number else f"**{part}:** {goal.title}"
            rows.append([title, goal.unit, goal.known, str(goal.aim), *cells])
    return rows


# Page, results, the line before the table, and its rows.
_TABLES: tuple[tuple[str, str, str, Callable[[dict[str, Any]], Rows]], ...] = (
    ("tracking_results.md", "tracking-{robot}-generated", "{title}:", tracking_rows),
    ("steering.md", "steering-{robot}", "{title}:", steering_rows),
    (
        "robustness.md",
        "robustness-{robot}",
        "{title}, by gait; [^\n]+:",
        disturbed_rows,
    ),
    ("robustness.md", "robustness-{robot}", "{title}, all [^\n]+:", level_rows),
)
# The same of tables of all results.
_WHOLE: tuple[tuple[str, str, Callable[[Results], Rows]], ...] = (
    ("results.md", "share of trajectories recognized:", table_1_rows),
    ("results.md", "Goals and what was measured[^\n]*:", goal_rows),
    ("tracking_results.md", "All gaits together, by condition:", world_rows),
    ("tracking_results.md", "Policies in the world[^\n]*:", policy_rows),
    ("generation_results.md", "Diversity[^\n]*:", matched_rows),
    ("generation_results.md", "Real or generated[^\n]*:", realism_rows),
    *(
        ("generation_results.md", f"{title}, by gait:", generation_rows(robot))
        for robot, title in TITLES.items()
    ),
    ("../models/pretrained/MODEL_CARD.md", "held-out recordings:", tokenizer_rows),
)


def with_results(name: str, page: str) -> str:
    """Returns the text of a page with the committed results in its tables.

    Raises:
        ValueError: if a table is not there, or its columns are others.
    """
    for file, results, before, rows in _TABLES:
        for robot in ROBOTS if file == name else ():
            found = read_json(results_dir() / f"{results.format(robot=robot)}.json")
            line = before.format(title=TITLES[robot])
            page = _replaced(page, line, rows(found))
    for file, line, whole in _WHOLE:
        if file == name:
            page = _replaced(page, line, whole(load_results(results_dir())))
    return page


def _replaced(page: str, line: str, rows: Rows) -> str:
    table = rf"^([^\n]*{line}\n\n\|[^\n]*\n\|[-:| ]+\|\n)(?:\|[^\n]*\n)+"
    matches = list(re.finditer(table, page, re.M))
    if len(matches) != 1:
        raise ValueError(f"{len(matches)} tables come after {line!r}, not one")
    if not rows:
        raise ValueError(f"there are no results for the table after {line!r}")
    match = matches[0]
    width = match[1].splitlines()[2].count("|") - 1
    if any(len(row) != width for row in rows):
        raise ValueError(f"the table after {line!r} has {width} columns")
    lines = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    return f"{page[: match.start()]}{match[1]}{lines}{page[match.end() :]}"


def _texts(table: Table | None) -> Rows:
    """Returns the rows of a table of the report, if there is one."""
    rows = table.rows if table else ()
    return [[row.title, *(cell.text for cell in row.cells)] for row in rows]


def _noted(table: Table | None) -> Rows:
    """Returns the same with what the report shows below an entry behind it."""
    rows = table.rows if table else ()
    noted = [
        [f"{c.text} ({c.note})" if c.note else c.text for c in r.cells] for r in rows
    ]
    return [[row.title, *texts] for row, texts in zip(rows, noted, strict=True)]


def _by_label(results: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    yield from results["labels"].items()
    yield "all", results["all"]


def _cells(figures: dict[str, Any], columns: Columns) -> list[str]:
    return [
        MISSING if figures[key] is None else f"{factor * figures[key]:.{digits}f}"
        for key, factor, digits in columns
    ]


if __name__ == "__main__":
    for name in sorted({table[0] for table in (*_TABLES, *_WHOLE)}):
        path = DOCS / name
        page = with_results(name, path.read_text())
        with atomic_path(path) as temporary:
            temporary.write_text(page)
