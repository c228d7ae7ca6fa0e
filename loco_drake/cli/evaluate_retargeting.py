"""The command ``evaluate retargeting``."""

import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from loco_drake.cli.evaluation import Evaluation, print_by_label
from loco_drake.cli.options import Figures, option, some_labels
from loco_drake.cli.output import (
    MARK,
    print_failed,
    print_warnings,
    say,
    tracked,
    write_figure,
)
from loco_drake.common.errors import InputError

if TYPE_CHECKING:
    from loco_drake.datasets.segments import Segment
    from loco_drake.models.quadruped import Quadruped
    from loco_drake.retargeting.scaling import Variant


@dataclass(kw_only=True)
class EvaluateRetargeting(Evaluation):
    """Retarget the stretches in segments.csv and measure the result.

    Measures slip, penetration, joint limits, toe errors and gait timing, as defined in
    docs/retargeting.md. Writes no Motion files.
    """

    # Robot: go2, a1, all (both), or a YAML file that describes another robot.
    robot: Annotated[str, option(metavar="ROBOT|FILE")] = "go2"
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
    # Folder for pictures: of each label the robots with the recording's keypoints, and
    # of each robot the library of its motion.
    figures: Figures = None

    def check(self) -> None:
        """Raises InputError if an option is wrong, OSError if it cannot draw."""
        super().check()
        if self.figures is not None:
            from loco_drake.viewing.rendering import make_engine

            make_engine()

    def robots(self) -> list[str]:
        """Returns the names of the robots, or a robot's file."""
        from loco_drake.models.robot_files import is_robot_file

        return [self.robot] if is_robot_file(self.robot) else super().robots()

    @property
    def _variant(self) -> "Variant":
        from loco_drake.retargeting.scaling import Variant

        return Variant(mirror=self.mirror, froude=self.froude, ground=self.ground)

    def _segments(self) -> "tuple[list[Segment], list[Segment]]":
        """Returns all segments of the data folder, and those of the labels."""
        from loco_drake.datasets.registry import data_dir
        from loco_drake.datasets.segments import read_segments, select_labels

        every = read_segments(data_dir(self.data_dir))
        return every, select_labels(every, self.labels)

    def of_robots(self, names: list[str]) -> dict[str, Any]:
        """Returns the figures of all robots by name."""
        from loco_drake.datasets.split import Split
        from loco_drake.evaluation.retargeting import score_segments, summarize
        from loco_drake.models.robots import get_robot, load_robot

        every, segments = self._segments()
        split, variant = Split(every), self._variant
        robots = {}
        loaded = [load_robot(name) for name in names]
        if self.ground:
            for robot in loaded:
                get_robot(robot.definition)
        for robot in loaded:
            start = time.perf_counter()
            scores = score_segments(segments, robot, self.executor, variant, split)
            what = f"Retargeting to {robot.name}"
            figures = summarize(list(tracked(scores, what, len(segments))))
            figures["wall_clock_s"] = time.perf_counter() - start
            robots[robot.name] = figures
        return {"robots": robots, **asdict(variant)}

    def draw(self, name: str, figures: dict[str, Any]) -> None:
        """Writes a picture of a robot's library; with the last robot those of all."""
        from loco_drake.evaluation.dataset_picture import library_figure
        from loco_drake.evaluation.library import read_library
        from loco_drake.evaluation.report.figures import Figures
        from loco_drake.models.robots import load_robot

        if self.figures is None:
            return
        if figures["library"] is not None:
            library = read_library(Figures(figures))
            write_figure(library_figure(library), self.figures / f"{name}-library.png")
        robots = [load_robot(definition) for definition in self.robots()]
        if name == robots[-1].name:
            self._draw_poses(self.figures, robots)

    def _draw_poses(self, folder: Path, robots: "list[Quadruped]") -> None:
        """Writes the robots' poses: of each label the first stretch that all can do."""
        from loco_drake.evaluation.report.tables import robot_title
        from loco_drake.viewing.poses import poses_figure

        rows = robots[::-1]  # the A1 above the Go2, as in the paper
        names = [robot_title(robot.name) for robot in rows]
        _, segments = self._segments()
        drawn: set[str] = set()
        for segment in tracked(segments, "Drawing", len(segments)):
            if segment.label in drawn:
                continue
            try:
                figure = poses_figure(segment, rows, names, self._variant)
            except InputError as error:
                say(f"{segment.name} is not drawn: {error}")
                continue
            write_figure(figure, folder / f"retargeted-{segment.label}.webp", dpi=100)
            drawn.add(segment.label)

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
