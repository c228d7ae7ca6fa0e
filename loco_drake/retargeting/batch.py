"""Retargeting of many recordings to Motion files, in parallel."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from loco_drake.common.errors import InputError
from loco_drake.common.parallel import map_in_workers
from loco_drake.datasets.segments import Segment
from loco_drake.datasets.split import Split
from loco_drake.models.quadruped import Quadruped
from loco_drake.models.robot_files import load_robot
from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.motion.motion import FPS, Motion
from loco_drake.motion.motion_file import save_motion
from loco_drake.retargeting.inverse_kinematics import LegSolver
from loco_drake.retargeting.retarget import RetargetReport, retarget_clip
from loco_drake.retargeting.scaling import AS_RECORDED, Variant
from loco_drake.retargeting.trajectories import Stretch


@dataclass(frozen=True)
class Outcome:
    """The result of retargeting one segment: a file and a report, or an error.

    Attributes:
        segment: the stretch of a recording.
        path: path of the Motion file, whether written or not.
        report: None on failure.
        error: reason of the failure as a sentence, else None.
    """

    segment: Segment
    path: Path
    report: RetargetReport | None
    error: str | None


class SegmentRetargeter:
    """Retargets segments one by one with one solver.

    Args:
        robot: to move.
        split: gives the side that goes into the provenance; None leaves it out.
        variant: what to change of the recordings.
    """

    def __init__(
        self,
        robot: Quadruped,
        split: Split | None = None,
        variant: Variant = AS_RECORDED,
    ) -> None:
        self.robot = robot
        self._split = split
        self._variant = variant
        self._solver = LegSolver(robot, FPS)

    def __call__(
        self, segment: Segment
    ) -> tuple[KeypointClip, Motion, RetargetReport] | str:
        """Returns clip, motion and report, or the sentence that says what failed.

        The clip is the variant, in the time of the motion, to compare the motion with.
        """
        try:
            clip = segment.read()
            if self._split is not None:
                side = {"split": self._split.side(segment)}
                clip = replace(clip, provenance={**clip.provenance, **side})
            motion, report = retarget_clip(
                clip, self.robot, solver=self._solver, variant=self._variant
            )
            return self._variant.apply(clip, report.scale), motion, report
        except InputError as error:
            return str(error)
        except (ArithmeticError, LookupError, RuntimeError, ValueError) as error:
            # A failure of a solver or table concerns this clip only.
            return f"{type(error).__name__}: {error}"


class _Writer:
    """Retargets and saves, see :func:`retarget_segments`."""

    def __init__(
        self, robot: str, out_dir: Path, split: Split | None, variant: Variant
    ) -> None:
        self._retarget = SegmentRetargeter(load_robot(robot), split, variant)
        self._out_dir = out_dir

    def __call__(self, segment: Segment) -> Outcome:
        path = self._out_dir / f"{segment.name}.npz"
        result = self._retarget(segment)
        if isinstance(result, str):
            return Outcome(segment, path, None, result)
        _, motion, report = result
        save_motion(motion, path)
        return Outcome(segment, path, report, None)


def retarget_segments(
    segments: Iterable[Segment],
    robot: Quadruped,
    out_dir: Path,
    split: Split | None = None,
    workers: int = 1,
    variant: Variant = AS_RECORDED,
) -> Iterator[Outcome]:
    """Retargets segments, and writes ``out_dir/SEGMENT.npz`` for each.

    A recording that cannot be read or retargeted is reported in its outcome and does
    not stop the others. A process has only one clip at a time in memory.

    Args:
        segments: from :func:`loco_drake.datasets.segments.read_segments`.
        robot: to move.
        out_dir: made if need be; files of the same name are replaced.
        split: gives the side that goes into the provenance; None leaves it out.
        workers: processes.
        variant: what to change of the recordings.

    Yields:
        One outcome for each segment, in their order, as soon as it is done.
    """
    make = partial(_Writer, robot.definition, Path(out_dir), split, variant)
    return map_in_workers(make, segments, workers)


def stretches_of(outcomes: Iterable[Outcome], split: Split) -> list[Stretch]:
    """Returns the retargeted stretches from which trajectories can be cut."""
    return [
        Stretch(
            path=outcome.path,
            label=GaitLabel(outcome.segment.source, outcome.segment.gait),
            recording=f"{outcome.segment.source}-{outcome.segment.recording}",
            subject=outcome.segment.subject,
            side=split.side(outcome.segment),
            start=outcome.segment.start / outcome.segment.fps,
            frames=outcome.report.frames,
            rate=FPS * outcome.report.time_scale,
        )
        for outcome in outcomes
        if outcome.report is not None
    ]
