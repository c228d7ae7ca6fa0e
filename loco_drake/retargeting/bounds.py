"""Warnings where a figure of a retargeted clip is outside its bound in bounds.yaml."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pydrake.common.yaml import yaml_load

from loco_drake.common.errors import InputError
from loco_drake.models.legged import LeggedRobot
from loco_drake.motion.conventions import GROUND_MARGIN
from loco_drake.motion.motion import Motion

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

# Of one clip: a dataclass with a field ``warnings`` beside its figures.
Report = TypeVar("Report", bound="DataclassInstance")

_FILE = Path(__file__).with_suffix(".yaml")
_AT_LIMIT = 0.99  # share of a joint's highest speed from which on it is held back


@dataclass(frozen=True, kw_only=True)
class Bound:
    """The range of one figure of a :class:`.report.RetargetReport`."""

    name: str  # name of the figure in messages
    low: float = 0.0  # smallest value
    high: float = inf  # largest value; with stances, over the robot's stance height
    unit: str = ""  # unit in messages
    factor: float = 1.0  # from the figure to that unit
    # Largest value for robots with fewer than three joints per leg, whose toes follow
    # each lateral sway of the trunk.
    planar_high: float | None = None
    stances: bool = False  # whether lengths are relative to the robot's stance height


# By key of the report.
BOUNDS = {
    key: Bound(**fields) for key, fields in yaml_load(filename=str(_FILE)).items()
}


def outside_bounds(figures: Mapping[str, Any], robot: LeggedRobot) -> tuple[str, ...]:
    """Returns a sentence for each figure of the robot's motion outside its bound.

    Those of :data:`BOUNDS` that are missing in ``figures``, or None, are not judged.
    """
    planar = len(robot.joint_names) < 12
    found = []
    for key, bound in BOUNDS.items():
        value = figures.get(key)
        size = robot.stand_height if bound.stances else 1.0
        high = bound.planar_high if planar and bound.planar_high else bound.high
        if value is None or bound.low * size <= value <= high * size:
            continue
        shown, least, most = (
            f"{x * bound.factor:.3g}{bound.unit}"
            for x in (value, bound.low * size, high * size)
        )
        limits = f"{least} to {most}"
        if high == inf:
            limits = f"at least {least}"
        elif bound.low == 0:
            limits = f"at most {most}"
        if key == "on_feet_share" and "on_feet_frames" in figures:
            shown = f"{shown} ({figures['on_feet_frames']})"
        why = _reason(figures) if key == "toe_error_rmse_m" else ""
        found.append(f"{bound.name} {shown}, not {limits}{why}")
    return tuple(found)


def _reason(figures: Mapping[str, Any]) -> str:
    """Returns why toes are off their targets, as far as the figures tell."""
    if figures.get("joint_speed_ratio_max", 0.0) < _AT_LIMIT:
        return ""
    larger = figures.get("scale", 0.0) > 1 and figures.get("time_scale") == 1
    more = "; --froude gives a robot that is larger more time" if larger else ""
    return f": joints are as fast as they can be{more}"


def check_depth(figures: Mapping[str, Any], robot: LeggedRobot) -> None:
    """Raises InputError if feet are so deep in the ground that no Motion file may be.

    The reason is told as far as the figures tell it.
    """
    depth = figures["penetration_max_m"]
    if depth > GROUND_MARGIN * robot.stand_height:
        raise InputError(
            f"{robot.name} cannot follow: its feet would be {depth * 1000:.3g} mm in "
            f"the ground{_reason(figures)}."
        )


def judged(motion: Motion, report: Report, robot: LeggedRobot) -> tuple[Motion, Report]:
    """Returns a motion and the report on it, with sentences on what is out of bounds.

    The motion's provenance tells the report's main figures, and these sentences.

    Raises:
        InputError: see :func:`check_depth`.
    """
    check_depth(figures := asdict(report), robot)
    warnings = outside_bounds(figures, robot)
    kept = ("scale", "toe_error_rmse_m", "correction_rmse_m")
    told = {name: f"{figures[name]:.6g}" for name in kept}
    if warnings:
        told["warnings"] = "; ".join(warnings)
    motion = replace(motion, provenance={**motion.provenance, **told})
    return motion, replace(report, warnings=warnings)
