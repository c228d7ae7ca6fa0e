"""Many recordings -> many Motion files."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from loco_drake.datasets.segments import Segment
from loco_drake.errors import InputError
from loco_drake.models.robots import Robot
from loco_drake.motion import FPS, save_motion
from loco_drake.retargeting.inverse_kinematics import LegSolver
from loco_drake.retargeting.retarget import RetargetReport, retarget_clip


@dataclass(frozen=True)
class Outcome:
    """What became of one segment: a file and a report, or an error.

    Attributes:
        segment: the stretch of a recording.
        path: of the Motion file, whether written or not.
        report: None if it failed.
        error: why it failed, one sentence; None if it did not.
    """

    segment: Segment
    path: Path
    report: RetargetReport | None
    error: str | None


def retarget_segments(
    segments: Iterable[Segment], robot: Robot, out_dir: Path
) -> Iterator[Outcome]:
    """Retargets segments one by one, and writes ``out_dir/SEGMENT.npz`` for each.

    A recording that cannot be read or retargeted is reported in its outcome and does
    not stop the others. Only one clip is in memory at a time.

    Args:
        segments: from :func:`loco_drake.datasets.segments.read_segments`.
        robot: to move.
        out_dir: made if need be; files of the same name are replaced.

    Yields:
        One outcome for each segment, as soon as it is done.
    """
    solver = LegSolver(robot, FPS)
    for segment in segments:
        path = Path(out_dir) / f"{segment.name}.npz"
        try:
            motion, report = retarget_clip(segment.read(), robot, solver=solver)
        except InputError as error:
            yield Outcome(segment, path, None, str(error))
        else:
            save_motion(motion, path)
            yield Outcome(segment, path, report, None)
