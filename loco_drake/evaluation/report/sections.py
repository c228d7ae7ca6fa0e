"""The tables of each part of the pipeline, for all robots that have results."""

from collections.abc import Callable
from dataclasses import asdict, replace
from itertools import product
from typing import Any

from loco_drake.control.actor_file import load_actor
from loco_drake.evaluation.report.content import CONTENT
from loco_drake.evaluation.report.figures import Figures
from loco_drake.evaluation.report.results import Results, tracking_name
from loco_drake.evaluation.report.tables import (
    NOTHING,
    Cell,
    Row,
    Table,
    column_cell,
    label_table,
    number,
    recognition_tables,
    robot_title,
    robots_table,
)
from loco_drake.generation.generator import load_generator
from loco_drake.generation.tokenizer import load_tokenizer
from loco_drake.models.robots import ROBOTS, get_robot
from loco_drake.models.shipped import policy_path, pretrained_path
from loco_drake.motion.motion import FPS

_COLUMNS = CONTENT.columns
_TRACKING = tuple(column.title for column in _COLUMNS["tracking"])


def all_tables(results: Results) -> dict[str, Any]:
    """Returns the tables of what results there are, by name; none where there are none.

    Raises:
        InputError: if a result is damaged.
    """
    generation = results.of_robots("generation")

    def by_robot(name: str, table: Callable[[str, Figures], Table]) -> list[Table]:
        return [table(robot, own) for robot, own in results.of_robots(name).items()]

    return {
        "retargeting": by_robot("retargeting", retargeting_table),
        "tokenizer": by_robot("tokenizer", tokenizer_table),
        "recognition": recognition_tables(generation) if generation else None,
        "realism": realism_table(generation) if generation else None,
        "generation": by_robot("generation", generation_table),
        "tracking": by_robot("tracking-generated", tracking_table),
        "steering": by_robot("steering", steering_table),
        "steering_range": by_robot("steering", steering_range_table),
        "robustness": robustness_table(results),
        "disturbed": by_robot("robustness", disturbed_table),
        "policies": policies_table(results),
    }


def _by_gait(robot: str) -> str:
    return f"{robot_title(robot)}, by gait"


def retargeting_table(robot: str, figures: Figures) -> Table:
    """Returns the figures of retargeting, by label."""
    return label_table(_by_gait(robot), _COLUMNS["retargeting"], figures)


def tracking_table(robot: str, figures: Figures) -> Table:
    """Returns the figures of tracking, by label, and how they were measured."""
    columns = _COLUMNS["tracking"] + _COLUMNS["tracking_more"]
    return label_table(_by_gait(robot), columns, figures, conditions_text(figures))


def steering_table(robot: str, figures: Figures) -> Table:
    """Returns how a robot follows commands, by label, and the number of drives."""
    counts = [own.number("drives") or 0.0 for _, own in figures.parts("labels")]
    drives = max(counts, default=0.0)
    note = f"Drives of each gait: {drives:.0f}." if drives else ""
    return label_table(_by_gait(robot), _COLUMNS["steering"], figures, note)


def steering_range_table(robot: str, figures: Figures) -> Table:
    """Returns the ranges of the commands, by label, and how sound the plan is there."""
    title = f"{robot_title(robot)}, ranges of the commands"
    return label_table(title, _COLUMNS["steering_range"], figures)


def disturbed_table(robot: str, figures: Figures) -> Table:
    """Returns what a robot survives, by label."""
    return label_table(_by_gait(robot), _COLUMNS["robustness"], figures)


def tokenizer_table(robot: str, figures: Figures) -> Table:
    """Returns errors by label, of recordings held out and of those for training."""
    columns = _COLUMNS["tokenizer"]
    table = label_table(_by_gait(robot), columns, figures)
    use = figures.required("codebook_use")
    if figures.values.get("train") is None:
        return table
    seen = label_table("", columns, figures.part("train"))
    by_title = {row.title: row.cells for row in seen.rows}
    nothing = (Cell(NOTHING),) * len(columns)
    added = [by_title.get(row.title, nothing) for row in table.rows]
    titles = (title.replace("held out", "training") for title in seen.columns)
    note = "" if use is None else f"Codes in use: {100 * use:.1f} %."
    return replace(table.beside(titles, added), note=note)


def generation_table(robot: str, figures: Figures) -> Table:
    """Returns how sound generated motion is, by label."""
    table = label_table(_by_gait(robot), _COLUMNS["generation"], figures)
    drifts = [(_drift(figures, row),) for row in table.rows]
    return table.beside(("drift over 60 s, and of what",), drifts)


