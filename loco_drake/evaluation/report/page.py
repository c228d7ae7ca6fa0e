"""The page: all parts of the report in one HTML file that needs nothing else."""

from collections.abc import Mapping, Sequence
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from loco_drake import __version__
from loco_drake.evaluation.report import pictures, sections, table_one
from loco_drake.evaluation.report.commands import commands
from loco_drake.evaluation.report.expected import CONDITIONS
from loco_drake.evaluation.report.networks import networks_table
from loco_drake.evaluation.report.replays import Replay, share_pieces
from loco_drake.evaluation.report.results import Results
from loco_drake.evaluation.report.scoreboard import Line
from loco_drake.evaluation.report.words import robot_title
from loco_drake.models.robots import ROBOTS
from loco_drake.motion.motion import Motion


def render(
    results: Results,
    goals: dict[str, list[Line]],
    counts: dict[str, dict[str, int]],
    motions: Mapping[str, Sequence[Motion]],
    replays: Sequence[Replay],
    unavailable: Mapping[str, str],
) -> str:
    """Returns the page.

    Args:
        results: of the ``evaluate`` commands.
        goals: of :func:`.scoreboard.scoreboard`.
        counts: of :func:`.scoreboard.counts`.
        motions: generated, of each robot, one for each gait.
        replays: to embed.
        unavailable: robots without replays, and why.

    Raises:
        InputError: if a result is damaged.
    """
    environment = Environment(
        loader=PackageLoader("loco_drake.evaluation.report"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.globals.update(robot_title=robot_title)
    page = environment.get_template("page.html")
    return page.render(
        version=__version__,
        robots=ROBOTS,
        goals=goals,
        counts=counts,
        missing=results.missing,
        absent=results.absent,
        found=results.found,
        commands=commands(results),
        conditions=CONDITIONS,
        gaits=pictures.gaits_picture(motions),
        gait_count=len(next(iter(motions.values()))),
        networks=networks_table(),
        replays=replays,
        replay_data=share_pieces([replay.html for replay in replays]),
        unavailable=unavailable,
        **tables(results),
        **drawings(results),
    )


def tables(results: Results) -> dict[str, Any]:
    """Returns the tables of what results there are, by name; None of others.

    Raises:
        InputError: if a result is damaged.
    """
    generation = sections.of_robots(results, "generation")
    robustness = sections.robustness_table(results)
    policies = sections.policies_table(results)
    return {
        "retargeting": sections.retargeting_tables(results),
        "tokenizer": sections.tokenizer_tables(results),
        "generation": sections.generation_tables(results),
        "transformer": table_one.transformer_table(generation) if generation else None,
        "linear": table_one.linear_table(generation) if generation else None,
        "matched": table_one.matched_table(generation) if generation else None,
        "realism": sections.realism_table(results) if generation else None,
        "tracking": sections.tracking_tables(results),
        "robustness": robustness if robustness.rows else None,
        "policies": policies if policies.rows else None,
    }


def drawings(results: Results) -> dict[str, Any]:
    """Returns the pictures of what results there are, by name; None of others.

    Raises:
        InputError: if a result is damaged.
    """
    generation = sections.of_robots(results, "generation")
    tracking = sections.of_robots(results, "tracking-generated")
    learning = {
        robot: figures
        for robot, figures in sections.of_robots(results, "learning").items()
        if figures.numbers("learning", "steps")
    }
    return {
        "confusions": {
            robot: pictures.confusion_picture(figures, "transformer")
            for robot, figures in generation.items()
            if figures.values.get("confusion") is not None
        },
        "returns": pictures.returns_picture(tracking) if tracking else None,
        "learning": pictures.learning_picture(learning) if learning else None,
    }
