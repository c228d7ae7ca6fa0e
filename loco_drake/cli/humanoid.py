"""The command ``humanoid``."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from loco_drake.cli import output
from loco_drake.cli.options import DataDir, Json, Output, UnusedSeed, option
from loco_drake.cli.output import MARK
from loco_drake.common.errors import InputError, check_at_least

if TYPE_CHECKING:
    from loco_drake.models.biped import Biped
    from loco_drake.retargeting.biped import BipedSolver
    from loco_drake.retargeting.scaling import Variant

# Title to key, factor and digits.
_COLUMNS = {
    "frames": ("frames", 1.0, 0),
    "on feet %": ("on_feet_share", 1e2, 0),
    "slip mm/s": ("stance_slip_median_mps", 1e3, 2),
    "sunk mm": ("penetration_max_m", 1e3, 2),
    "limits": ("joint_limit_violations", 1.0, 0),
    "margin rad": ("joint_limit_margin_rad", 1.0, 3),
    "speed ratio": ("joint_speed_ratio_max", 1.0, 2),
    "feet mm": ("toe_error_rmse_m", 1e3, 2),
    "arms mm": ("arm_error_rmse_m", 1e3, 1),
    "moved mm": ("correction_rmse_m", 1e3, 1),
    "pelvis mm": ("trunk_correction_rmse_m", 1e3, 1),
    "stride %": ("stride_period_error", 1e2, 1),
    "phase": ("phase_lag_error", 1.0, 3),
}


@dataclass(kw_only=True)
class Humanoid:
    """Retarget human clips to a humanoid and write Motion files at 50 frames/s.

    With FILE, retargets these clips of pybullet; their skeleton, humanoid.urdf, is
    found beside them. Without, retargets all that `data fetch --source human` fetched.
    """

    # Clips.
    files: Annotated[
        tuple[Path, ...], tyro.conf.Positional, option(metavar="[FILE ...]")
    ] = ()
    robot: Annotated[
        str,
        option(
            "Robot: g1, or a humanoid's YAML file, see docs/humanoid.md; go2 and a1 "
            "are for retarget.",
            metavar="ROBOT|FILE",
        ),
    ] = "g1"
    # Play clips that end as they begin so many times in a row.
    cycles: int = 1
    # Exchange left and right.
    mirror: bool = False
    # Scale time to keep the animal's Froude number, v^2 / (g h): here the person's.
    froude: bool = False
    # Folder to write to: the Motion files.
    out: Annotated[
        Path | None,
        option(
            metavar="DIR",
            default="motions/ROBOT, with the suffixes -mirrored and -froude for these "
            "options",
        ),
        Output.FOLDER,
    ] = None
    data_dir: DataDir = None
    # Exit with status 1 if a figure of a clip is outside its bounds.
    strict: bool = False
    json: Json = None
    seed: UnusedSeed = 0

    def run(self) -> int:
        """Writes the files and prints the table; returns the exit status.

        It is 1 if a clip failed, or is outside its bounds with --strict, else 0.
        """
        from loco_drake.models.biped_file import read_biped
        from loco_drake.motion.motion import FPS
        from loco_drake.retargeting.biped import BipedSolver
        from loco_drake.retargeting.scaling import Variant

        check_at_least("cycles", self.cycles, 1)
        robot = read_biped(self.robot)
        files = self.files or self._fetched()
        variant = Variant(mirror=self.mirror, froude=self.froude)
        out = self.out or Path("motions") / f"{robot.name}{variant.suffix}"
        output.check_output(out, folder=True)
        solver = BipedSolver(robot, FPS)
        done: dict[str, dict[str, Any]] = {}
        failed: dict[str, str] = {}
        for path in output.tracked(files, "Retargeting", len(files)):
            try:
                name, figures = self._retarget(path, robot, solver, variant, out)
                done[name] = figures
            except InputError as error:
                if self.files:
                    raise
                failed[path.stem] = str(error)
        doubtful = {k: v["warnings"] for k, v in done.items() if v["warnings"]}
        rows = [[k + MARK * (k in doubtful), *_cells(v)] for k, v in done.items()]
        told = {**done, **{name: {"error": text} for name, text in failed.items()}}
        output.do_all(
            lambda: output.print_table(
                f"Motion files in {out}: {len(rows)}", ["clip", *_COLUMNS], rows
            ),
            lambda: output.print_warnings(doubtful),
            lambda: output.write_json(self.json, told),
            lambda: output.print_failed(failed.items()),
        )
        return 1 if failed or (self.strict and doubtful) else 0

    def _retarget(
        self,
        path: Path,
        robot: "Biped",
        solver: "BipedSolver",
        variant: "Variant",
        out: Path,
    ) -> tuple[str, dict[str, Any]]:
        """Writes one Motion file; returns its name and figures."""
        from loco_drake.datasets.human import read_human
        from loco_drake.evaluation.humanoid import biped_fidelity
        from loco_drake.evaluation.retargeting import GaitFidelity
        from loco_drake.motion.motion_file import save_motion
        from loco_drake.retargeting.biped import retarget_biped
        from loco_drake.retargeting.scaling import in_time

        clip = read_human(path, cycles=self.cycles)
        motion, report = retarget_biped(clip, robot, solver=solver, variant=variant)
        clip = clip.mirrored() if self.mirror else clip
        clip = in_time(clip, report.time_scale)
        rhythm = biped_fidelity(clip, motion, robot)
        name = f"{motion.source}-{motion.gait}"
        save_motion(motion, out / f"{name}.npz")
        timing = (
            dict.fromkeys(GaitFidelity.__dataclass_fields__)
            if rhythm is None
            else asdict(rhythm)
        )
        return name, {**asdict(report), **timing, "path": str(out / f"{name}.npz")}

    def _fetched(self) -> list[Path]:
        """Returns the clips in the data folder.

        Raises:
            InputError: if there are none.
        """
        from loco_drake.datasets.human import FOLDER, PREFIX
        from loco_drake.datasets.registry import data_target

        folder = data_target(self.data_dir) / FOLDER
        clips = sorted(folder.glob(f"{PREFIX}*.txt"))
        if not clips:
            raise InputError(
                f"There are no human clips in {str(folder)!r}: loco-drake data fetch "
                "--source human fetches them, or name a FILE."
            )
        return clips


def _cells(figures: dict[str, Any]) -> list[str]:
    values = [(figures[key], by, digits) for key, by, digits in _COLUMNS.values()]
    return ["-" if x is None else f"{x * by:.{digits}f}" for x, by, digits in values]
