"""The command ``evaluate retargeting``."""

import time
from dataclasses import asdict, dataclass
from typing import Annotated, Any

from loco_drake.cli.evaluation import Evaluation, print_by_label
from loco_drake.cli.options import option, some_labels
from loco_drake.cli.output import MARK, print_failed, print_warnings, tracked
from loco_drake.common.errors import check_choice


@dataclass(kw_only=True)
class EvaluateRetargeting(Evaluation):
    """Retarget the stretches in segments.csv and measure the result.

    Measures slip, penetration, joint limits, toe errors and gait timing, as defined in
    docs/retargeting.md. Writes no Motion files.
    """

    # Robot: go2, a1, all (both), or a YAML file that describes another robot.
    robot: Annotated[str, option(metavar="ROBOT")] = "go2"
    labels: Annotated[tuple[str, ...], some_labels("all in segments.csv")] = ()
    # Exchange left and right.
    mirror: bool = False
    # Scale time to keep the animal's Froude number, v^2 / (g h): as `retarget --froude`
    # does.
    froude: bool = False
    # Make motion obey physics: as `retarget --ground` does.
    ground: bool = False
    # Exit with status 1 if a figure of a clip is outside its bounds.
    strict: bool = False

    def robots(self) -> list[str]:
        """Returns the names of the robots, or a robot's file."""
        from loco_drake.models.robot_files import is_robot_file

        return [self.robot] if is_robot_file(self.robot) else super().robots()

    def of_robots(self, names: list[str]) -> dict[str, Any]:
        """Returns the figures of all robots by name."""
        from loco_drake.datasets.registry import data_dir
        from loco_drake.datasets.segments import read_segments, select_labels
        from loco_drake.evaluation.retargeting import score_segments, summarize
        from loco_drake.models.robot_files import load_robot
        from loco_drake.models.robots import ROBOTS
        from loco_drake.retargeting.scaling import Variant

        segments = select_labels(read_segments(data_dir(self.data_dir)), self.labels)
        variant = Variant(mirror=self.mirror, froude=self.froude, ground=self.ground)
        robots = {}
        loaded = [load_robot(name) for name in names]
        if self.ground:
            for robot in loaded:
                check_choice("robot to ground", robot.name, ROBOTS)
        for robot in loaded:
            start = time.perf_counter()
            scores = score_segments(segments, robot, self.workers, variant)
            what = f"Retargeting to {robot.name}"
            figures = summarize(list(tracked(scores, what, len(segments))))
            figures["wall_clock_s"] = time.perf_counter() - start
            robots[robot.name] = figures
        return {"robots": robots, **asdict(variant)}

    def show(self, name: str, figures: dict[str, Any]) -> int:
        """Prints a table of all labels, and which clips failed or are doubtful.

        Returns:
            1 if a clip failed, or is outside its bounds with --strict, else 0.
        """
        speed = figures["frames_per_second"] or 0.0
        rows = {**figures["labels"], "all": figures["all"], **figures["other"]}
        marked = {
            label + MARK * bool(row["clips_outside_bounds"]): row
            for label, row in rows.items()
        }
        title = f"{name}: {speed:.0f} frames/s in one process"
        print_by_label(title, ["retargeting"], marked)
        print_warnings(figures["warnings"])
        print_failed(figures["failed"].items())
        return int(bool(figures["failed"] or (self.strict and figures["warnings"])))
