"""The command ``record``."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from loco_drake.cli import output
from loco_drake.cli.options import Json, Motions, OutFolder, Policy, Robot
from loco_drake.common.errors import (
    check_at_least,
    check_bounds,
)

if TYPE_CHECKING:
    from loco_drake.control.actor import Actor
    from loco_drake.models.robots import Robot as RobotModel
    from loco_drake.motion.motion import Motion
    from loco_drake.retargeting.inverse_kinematics import LegSolver


@dataclass(kw_only=True)
class Record:
    """Let a policy track Motion files in simulation and write what the robot did.

    What is written obeys physics, so it is easier to track, and better to learn from,
    than the motion that it was made of. Motions that the policy loses or tracks badly
    are left out.
    """

    # Folder of Motion files: those to track.
    references: Motions
    robot: Robot = "go2"
    policy: Policy = None
    # Folder to write to: the Motion files, named like those tracked.
    out: OutFolder = Path("motions/recorded")
    # Number of attempts at each motion, of which the best is written.
    attempts: int = 4
    # Normalized return of 100 below which a motion is left out.
    least_return: float = 75.0
    # Make motion obey physics: move the trunk afterwards as `retarget --ground` does.
    # The planned contacts are kept, which a robot in simulation only nearly follows.
    ground: bool = True
    json: Json = None
    # Seed: of the attempts.
    seed: int = 0

    def run(self) -> int:
        """Writes the files and prints the table; returns 0, or 1 if there are none."""
        from loco_drake.common.determinism import single_thread
        from loco_drake.control.actor_file import load_actor
        from loco_drake.models.robots import get_robot
        from loco_drake.models.shipped import policy_path
        from loco_drake.motion.motion import FPS
        from loco_drake.retargeting.inverse_kinematics import LegSolver
        from loco_drake.tracking.references import read_motions

        check_at_least("attempts", self.attempts, 1)
        check_at_least("seed", self.seed, 0)
        check_bounds("--least-return", self.least_return, 0, 100)
        robot = get_robot(self.robot)
        motions = read_motions(robot, self.references)
        actor = load_actor(policy_path(robot, self.policy), robot)
        solver = LegSolver(robot, FPS)
        figures: dict[str, dict[str, Any]] = {}

        def work() -> None:
            with single_thread():
                for path in output.tracked(motions, "Recording", len(motions)):
                    motion = motions[path]
                    figures[path.stem] = self._one(path, motion, robot, actor, solver)

        output.do_all(
            work,
            lambda: self._show(figures, len(motions)),
            lambda: output.write_json(self.json, figures),
        )
        return 0 if any(f["written"] for f in figures.values()) else 1

    def _show(self, figures: dict[str, dict[str, Any]], total: int) -> None:
        rows = [
            [k, f"{f['normalized_return']:.1f}", f"{f['momentum_error']:.3f}"]
            for k, f in figures.items()
            if f["written"]
        ]
        title = f"Motion files in {self.out}: {len(rows)} of {total}"
        output.print_table(title, ["motion", "return", "momentum error"], rows)

    def _one(
        self,
        path: Path,
        motion: "Motion",
        robot: "RobotModel",
        actor: "Actor",
        solver: "LegSolver",
    ) -> dict[str, Any]:
        """Records one motion; returns its figures."""
        from loco_drake.motion.momentum import momentum_error
        from loco_drake.motion.motion_file import save_motion
        from loco_drake.retargeting.grounding import ground
        from loco_drake.tracking.recording import record

        done = record(
            robot,
            actor,
            motion,
            attempts=self.attempts,
            seed=self.seed,
            solver=solver,
        )
        score = None if done is None else done.normalized_return
        if done is None or done.normalized_return < self.least_return:
            return {"written": False, "normalized_return": score}
        kept = {"recorded": f"return {score:.1f} of 100"}
        made = replace(done.motion, provenance={**done.motion.provenance, **kept})
        if self.ground:
            made, report, _ = ground(made, robot, solver)
            told = asdict(report)
        else:
            told = {"momentum_error": momentum_error(made, robot)}
        save_motion(made, self.out / path.name)
        return {"written": True, "normalized_return": score, **told}
