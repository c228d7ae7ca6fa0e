"""``loco-drake export``: writes a policy as an ONNX file."""

from dataclasses import dataclass
from pathlib import Path

from loco_drake.cli.options import Policy, UnusedSeed
from loco_drake.cli.output import print_table, write_json
from loco_drake.common.errors import InputError


@dataclass(kw_only=True)
class Export:
    """Write a policy as ONNX, from raw observations to actions, with metadata."""

    # Robot: go2 or a1.
    robot: str = "go2"
    policy: Policy = None
    # ONNX file to write.
    out: Path = Path("policy.onnx")
    # Write the metadata to this JSON file.
    json: Path | None = None
    seed: UnusedSeed = 0

    def run(self) -> int:
        """Writes and prints; returns the exit status."""
        from loco_drake.control.actor import load_actor
        from loco_drake.models.robots import get_robot
        from loco_drake.models.shipped import policy_path
        from loco_drake.tracking.onnx_policy import export_onnx

        robot = get_robot(self.robot)
        if self.out.suffix != ".onnx":
            raise InputError(f"--out must end in .onnx, not {str(self.out)!r}.")
        actor = load_actor(policy_path(robot, self.policy), robot)
        metadata = export_onnx(actor, robot, self.out)
        write_json(self.json, metadata)
        shown = [(name, metadata[name]) for name in ("robot", "labels", "rate")]
        size = f"{self.out.stat().st_size / 1e3:.0f} kB"
        print_table(str(self.out), ("of the policy", ""), [*shown, ("size", size)])
        return 0
