"""``loco-drake export``: writes a policy as ONNX, a plan, and a robot as MJCF."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from loco_drake.cli.options import (
    SCHEDULE,
    Json,
    Output,
    Policy,
    Robot,
    option,
)
from loco_drake.cli.output import check_output, do_all, print_table, write_json
from loco_drake.common.errors import InputError, check_at_least
from loco_drake.motion.gaits import parse_schedule

if TYPE_CHECKING:
    from loco_drake.models.robots import Robot as RobotModel


@dataclass(kw_only=True)
class Export:
    """Write a policy, a plan for it and the robot's model for use without Drake.

    The policy is ONNX, from raw observations to actions, with metadata. With --plans or
    --mjcf a policy is written only with --onnx. The figures are its metadata. See
    docs/deploy.md.
    """

    robot: Robot = "go2"
    policy: Policy = None
    out: Annotated[
        Path | None,
        option(
            "ONNX file to write: the policy.",
            name="onnx",
            metavar="FILE",
            default="policy.onnx; with --plans or --mjcf none",
        ),
        Output.FILE,
    ] = None
    # NumPy file (.npz) to write: generated motion, re-timed within the joints' limits,
    # and the set-points that follow it.
    plans: Annotated[Path | None, option(metavar="FILE"), Output.FILE] = None
    gait: Annotated[
        str | None,
        option(f"{SCHEDULE}. Goes with --plans.", metavar="GAIT", default="dog-trot"),
    ] = None
    # Duration in s: of the plan, at most 600.
    duration: Annotated[float | None, option(default="10.0")] = None
    # MJCF file to write: bodies, limits, contacts and PD of the robot, for MuJoCo.
    mjcf: Annotated[Path | None, option(metavar="FILE"), Output.FILE] = None
    json: Json = None
    # Seed: of the plan's motion.
    seed: int = 0

    def run(self) -> int:
        """Writes and prints; returns the exit status."""
        from loco_drake.models.robots import get_robot

        robot = get_robot(self.robot)
        alone = self.plans is None and self.mjcf is None
        out = self.out or (Path("policy.onnx") if alone else None)
        self._check(out)
        if out is not None:
            self._write_policy(robot, out)
        if self.plans is not None:
            self._write_plan(robot, self.plans)
        if self.mjcf is not None:
            self._write_mjcf(robot, self.mjcf)
        return 0

    def _check(self, out: Path | None) -> None:
        """Raises InputError if an option is wrong."""
        for name, path, suffix in (
            ("onnx", out, ".onnx"),
            ("plans", self.plans, ".npz"),
            ("mjcf", self.mjcf, ".xml"),
        ):
            if path is not None and path.suffix != suffix:
                raise InputError(f"--{name} must end in {suffix}, not {str(path)!r}.")
        check_output(out)
        if self.plans is None and (self.gait, self.duration) != (None, None):
            raise InputError("--gait and --duration are of a plan: add --plans.")
        if self.plans is not None:
            self._check_plan()
        if out is None and (self.json or self.policy):
            raise InputError("--json and --policy are of a policy: add --onnx.")

    def _check_plan(self) -> None:
        from loco_drake.generation.generate import check_duration

        if self.gait is None:
            self.gait = "dog-trot"
        if self.duration is None:
            self.duration = 10.0
        check_duration(self.duration)
        parse_schedule(self.gait).check_ends_by(self.duration)
        check_at_least("seed", self.seed, 0)

    def _write_policy(self, robot: "RobotModel", out: Path) -> None:
        from loco_drake.control.actor_file import load_actor
        from loco_drake.models.shipped import policy_path
        from loco_drake.tracking.onnx_policy import export_onnx

        actor = load_actor(policy_path(robot, self.policy), robot)
        metadata = export_onnx(actor, robot, out)
        shown = [(name, metadata[name]) for name in ("robot", "labels", "rate")]
        size = f"{out.stat().st_size / 1e3:.0f} kB"
        do_all(
            lambda: print_table(
                str(out), ("of the policy", ""), [*shown, ("size", size)]
            ),
            lambda: write_json(self.json, metadata),
        )

    def _write_plan(self, robot: "RobotModel", path: Path) -> None:
        from loco_drake.control.plan_file import save_plan
        from loco_drake.systems.plan_recorder import PlanRecorder
        from loco_drake.systems.scenario import GeneratedReference, Scenario

        assert self.gait is not None
        assert self.duration is not None
        reference = GeneratedReference(
            gait=self.gait, seed=self.seed, duration=self.duration
        )
        scenario = Scenario(robot=robot.definition, reference=reference)
        plan = PlanRecorder(scenario).record(self.duration)
        save_plan(robot, plan, self.duration, path)
        rows = [
            ("robot", robot.name),
            ("gait", self.gait),
            ("seed", str(self.seed)),
            ("duration, s", f"{self.duration:g}"),
        ]
        print_table(str(path), ("of the plan", ""), rows)

    def _write_mjcf(self, robot: "RobotModel", path: Path) -> None:
        from loco_drake.common.files import atomic_path
        from loco_drake.models.mjcf import robot_mjcf

        with atomic_path(path) as temporary:
            temporary.write_text(robot_mjcf(robot))
        rows = [("robot", robot.name), ("joints", str(len(robot.joint_names)))]
        print_table(str(path), ("of the model", ""), rows)
