"""The report on a retargeted clip."""

from dataclasses import asdict, dataclass
from typing import Any

from loco_drake.retargeting.grounding import GroundingReport


@dataclass(frozen=True)
class RetargetReport:
    """Quality of one retargeted clip, see :mod:`loco_drake.motion.quality`."""

    frames: int  # of the motion
    frames_per_second: float  # frames of the motion per second of computing
    toe_error_rmse_m: float  # of the toes against the targets that the solver was given
    correction_rmse_m: float  # of those targets against the paper's formula
    # Of the trunk's position against the paper's formula.
    trunk_correction_rmse_m: float
    stance_slip_median_mps: float | None  # None if no toe ever stands
    penetration_max_m: float  # deepest
    joint_limit_violations: int  # number of joint angles
    joint_speed_ratio_max: float  # highest speed over its limit
    scale: float  # the robot's stance height over the animal's
    time_scale: float  # how long the motion lasts, over the recording
    mirrored: bool  # whether left and right are exchanged
    # Share of the recording's frames in which the animal is on its feet; None where the
    # source's configuration says how high it stands.
    on_feet_share: float | None
    # Those frames, in the recording's numbers, such as "240-420".
    on_feet_frames: str | None
    # Median height of the recording's trunk over the stance height that the scale is
    # of.
    trunk_height_ratio: float
    # Share of the frames in which a toe is on its own side of the trunk, and a front
    # toe ahead of the rear one, of the worst toe.
    toes_in_place_share: float
    # How far left of the right toes the recording's left ones are.
    source_track_m: float
    unsolved_frames: int  # for which inverse kinematics found no solution
    # A sentence for each figure outside its bound, see bounds.
    warnings: tuple[str, ...] = ()
    grounding: GroundingReport | None = None  # None if the motion was not grounded

    @property
    def figures(self) -> dict[str, Any]:
        """The figures by name, those of grounding, if there are any, among them."""
        figures = asdict(self)
        return figures | (figures.pop("grounding") or {})
