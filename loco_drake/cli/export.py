"""``loco-drake export``: writes a policy as ONNX, and a robot as MJCF."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from loco_drake.cli.options import Policy, UnusedSeed, option
from loco_drake.cli.output import print_table, write_json
from loco_drake.common.errors import InputError

if TYPE_CHECKING:
    from loco_drake.models.robots import Robot


@dataclass(kw_only=True)
class Export:
    """Write a policy as ONNX, from raw observations to actions, with metadata.

    With --mjcf, write the robot's model for MuJoCo, and a policy only with --out.
    """

    # Robot: go2 or a1.
    robot: str = "go2"
    policy: Policy = None
    out: Annotated[
        Path | None,
        option("ONNX file to write.", default="policy.onnx; with --mjcf none"),
    ] = None
    # MJCF file to write: bodies, limits, contacts and PD of the robot, for MuJoCo.
    mjcf: Path | None = None
    # Write the policy's metadata to this JSON file.
    json: Path | None = None
    seed: UnusedSeed = 0

    def run(self) -> int:
        """Writes and prints; returns the exit status."""
        from loco_drake.models.robots import get_robot

        robot = get_robot(self.robot)
        out = self.out or (None if self.mjcf else Path("policy.onnx"))
        for name, path, suffix in (("out", out, ".onnx"), ("mjcf", self.mjcf, ".xml")):
            if path is not None and path.suffix != suffix:
                raise InputError(f"--{name} must end in {suffix}, not {str(path)!r}.")
        if out is None and (self.json or self.policy):
            raise InputError("--json and --policy are of a policy: add --out.")
        if out is not None:
            self._write_policy(robot, out)
        if self.mjcf is not None:
            self._write_mjcf(robot, self.mjcf)
        return 0

    def _write_policy(self, robot: "Robot", out: Path) -> None:
        from loco_drake.control.actor import load_actor
        from loco_drake.models.shipped import policy_path
        from loco_drake.tracking.onnx_policy import export_onnx

        actor = load_actor(policy_path(robot, self.policy), robot)
        metadata = export_onnx(actor, robot, out)
        write_json(self.json, metadata)
        shown = [(name, metadata[name]) for name in ("robot", "labels", "rate")]
        size = f"{out.stat().st_size / 1e3:.0f} kB"
        print_table(str(out), ("of the policy", ""), [*shown, ("size", size)])

    def _write_mjcf(self, robot: "Robot", path: Path) -> None:
        from loco_drake.common.files import atomic_path
        from loco_drake.models.mjcf import robot_mjcf

        with atomic_path(path) as temporary:
            temporary.write_text(robot_mjcf(robot))
        rows = [("robot", robot.name), ("joints", str(len(robot.joint_names)))]
        print_table(str(path), ("of the model", ""), rows)
