"""Retargeting of recordings to motions of a robot: one, or many in worker processes."""

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from loco_drake.common.arrays import Bools
from loco_drake.common.errors import InputError
from loco_drake.datasets.segments import Segment
from loco_drake.datasets.skeleton import load_sources, loaded_files
from loco_drake.datasets.split import Split
from loco_drake.engine.executor import Executor
from loco_drake.engine.local import LOCAL
from loco_drake.models.legs import MIRROR_LEGS
from loco_drake.models.quadruped import Quadruped
from loco_drake.models.robots import get_robot, load_robot
from loco_drake.motion import quality
from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.motion.motion import FPS, Motion, make_motion
from loco_drake.motion.motion_file import motion_bytes, write_motion
from loco_drake.retargeting.bounds import judged
from loco_drake.retargeting.contacts import (
    frames_on_feet,
    on_feet,
    stance_height,
    track_width,
)
from loco_drake.retargeting.correction import correct
from loco_drake.retargeting.grounding import ground
from loco_drake.retargeting.inverse_kinematics import LegSolver
from loco_drake.retargeting.journal import Journal
from loco_drake.retargeting.preparation import prepare
from loco_drake.retargeting.report import RetargetReport
from loco_drake.retargeting.scaling import (
    AS_RECORDED,
    RetargetConfig,
    Variant,
    load_config,
    resample,
    scale_to_robot,
    smoothing_in_time,
)
from loco_drake.retargeting.trajectories import Stretch


def retarget_clip(
    clip: KeypointClip,
    robot: Quadruped,
    *,
    config: RetargetConfig | None = None,
    solver: LegSolver | None = None,
    variant: Variant = AS_RECORDED,
    contacts: Bools | None = None,
) -> tuple[Motion, RetargetReport]:
    """Returns ``clip`` as a motion of ``robot`` at 50 Hz, and a report on its quality.

    ``config`` is that of the clip's source by default; a ``solver`` of the robot can be
    used again for many clips. ``contacts`` of the clip's feet, (T, 4), are detected
    unless they are known.

    Raises:
        InputError: if the clip is too short or not of an animal on its feet.
    """
    began = time.perf_counter()
    config = config or load_config(clip.source)
    solver = solver or LegSolver(robot, FPS)
    clip = clip.mirrored() if variant.mirror else clip
    if contacts is not None and variant.mirror:
        contacts = contacts[:, MIRROR_LEGS]
    height = stance_height(clip, config)
    ready = prepare(
        clip, height, robot.stand_height, config, variant, resample, contacts
    )
    formula = scale_to_robot(ready.clip, height, robot, config)
    smoothing = smoothing_in_time(config, ready.time_scale)
    targets = correct(formula, ready.contacts, robot, smoothing)
    joints, solved = solver.solve(targets.p_BF)
    motion = make_motion(
        robot=robot.name,
        label=GaitLabel(clip.source, clip.gait),
        joint_names=robot.joint_names,
        base_position=targets.p_WB,
        base_quaternion=targets.q_WB,
        joint_positions=joints,
        contacts=ready.contacts,
        provenance=ready.clip.provenance,
    )
    grounding = None
    if variant.ground:
        motion, grounding, solved = ground(motion, get_robot(robot.definition), solver)
    seconds = time.perf_counter() - began
    p_WF = quality.toe_trajectories(motion, robot)
    standing = None if config.stance_height is not None else on_feet(clip)
    report = RetargetReport(
        frames=len(motion),
        frames_per_second=len(motion) / seconds,
        toe_error_rmse_m=quality.distance_rmse(p_WF, targets.p_WF),
        correction_rmse_m=quality.distance_rmse(targets.p_WF, formula.p_WF),
        trunk_correction_rmse_m=quality.distance_rmse(
            motion.base_position, formula.p_WB
        ),
        stance_slip_median_mps=quality.stance_slip_median(p_WF, robot.foot_radius, FPS),
        penetration_max_m=quality.penetration_max(p_WF, robot.foot_radius),
        joint_limit_violations=quality.joint_limit_violations(
            motion.joint_positions, robot
        ),
        joint_speed_ratio_max=quality.joint_speed_ratio_max(
            motion.joint_positions, robot, FPS
        ),
        scale=ready.scale,
        time_scale=ready.time_scale,
        mirrored=variant.mirror,
        on_feet_share=None if standing is None else float(standing.mean()),
        on_feet_frames=None if standing is None else frames_on_feet(clip, standing),
        trunk_height_ratio=float(np.median(clip.middle[:, 2]) / height),
        toes_in_place_share=quality.toes_in_place_share(motion.joint_positions, robot),
        source_track_m=track_width(clip),
        unsolved_frames=int((~solved).sum()),
        grounding=grounding,
    )
    return judged(motion, report, robot)


@dataclass(frozen=True)
class Outcome:
    """The result of retargeting one segment: a file and a report, or an error."""

    segment: Segment  # the stretch of a recording
    path: Path  # path of the Motion file, whether written or not
    report: RetargetReport | None  # None on failure
    error: str | None  # reason of the failure as a sentence, else None


class SegmentRetargeter:
    """Retargets segments one by one with one solver.

    The provenance says on which side of ``split`` they are, unless it is None.
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


def retarget_segments(
    segments: Iterable[Segment],
    robot: Quadruped,
    out_dir: Path,
    split: Split | None = None,
    executor: Executor = LOCAL,
    variant: Variant = AS_RECORDED,
    journal: Journal | None = None,
) -> Iterator[Outcome]:
    """Retargets segments, and writes ``out_dir/SEGMENT.npz`` for each.

    The folder is made if need be, and files of the same name are replaced. A recording
    that cannot be read or retargeted is reported in its outcome and does not stop the
    others. Each worker has only one clip at a time in memory; this process writes the
    files. Motions that ``journal`` finds are kept as they are; it notes the others.

    Yields:
        One outcome for each segment, in their order, as soon as it is done.
    """
    segments = list(segments)
    paths = [Path(out_dir) / f"{segment.name}.npz" for segment in segments]
    kept = [
        None if journal is None else journal.find(segment, path)
        for segment, path in zip(segments, paths, strict=True)
    ]
    make = partial(_Encoder, robot.definition, split, variant, loaded_files())
    missing = [s for s, report in zip(segments, kept, strict=True) if report is None]
    done = executor.map(make, missing)
    for segment, path, report in zip(segments, paths, kept, strict=True):
        if report is not None:
            yield Outcome(segment, path, report, None)
            continue
        result = next(done)
        if isinstance(result, str):
            yield Outcome(segment, path, None, result)
            continue
        content, made = result
        write_motion(content, path)
        if journal is not None:
            journal.note(segment, path, made)
        yield Outcome(segment, path, made, None)


class _Encoder:
    """Retargets segments, given a robot's definition, to the content of files."""

    def __init__(
        self,
        robot: str,
        split: Split | None,
        variant: Variant,
        skeletons: tuple[Path, ...],
    ) -> None:
        load_sources(skeletons)
        self._retarget = SegmentRetargeter(load_robot(robot), split, variant)

    def __call__(self, segment: Segment) -> tuple[bytes, RetargetReport] | str:
        result = self._retarget(segment)
        if isinstance(result, str):
            return result
        _, motion, report = result
        return motion_bytes(motion), report


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