def _drift(figures: Figures, row: Row) -> Cell:
    """Returns the worst drift of a label, or of all, and the figure that drifts."""
    if figures.values.get("drift") is None:
        return Cell(NOTHING, reason=figures.reason("drift_60s"))
    if row.total:
        value = figures.number("drift_60s")
        return Cell(NOTHING if value is None else number(value, 2))
    labels = figures.part("drift", "labels")
    known = row.title in labels.values
    worst = labels.extreme(max, "drift", row.title) if known else None
    if worst is None:
        return Cell(NOTHING)
    value, what = worst
    name = what.rpartition("_")[0] or what  # without its unit
    return Cell(number(value, 2), note=name.replace("_", " "))


def realism_table(robots: dict[str, Figures]) -> Table:
    """Returns what tells generated motion from recordings, robots side by side."""
    title = "Real or generated? New or copied?"
    return robots_table(title, "figure", _COLUMNS["realism"], robots, clips=True)


def robustness_table(results: Results) -> Table | None:
    """Returns tracking under all conditions, robot by robot."""
    rows = []
    for robot, (name, condition) in product(ROBOTS, CONTENT.conditions.items()):
        if (figures := results.of(tracking_name(name), robot)) is not None:
            more = _worst(figures), Cell(conditions_text(figures))
            cells = (*_whole_cells(figures), *more)
            rows.append(Row(f"{robot_title(robot)}, {condition.title}", cells))
    columns = (*_TRACKING, "worst gait", "measured on")
    title = "All gaits together, by condition"
    return Table(title, "condition", columns, tuple(rows)) if rows else None


def policies_table(results: Results) -> Table | None:
    """Returns each shipped policy in the world of the training and in randomized ones.

    So it says what randomization in training costs and brings, and what a policy loses
    that does without privileged observations.
    """
    worlds = CONTENT.worlds
    rows = []
    for robot, policy in product(ROBOTS, CONTENT.policies):
        found = [results.of(tracking_name(k, policy.name), robot) for k in worlds]
        if any(found):
            cells = tuple(cell for figures in found for cell in _whole_cells(figures))
            rows.append(Row(f"{robot_title(robot)}, {policy.title}", cells))
    columns, groups = _TRACKING * len(worlds), tuple(worlds.values())
    title = "Policies in both worlds"
    table = Table(title, "policy", columns, tuple(rows), groups=groups)
    return table if rows else None


def _whole_cells(figures: Figures | None) -> tuple[Cell, ...]:
    if figures is None:
        return (Cell(NOTHING),) * len(_TRACKING)
    whole = figures.part("all")
    return tuple(column_cell(column, whole) for column in _COLUMNS["tracking"])


def _worst(figures: Figures) -> Cell:
    worst = figures.extreme(min, "normalized_return", "labels")
    return Cell(number(worst[0], 1), note=worst[1]) if worst else Cell(NOTHING)


def conditions_text(figures: Figures) -> str:
    """Returns under which conditions tracking was measured."""

    def shown(text: str, value: float | None, factor: float = 1.0) -> str:
        return "" if value is None else text.format(factor * value)

    episodes = shown("{:.0f} episodes", figures.part("all").number("episodes"))
    duration = shown("of up to {:g} s", figures.number("duration_s"))
    parts = (
        f"{episodes} {duration}".strip(),
        figures.text("contact"),
        shown("{:g} ms", figures.number("time_step_s"), 1000),
        shown("friction {:g}", figures.number("friction")),
    )
    return f"{', '.join(filter(None, parts))}."


def networks_table() -> Table:
    """Returns the parts of the pipeline, the paper's beside ours.

    Raises:
        InputError: if shipped weights are damaged.
    """
    tokenizer = load_tokenizer(pretrained_path("tokenizer")).config
    generator = load_generator(pretrained_path("generator")).config
    robot = get_robot(ROBOTS[0])
    policy = load_actor(policy_path(robot), robot).config
    fields = {
        **asdict(tokenizer),
        **asdict(generator),
        "codebooks": tokenizer.codebooks,
        "hidden": "-".join(map(str, policy.hidden)),
        "observations": sum(size for _, size in policy.observation_layout),
        "action_scale": policy.action_scale,
        "tokens_per_second": FPS / tokenizer.frames_per_token,
        "robots": " and ".join(map(robot_title, tokenizer.robots)),
    }
    rows = tuple(
        Row(name, (Cell(part["paper"]), Cell(part["ours"].format(**fields))))
        for name, part in CONTENT.parts.items()
    )
    return Table("The parts", "part", ("paper's release", "ours"), rows)
