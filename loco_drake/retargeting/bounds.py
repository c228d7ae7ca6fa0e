"""Bounds of the figures of a retargeted clip, outside which it should be inspected.

They come from the 347 stretches of dog, horse, MPC and Solo8 on Go2, A1 and the robot
of examples/solo8.yaml, all of which are inside. A bound is the worst of them with a
margin, or the requirement on all motion if that is wider.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

from loco_drake.models.quadruped import Quadruped


@dataclass(frozen=True)
class Bound:
    """The range of one figure of a :class:`.retarget.RetargetReport`."""

    name: str  # name of the figure in messages
    low: float  # smallest value
    high: float  # largest value; with stances, over the robot's stance height
    unit: str = ""  # unit in messages
    factor: float = 1.0  # from the figure to that unit
    # Largest value for robots with fewer than three joints per leg, whose toes follow
    # each lateral sway of the trunk.
    planar_high: float | None = None
    stances: bool = False  # whether lengths are relative to the robot's stance height


# By key of the report. Worst of the 347 stretches: see the comments.
BOUNDS = {
    # .18 (a horse to the robot of .31 m in the example) to 1.52 (the MPC's to the Go2).
    "scale": Bound("scale", 0.1, 3.0),
    # 1; a dog that sits or lies for a part is not all motion.
    "on_feet_share": Bound("frames on its feet", 0.95, inf, " %", 100),
    # .55 (Solo8's crawl) to 1.18 (its stilt): bodies of one size, whatever they do.
    "trunk_height_ratio": Bound("trunk height over stance height", 0.45, 1.35),
    # .954 (a dog that spins crosses its legs); a wild gallop crosses front and rear.
    "toes_in_place_share": Bound("toes in their place", 0.75, inf, " %", 100),
    # 7 mm, of a dog that turns: left and right toes are not exchanged.
    "source_track_m": Bound(
        "distance of the recording's left toes from its right ones", 0, inf, " mm", 1e3
    ),
    # .18 of the stance height (a dog that spins), .26 of planar legs.
    "correction_rmse_m": Bound("correction", 0, 0.2, " mm", 1e3, 0.3, stances=True),
    # .33 of the stance height: Solo8's wave lies lower than knees that point backward.
    "trunk_correction_rmse_m": Bound(
        "trunk correction", 0, 0.35, " mm", 1e3, stances=True
    ),
    # .2 mm.
    "toe_error_rmse_m": Bound("toe error", 0, 0.002, " mm", 1e3),
    # 1.4 mm/s; planar legs .47 m/s (a dog that spins).
    "stance_slip_median_mps": Bound("slip", 0, 0.03, " mm/s", 1e3, planar_high=0.6),
    # .013 mm.
    "penetration_max_m": Bound("depth in the ground", 0, 0.002, " mm", 1e3),
    "joint_limit_violations": Bound("angles beyond their limits", 0, 0),
    # .999: the solver keeps to the limit.
    "joint_speed_ratio_max": Bound("speed ratio", 0, 1.0),
    "unsolved_frames": Bound("frames without a solution", 0, 0),
}


def outside_bounds(figures: Mapping[str, Any], robot: Quadruped) -> tuple[str, ...]:
    """Returns a sentence for each figure outside its bound.

    Args:
        figures: by key of :data:`BOUNDS`; None is not judged.
        robot: whose motion it is.
    """
    planar = len(robot.joint_names) < 12
    found = []
    for key, bound in BOUNDS.items():
        value = figures[key]
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
        if key == "on_feet_share":
            shown = f"{shown} ({figures['on_feet_frames']})"
        found.append(f"{bound.name} {shown}, not {limits}")
    return tuple(found)
