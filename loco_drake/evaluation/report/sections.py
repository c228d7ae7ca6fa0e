"""The tables of each part of the pipeline, for all robots that have results."""

from collections.abc import Iterable

from loco_drake.evaluation.report.expected import (
    CONDITIONS,
    POLICIES,
    WORLDS,
    tracking_name,
)
from loco_drake.evaluation.report.measures import read_estimate
from loco_drake.evaluation.report.published import CLIPS
from loco_drake.evaluation.report.results import Figures, Results
from loco_drake.evaluation.report.table_one import estimate_cell
from loco_drake.evaluation.report.tables import (
    NOT_MEASURED,
    NOTHING,
    Cell,
    Column,
    Row,
    Table,
    label_table,
    number,
    row_table,
)
from loco_drake.evaluation.report.words import robot_title
from loco_drake.models.robots import ROBOTS

_RETARGETING = (
    Column("slip, mm/s", "stance_slip_median_mps", 1000, 2),
    Column("correction, mm RMS", "correction_rmse_m", 1000, 1),
    Column("trunk moved, mm RMS", "trunk_correction_rmse_m", 1000, 1),
    Column("toe error, mm RMS", "toe_error_rmse_m", 1000, 2),
    Column("sunk, mm", "penetration_max_m", 1000, 2),
    Column("beyond limits", "joint_limit_violations", 1, 0),
    Column("speed over limit", "joint_speed_ratio_max", 1, 2),
    Column("stride period, % off", "stride_period_error", 100, 2),
    Column("phase lag, % of stride off", "phase_lag_error", 100, 2),
    Column("duty factor, % off", "duty_factor_error", 100, 1),
    Column("clips", "clips", 1, 0),
)
_TOKENIZER = (
    Column("held out: joints, rad RMS", "joint_rmse_rad"),
    Column("held out: toes, mm RMS", "toe_error_rmse_m", 1000, 1),
)
_GENERATION = (
    Column("slip, mm/s", "stance_slip_median_mps", 1000, 2),
    Column("sunk, mm", "penetration_max_m", 1000, 2),
    Column("jerk over recorded", "jerk_ratio", 1, 2),
    Column("speed, m/s", "speed_mps", 1, 2),
    Column("recorded, m/s", "speed_mps", 1, 2, within=("recorded",)),
    Column("error of mean speed, m/s", "speed_error_mps", 1, 3),
)
_PARTS = "two_sample_accuracy_of_parts"
_REALISM = {
    "fid": ("Fréchet distance, generated to recorded", 3),
    "fid_real_real": ("… of recordings to other recordings", 3),
    "nearest_training_rad": ("nearest recording, rad RMS", 3),
    "nearest_training_rad_validation": ("… of recordings held out", 3),
    "real_time_factor": ("writing, × real time", 1),
}
_TRACKING = (
    Column("return, of 100", "normalized_return", 1, 1),
    Column("stretch", "stretch", 1, 3),
    Column("falls, %", "fall_rate", 100, 0),
    Column("joints, rad RMS", "joint_rmse_rad"),
    Column("base, m RMS", "base_position_rmse_m"),
    Column("base, rad RMS", "base_orientation_rmse_rad"),
)
_TRACKING_MORE = (
    Column("worst episode", "normalized_return_worst", 1, 1),
    Column("slip, m/s", "stance_slip_median_mps"),
    Column("speed, m/s", "speed_mps", 1, 2),
    Column("cost of transport", "cost_of_transport", 1, 2),
    Column("episodes", "episodes", 1, 0),
)


def of_robots(results: Results, name: str) -> dict[str, Figures]:
    """Returns the figures of each robot that ``name`` has some of."""
    found = {robot: results.of(name, robot) for robot in ROBOTS}
    return {robot: figures for robot, figures in found.items() if figures is not None}


def retargeting_tables(results: Results) -> list[Table]:
    """Returns all labels of each robot, one table after the other."""
    return [
        label_table(f"{robot_title(robot)}, by gait", _RETARGETING, figures)
        for robot, figures in of_robots(results, "retargeting").items()
    ]


def tokenizer_tables(results: Results) -> list[Table]:
    """Returns errors by label, of recordings held out and of those for training."""
    tables = []
    for robot, figures in of_robots(results, "tokenizer").items():
        table = label_table(f"{robot_title(robot)}, by gait", _TOKENIZER, figures)
        use = figures.required("codebook_use")
        note = "" if use is None else f"Codes in use: {100 * use:.1f} %."
        if isinstance(figures.values.get("train"), dict):
            seen = label_table("", _TOKENIZER, figures.part("train"))
            by_title = {row.title: row.cells for row in seen.rows}
            rows = tuple(
                Row(
                    row.title,
                    row.cells + by_title.get(row.title, (Cell(NOTHING),) * 2),
                    row.total,
                )
                for row in table.rows
            )
            columns = table.columns + tuple(
                title.replace("held out", "training") for title in seen.columns
            )
            table = Table(table.title, table.first, columns, rows, note)
        tables.append(table)
    return tables


def generation_tables(results: Results) -> list[Table]:
    """Returns how sound generated motion is, by label."""
    tables = []
    for robot, figures in of_robots(results, "generation").items():
        table = label_table(f"{robot_title(robot)}, by gait", _GENERATION, figures)
        rows = tuple(
            Row(row.title, (*row.cells, _drift(figures, row)), row.total)
            for row in table.rows
        )
        columns = (*table.columns, "drift over 60 s, and of what")
        tables.append(Table(table.title, table.first, columns, rows))
    return tables


