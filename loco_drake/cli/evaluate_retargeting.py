"""The command ``evaluate retargeting``."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress

from loco_drake.cli.output import (
    MARK,
    print_failed,
    print_figures,
    print_warnings,
    write_results,
)
from loco_drake.common.errors import check_at_least, check_choice


@dataclass(kw_only=True)
class EvaluateRetargeting:
    """Retarget the stretches in segments.csv and measure the result.

    Measures slip, penetration, joint limits, toe errors and gait timing, as defined in
    docs/retargeting.md. Writes no Motion files.
    """

    robot: str = "go2"
    """Robot: go2, a1, all (both), or a YAML file that describes another robot."""
    labels: tuple[str, ...] = ()
    """Gait labels, such as dog-trot dog-pace. Default: all in segments.csv."""
    mirror: bool = False
    """Exchange left and right."""
    froude: bool = False
    """Scale time to keep the animal's Froude number, as `retarget --froude` does."""
    data_dir: Path | None = None
    """Folder of the recordings. Default: $LOCO_DRAKE_DATA, else the user's cache
    folder."""
    workers: int = 1
    """Number of worker processes."""
    seeds: int = 1
    """Accepted by every evaluation; retargeting is deterministic."""
    seed: int = 0
    """Accepted by every command; this one uses no random numbers."""
    strict: bool = False
    """Exit with status 1 if a figure of a clip is outside its bounds."""
    json: Path | None = None
    """Write the figures to this JSON file."""

    def run(self) -> int:
        """Prints a table for each robot; returns the exit status.

        It is 1 if a clip failed, or is outside its bounds with --strict, else 0.

        Raises:
            InputError: if an option is wrong.
        """
        from loco_drake.datasets.registry import data_dir
        from loco_drake.datasets.segments import read_segments, select_labels
        from loco_drake.evaluation.retargeting import score_segments, summarize
        from loco_drake.models.robot_files import is_robot_file, load_robot
        from loco_drake.models.robots import ROBOTS
        from loco_drake.retargeting.scaling import Variant

        if not is_robot_file(self.robot):
            check_choice("robot", self.robot, (*ROBOTS, "all"))
        check_at_least("seeds", self.seeds, 1)
        check_at_least("workers", self.workers, 1)
        segments = select_labels(read_segments(data_dir(self.data_dir)), self.labels)
        definitions = ROBOTS if self.robot == "all" else (self.robot,)
        models = {robot.name: robot for robot in map(load_robot, definitions)}
        variant = Variant(mirror=self.mirror, froude=self.froude)
        robots: dict[str, Any] = {}
        with Progress(console=Console(stderr=True), transient=True) as progress:
            for name, robot in models.items():
                scores = score_segments(segments, robot, self.workers, variant)
                tracked = progress.track(
                    scores, total=len(segments), description=f"Retargeting to {name}"
                )
                robots[name] = summarize(list(tracked))
        write_results(self.json, {"robots": robots, **asdict(variant)})
        for name, result in robots.items():
            speed = result["frames_per_second"] or 0.0
            title = f"{name}: {speed:.0f} frames/s in one process"
            rows = {
                **result["labels"],
                "all of these": result["all"],
                **result["other"],
            }
            rows = {
                label + MARK * bool(row["clips_outside_bounds"]): row
                for label, row in rows.items()
            }
            print_figures(title, "label", _COLUMNS, rows)
            print_warnings(result["warnings"])
        failed = [
            item for result in robots.values() for item in result["failed"].items()
        ]
        print_failed(failed)
        doubtful = any(result["warnings"] for result in robots.values())
        return 1 if failed or (self.strict and doubtful) else 0


# Title: key, factor, digits.
_COLUMNS = {
    "clips": ("clips", 1, 0),
    "slip mm/s": ("stance_slip_median_mps", 1000, 2),
    "sunk mm": ("penetration_max_m", 1000, 2),
    "limits": ("joint_limit_violations", 1, 0),
    "speed ratio": ("joint_speed_ratio_max", 1, 2),
    "toe error mm": ("toe_error_rmse_m", 1000, 2),
    "correction mm": ("correction_rmse_m", 1000, 1),
    "period %": ("stride_period_error", 100, 2),
    "lag % of stride": ("phase_lag_error", 100, 2),
    "duty %": ("duty_factor_error", 100, 1),
}
