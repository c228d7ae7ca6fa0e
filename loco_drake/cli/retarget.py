"""The command ``retarget``."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from loco_drake.cli import output
from loco_drake.cli.options import (
    GAIT_CHOICES,
    SOURCES,
    DataDir,
    End,
    Fps,
    Json,
    Output,
    Start,
    WorkerOptions,
    option,
)
from loco_drake.cli.output import MARK, print_table
from loco_drake.common.errors import InputError, check_at_least
from loco_drake.motion.gaits import LABELS

if TYPE_CHECKING:
    from loco_drake.datasets.segments import Segment
    from loco_drake.datasets.split import Split
    from loco_drake.models.quadruped import Quadruped
    from loco_drake.retargeting.report import RetargetReport
    from loco_drake.retargeting.retarget import Outcome
    from loco_drake.retargeting.scaling import Variant


@dataclass(kw_only=True)
class Retarget(WorkerOptions):
    """Retarget recordings to a robot and write Motion files at 50 frames/s.

    With FILE, retargets one stretch of that recording, or the motion of another robot
    if it is a Motion file. Without, retargets every stretch in segments.csv of the data
    folder that has one of the fifteen gait labels, or those selected by --source and
    --gait. The provenance in each file assigns its recording to training or validation;
    --seed determines this split, by animal or file, for the whole data folder.
    Trajectories of 2 s that do not overlap are cut from the stretches and written to
    OUT-trajectories.
    """

    # A recording, which needs --source and --gait; or a Motion file (*.npz), which has
    # its own.
    file: Annotated[Path | None, tyro.conf.Positional, option(metavar="[FILE]")] = None
    source: Annotated[
        str | None,
        option(
            f"{SOURCES}; or a YAML file that names the joints of another animal's, see "
            "docs/own_animal.md.",
            metavar="SOURCE",
            default="all",
        ),
    ] = None
    gait: Annotated[
        tuple[str, ...],
        tyro.conf.UseAppendAction,
        option(
            f"Gait: {GAIT_CHOICES}, or one's own name of another; may be repeated.",
            metavar="GAIT",
            default="the gaits of the fifteen labels",
        ),
    ] = ()
    # Robot: go2, a1, or a YAML file that describes another robot, such as
    # examples/solo8.yaml; see docs/retargeting.md.
    robot: Annotated[str, option(metavar="ROBOT|FILE")] = "go2"
    start: Start = None
    end: End = None
    fps: Fps = None
    # Exchange left and right.
    mirror: bool = False
    # Scale time to keep the animal's Froude number, v^2 / (g h): a robot a quarter as
    # high as the animal moves in half the time.
    froude: bool = False
    # Make motion obey physics: move the trunk, by some mm and degrees, so that the
    # feet's forces can explain its motion. In flight it falls, on the ground friction
    # suffices. For robots that can be simulated.
    ground: bool = False
    # Folder to write to: the Motion files.
    out: Annotated[
        Path | None,
        option(
            metavar="DIR",
            default="motions/ROBOT, with the suffixes -mirrored and -froude and "
            "-grounded for these options",
        ),
        Output.FOLDER,
    ] = None
    # Number of trajectories of 2 s for each of the fifteen labels; at most, 0 for none.
    # With FILE, there are none.
    trajectories: int = 10
    # Number of steered variants of each stretch, besides itself: along other paths,
    # sideways, faster, slower and backwards, see docs/driving.md. Stretches that are
    # held out for validation have none.
    steer: Annotated[int, option(name="steered")] = 0
    data_dir: DataDir = None
    # Continue what is in --out: a run that was stopped, of which motions that it wrote
    # with the same options are kept.
    resume: bool = False
    # Exit with status 1 if a figure of a clip is outside its bounds.
    strict: bool = False
    json: Json = None
    # Seed: of the split and of the choice of trajectories.
    seed: int = 0

    def run(self) -> int:
        """Writes the files and prints the table; returns the exit status.

        It is 1 if a clip failed, or is outside its bounds with --strict, else 0.
        """
        from loco_drake.datasets.skeleton import load_source, loaded_files
        from loco_drake.models.robots import get_robot, load_robot
        from loco_drake.retargeting.journal import Journal, settings_of
        from loco_drake.retargeting.retarget import retarget_segments
        from loco_drake.retargeting.scaling import Variant

        robot = load_robot(self.robot)
        check_at_least("trajectories", self.trajectories, 0)
        executor = self.executor
        check_at_least("steered", self.steer, 0)
        if self.steer or self.ground:
            get_robot(self.robot)  # the file may be of one that is only retargeted to
        source = None if self.source is None else load_source(self.source)
        variant = Variant(mirror=self.mirror, froude=self.froude, ground=self.ground)
        out = self.out or Path("motions") / f"{robot.name}{variant.suffix}"
        output.check_output(out, folder=True)
        if self.file is not None and self.file.suffix == ".npz":
            outcome = self._of_motion(self.file, robot, variant, out)
            return self._tell(robot.definition, out, [outcome], None)
        segments, split = self._segments(source)
        settings = settings_of(robot, variant, loaded_files())
        journal = Journal(out, settings, split, resume=self.resume)
        done = retarget_segments(
            segments, robot, out, split, executor, variant, journal
        )
        outcomes: list[Outcome] = []
        statuses = []
        # A disk that is full by then keeps nothing from being told of what was done.
        output.do_all(
            lambda: outcomes.extend(output.tracked(done, "Retargeting", len(segments))),
            lambda: statuses.append(self._tell(robot.definition, out, outcomes, split)),
        )
        journal.end()
        return statuses[0]

    def _of_motion(
        self, file: Path, robot: "Quadruped", variant: "Variant", out: Path
    ) -> "Outcome":
        """Retargets the motion of another robot."""
        from loco_drake.datasets.segments import Segment
        from loco_drake.models.robots import ROBOTS, get_robot
        from loco_drake.motion.motion_file import load_motion, save_motion
        from loco_drake.retargeting.retarget import Outcome
        from loco_drake.retargeting.robot_clip import retarget_motion

        if (self.source, self.start, self.end, self.fps) != (None,) * 4 or self.gait:
            raise InputError(
                "--source, --gait, --start, --end and --fps are for recordings; a "
                "Motion file has its own."
            )
        if self.resume:
            raise InputError("--resume is for recordings; a Motion file takes seconds.")
        motion, path = load_motion(file), out / file.name
        if motion.robot not in ROBOTS:
            raise InputError(
                f"{file} is of {motion.robot}; motion of {' and '.join(ROBOTS)} can be "
                "retargeted to other robots."
            )
        if path.resolve() == file.resolve():
            raise InputError(f"{path} would be replaced; give another --out.")
        known = get_robot(motion.robot)
        made, report = retarget_motion(motion, known, robot, variant=variant)
        label = motion.label
        end = len(motion)
        segment = Segment(label.source, file, label.gait, 0, end, motion.fps)
        save_motion(made, path)
        return Outcome(segment, path, report, None)

    def _tell(
        self, robot: str, out: Path, outcomes: "list[Outcome]", split: "Split | None"
    ) -> int:
        """Prints and writes what came of the stretches; returns the exit status."""
        failed = [outcome for outcome in outcomes if outcome.error is not None]
        if self.file is not None and failed:
            raise InputError(str(failed[0].error))
        reports = {o.segment.name: o.report for o in outcomes if o.report is not None}
        doubtful = {name: r.warnings for name, r in reports.items() if r.warnings}
        columns = _COLUMNS | (_GROUNDED if self.ground else {})
        rows = [
            [k + MARK * (k in doubtful), *_cells(r, columns)]
            for k, r in reports.items()
        ]
        title = f"Motion files in {out}: {len(rows)}{', mirrored' * self.mirror}"
        figures = {o.segment.name: _figures(o) for o in outcomes}
        output.do_all(
            lambda: print_table(title, ["clip", *columns], rows),
            lambda: output.print_warnings(doubtful),
            lambda: output.write_json(self.json, figures),
            lambda: self._steer(robot, outcomes, split),
            lambda: self._cut(outcomes, split, out.parent / f"{out.name}-trajectories"),
            lambda: output.print_failed((o.segment.name, str(o.error)) for o in failed),
        )
        return 1 if failed or (self.strict and doubtful) else 0

    def _steer(
        self, robot: str, outcomes: "list[Outcome]", split: "Split | None"
    ) -> None:
        """Writes the steered variants."""
        from loco_drake.control.steered_motion import steered_motion
        from loco_drake.datasets.split import VALIDATION
        from loco_drake.models.robots import get_robot
        from loco_drake.motion.motion_file import load_motion, save_motion
        from loco_drake.retargeting.grounding import ground

        written = 0
        for number, outcome in enumerate(outcomes if self.steer else []):
            held_out = split is not None and split.side(outcome.segment) == VALIDATION
            if outcome.error is not None or held_out:
                continue
            motion = load_motion(outcome.path)
            for k in range(self.steer):
                seed = (self.seed, number, k)
                path = outcome.path.with_stem(f"{outcome.path.stem}-steered{k}")
                steered = steered_motion(get_robot(robot), motion, seed)
                if self.ground:
                    steered = ground(steered, get_robot(robot)).motion
                save_motion(steered, path)
                written += 1
        if self.steer:
            print(f"Steered variants: {written}.")

    def _cut(
        self, outcomes: "list[Outcome]", split: "Split | None", folder: Path
    ) -> None:
        """Writes the trajectories."""
        if split is None or not self.trajectories:
            return
        from loco_drake.datasets.split import TRAIN, VALIDATION
        from loco_drake.retargeting import trajectories
        from loco_drake.retargeting.retarget import stretches_of

        stretches = stretches_of(outcomes, split)
        windows = trajectories.choose_windows(stretches, self.trajectories, self.seed)
        trajectories.write_trajectories(windows, folder)
        counts = Counter((w.stretch.label, w.stretch.side) for w in windows)
        rows = [
            [str(label), *(str(counts[label, side]) for side in (TRAIN, VALIDATION))]
            for label in LABELS
            if label in {w.stretch.label for w in windows}
        ]
        title = (
            f"Trajectories of {trajectories.SECONDS:g} s in {folder}: {len(windows)}"
        )
        print_table(title, ["label", TRAIN, VALIDATION], rows)

    def _segments(self, source: str | None) -> "tuple[list[Segment], Split | None]":
        """Returns what to retarget, and the split of the data folder it is from."""
        from loco_drake.datasets import segments
        from loco_drake.datasets.registry import data_dir
        from loco_drake.datasets.split import Split

        if self.file is not None:
            return [self._segment_of_file(self.file, source)], None
        if (self.start, self.end, self.fps) != (None, None, None):
            raise InputError("--start, --end and --fps need a FILE.")
        table = segments.one_format(segments.read_segments(data_dir(self.data_dir)))
        split = Split(table, self.seed)
        return segments.select_segments(table, source, self.gait), split

    def _segment_of_file(self, file: Path, source: str | None) -> "Segment":
        from loco_drake.datasets.registry import read_clip
        from loco_drake.datasets.segments import Segment

        if source is None or len(self.gait) != 1:
            raise InputError("A FILE needs its --source and one --gait.")
        (gait,) = self.gait
        clip = read_clip(source, file, gait, self.start, self.end, self.fps)
        start, end = map(int, clip.provenance["frames"].split("-"))
        return Segment(source, file, gait, start, end, clip.fps)


def _figures(outcome: "Outcome") -> dict[str, object]:
    if outcome.report is None:
        return {"error": outcome.error}
    return {**outcome.report.figures, "path": str(outcome.path)}


# Title to key, factor and digits.
_COLUMNS = {
    "frames": ("frames", 1.0, 0),
    "time scale": ("time_scale", 1.0, 2),
    "frames/s": ("frames_per_second", 1.0, 0),
    "slip mm/s": ("stance_slip_median_mps", 1e3, 2),
    "sunk mm": ("penetration_max_m", 1e3, 2),
    "limits": ("joint_limit_violations", 1.0, 0),
    "speed ratio": ("joint_speed_ratio_max", 1.0, 2),
    "toe error mm": ("toe_error_rmse_m", 1e3, 2),
    "correction mm": ("correction_rmse_m", 1e3, 2),
}
_GROUNDED = {
    "off fall m/s2": ("free_fall_error_mps2", 1.0, 2),
    "momentum error": ("momentum_error", 1.0, 3),
    "toes moved mm": ("ground_correction_rmse_m", 1e3, 1),
    "joints moved rad": ("joint_correction_rmse_rad", 1.0, 3),
}


def _cells(
    report: "RetargetReport", columns: dict[str, tuple[str, float, int]]
) -> list[str]:
    figures = report.figures
    values = [(figures[key], by, n) for key, by, n in columns.values()]
    return ["-" if x is None else f"{x * by:.{digits}f}" for x, by, digits in values]