def _drift(figures: Figures, row: Row) -> Cell:
    """Returns the worst drift of a label, or of all, and the figure that drifts."""
    drift = figures.values.get("drift")
    if not isinstance(drift, dict):
        return Cell(NOTHING, reason=figures.reason("drift_60s") or "")
    if row.total:
        value = figures.number("drift_60s")
        return Cell(NOTHING if value is None else number(value, 2))
    labels = figures.part("drift", "labels")
    if row.title not in labels.values:
        return Cell(NOTHING)
    worst = [
        (value, what)
        for what, part in labels.parts(row.title)
        if (value := part.number("drift")) is not None
    ]
    if not worst:
        return Cell(NOTHING)
    value, what = max(worst)
    what = what.removesuffix("_mps").removesuffix("_m").removesuffix("_s")
    return Cell(number(value, 2), note=what.replace("_", " "))


def realism_table(results: Results) -> Table:
    """Returns what tells generated motion from recordings, robots side by side."""
    robots = of_robots(results, "generation")
    rows = []

    def add(title: str, key: str, cells: Iterable[Cell]) -> None:
        theirs = Cell(f"{CLIPS[key]:.3f}" if key in CLIPS else NOT_MEASURED)
        rows.append(Row(title, (theirs, *cells)))

    def add_estimate(title: str, *keys: str) -> None:
        add(title, keys[-1], (_estimate(figures, keys) for figures in robots.values()))

    add_estimate("told from recordings, linear (.5 is chance)", "two_sample_accuracy")
    parts = dict.fromkeys(
        part for figures in robots.values() for part in figures.values.get(_PARTS) or {}
    )
    for part in parts:
        add_estimate(f"… from {part} alone", _PARTS, part)
    add_estimate("… by a support vector machine", "two_sample_accuracy_kernel")
    add_estimate("recordings told from others, linear", "two_sample_accuracy_real_real")
    for key, (title, digits) in _REALISM.items():
        column = Column("", key, 1, digits)
        add(title, key, (column.cell(figures) for figures in robots.values()))
    columns = ("paper's clips", *map(robot_title, robots))
    return Table("Real or generated? New or copied?", "figure", columns, tuple(rows))


def _estimate(figures: Figures, keys: tuple[str, ...]) -> Cell:
    if figures.values.get(keys[0]) is None:
        return Cell(NOTHING, reason=figures.reason(keys[0]) or "")
    return estimate_cell(read_estimate(figures, *keys))


def tracking_tables(results: Results) -> list[Table]:
    """Returns all labels of each robot under the conditions of the training."""
    return [
        label_table(
            f"{robot_title(robot)}, by gait",
            (*_TRACKING, *_TRACKING_MORE),
            figures,
            conditions_text(figures),
        )
        for robot, figures in of_robots(results, "tracking-generated").items()
    ]


def robustness_table(results: Results) -> Table:
    """Returns tracking under all conditions, robot by robot."""
    rows = [
        (f"{robot_title(robot)}, {title}", figures)
        for robot in ROBOTS
        for condition, (title, _, _) in CONDITIONS.items()
        if (figures := results.of(f"tracking-{condition}", robot)) is not None
    ]

    def conditions(figures: Figures) -> Cell:
        return Cell(conditions_text(figures))

    return row_table(
        "All gaits together, by condition",
        "condition",
        _TRACKING,
        ((title, _whole(figures)) for title, figures in rows),
        extra=(("worst gait", _worst), ("measured on", conditions)),
    )


def policies_table(results: Results) -> Table:
    """Returns each shipped policy in the world of the training and in randomized ones.

    So it says what randomization in training costs and brings, and what a policy loses
    that does without privileged observations.
    """
    rows = []
    for robot in ROBOTS:
        for policy, title in POLICIES.items():
            found = [
                results.of(tracking_name(condition, policy), robot)
                for _, condition, _ in WORLDS
            ]
            if any(found):
                cells = (cell for figures in found for cell in _world_cells(figures))
                rows.append(Row(f"{robot_title(robot)}, {title}", tuple(cells)))
    return Table(
        "Policies in both worlds",
        "policy",
        tuple(column.title for column in _TRACKING) * len(WORLDS),
        tuple(rows),
        groups=tuple(title for title, _, _ in WORLDS),
    )


def _world_cells(figures: Figures | None) -> tuple[Cell, ...]:
    if figures is None:
        return (Cell(NOTHING),) * len(_TRACKING)
    whole = figures.part("all")
    return tuple(column.cell(whole) for column in _TRACKING)


def _whole(figures: Figures) -> Figures:
    """Returns the figures of all labels, with those of the labels still at hand."""
    return Figures({**figures.values, **figures.part("all").values}, figures.origin)


def _worst(figures: Figures) -> Cell:
    returns = [
        (value, label)
        for label, part in figures.parts("labels")
        if (value := part.required("normalized_return")) is not None
    ]
    if not returns:
        return Cell(NOTHING)
    value, label = min(returns)
    return Cell(number(value, 1), note=label)


def conditions_text(figures: Figures) -> str:
    """Returns under which conditions tracking was measured."""
    episodes = figures.part("all").number("episodes")
    parts = [
        "" if episodes is None else f"{episodes:.0f} episodes",
        _unit(figures, "duration_s", "of up to {:g} s"),
        str(figures.values.get("contact") or ""),
        _unit(figures, "time_step_s", "{:g} ms", 1000),
        _unit(figures, "friction", "friction {:g}"),
    ]
    text = ", ".join(part for part in parts if part).replace("episodes, ", "episodes ")
    return f"{text}."


def _unit(figures: Figures, key: str, text: str, factor: float = 1.0) -> str:
    value = figures.number(key)
    return "" if value is None else text.format(factor * value)
