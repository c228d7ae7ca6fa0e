"""``loco-drake simulate``: a robot does a gait, in physics."""

import sys
import time
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from loco_drake.cli.output import print_table, write_json
from loco_drake.common.errors import InputError
from loco_drake.common.files import atomic_path
from loco_drake.motion.gait_schedule import parse_schedule
from loco_drake.motion.motion import Motion
from loco_drake.motion.motion_file import load_motion

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

    from loco_drake.systems.scenario import Scenario

_MAX_DURATION = 3600.0


@dataclass(kw_only=True)
class Simulate:
    """Simulate a robot that does a gait, written by the generator, in Drake."""

    robot: str = "go2"
    """Robot: go2 or a1."""
    gait: str = "dog-trot"
    """Gait label, source-gait, such as dog-trot; or several, the later ones with the
    time in s at which they begin: dog-pace,dog-trot@3. Ignored with a Motion file."""
    duration: float = 10.0
    """Seconds to simulate; of a Motion file at most its length."""
    seed: int = 0
    """What the motion is drawn with."""
    reference: str = "gpt"
    """gpt: written by the generator while the simulation runs; or a Motion file."""
    policy: Path | None = None
    """Weights of the policy, or the name of another shipped one, such as randomized;
    default: the robot's main one."""
    meshcat: bool = True
    """Show the simulation live in the browser, in real time at best."""
    port: int | None = None
    """Port of Meshcat; default, or if it is in use: a free one."""
    html: Path | None = None
    """Save the replay as one HTML page."""
    contact: str = "similar"
    """Contact solver: similar, lagged, sap or cenic."""
    time_step: float = 0.01
    """Step of the physics, s."""
    friction: float = 0.8
    """Friction of the ground."""
    json: Annotated[Path | None, tyro.conf.arg(metavar="PATH")] = None
    """Write the figures to a file."""

    def run(self) -> int:
        """Simulates, prints and writes; returns the exit status."""
        from loco_drake.control.plan import PLAN_DT
        from loco_drake.evaluation.replay import FRAMES_PER_SECOND, frame
        from loco_drake.evaluation.rollout import Recorder
        from loco_drake.evaluation.tracking import tracking_metrics

        motion = self._check()
        meshcat = self._start_meshcat()
        scenario = self._scenario(visual=meshcat is not None)
        recorder = Recorder(scenario, meshcat)
        recorder.start()
        if meshcat is not None:
            meshcat.StartRecording(frames_per_second=FRAMES_PER_SECOND)
        duration = self.duration
        if motion is not None:
            duration = min(duration, motion.duration)
        # The first evaluation of the networks sets up torch.
        recorder.diagram.GetOutputPort("action").Eval(recorder.context)
        start = time.perf_counter()

        def pace(now: float) -> None:
            ahead = now - (time.perf_counter() - start)
            if self.meshcat and ahead > 0:
                time.sleep(ahead)

        rollout, wall = recorder.run(duration, pace)
        simulated = (len(rollout.state) - 1) * PLAN_DT
        figures = {
            "robot": self.robot,
            "gait": self.gait if motion is None else str(motion.label),
            "seed": self.seed,
            "duration_s": duration,
            "simulated_s": simulated,
            "fell": rollout.fell,
            **tracking_metrics(rollout),
            "real_time_factor": simulated / wall,
        }
        if meshcat is not None:
            meshcat.StopRecording()
            meshcat.PublishRecording()
            frame(meshcat, rollout.state[:, 4:7])
            if self.html is not None:
                with atomic_path(self.html) as temporary:
                    temporary.write_text(meshcat.StaticHtml())
        _print(figures)
        write_json(self.json, figures)
        return 0

    def _check(self) -> Motion | None:
        """Returns the Motion file to follow, if any; raises InputError if amiss."""
        from loco_drake.control.plan import PLAN_DT
        from loco_drake.models.robots import get_robot

        get_robot(self.robot)
        if not (isfinite(self.duration) and 0 < self.duration <= _MAX_DURATION):
            raise InputError(
                f"The duration must be above 0 s and at most {_MAX_DURATION:g} s, "
                f"not {self.duration}."
            )
        if self.duration < PLAN_DT:
            raise InputError(f"The duration must be at least {PLAN_DT} s.")
        if self.reference == "gpt":
            parse_schedule(self.gait).check_ends_by(self.duration)
            return None
        if not Path(self.reference).is_file():
            raise InputError(
                f"The reference must be gpt or a Motion file, and there is no file "
                f"{self.reference!r}."
            )
        motion = load_motion(Path(self.reference))
        if motion.robot != self.robot:
            raise InputError(
                f"{self.reference} is a motion of {motion.robot}, not of {self.robot}."
            )
        return motion

    def _scenario(self, *, visual: bool) -> "Scenario":
        from loco_drake.models.plant import PlantConfig
        from loco_drake.systems.scenario import (
            GeneratedReference,
            MotionReference,
            Scenario,
            TrainedPolicy,
        )

        reference: GeneratedReference | MotionReference
        if self.reference == "gpt":
            reference = GeneratedReference(
                gait=self.gait, seed=self.seed, duration=self.duration
            )
        else:
            reference = MotionReference(path=Path(self.reference))
        return Scenario(
            robot=self.robot,
            plant=PlantConfig(
                contact=self.contact,
                time_step=self.time_step,
                friction=self.friction,
                visual=visual,
            ),
            reference=reference,
            policy=TrainedPolicy(weights=self.policy),
        )

    def _start_meshcat(self) -> "Meshcat | None":
        from loco_drake.evaluation.replay import dress

        if not self.meshcat and self.html is None:
            return None
        meshcat = _open_meshcat(self.port)
        dress(meshcat)
        if self.meshcat:
            print(f"Meshcat: {meshcat.web_url()}", flush=True)
        return meshcat


def _open_meshcat(port: int | None) -> "Meshcat":
    """Returns a Meshcat at ``port``, or at a free one if that is in use."""
    from pydrake.geometry import Meshcat, MeshcatParams

    if port is None:
        return Meshcat()
    if not (1024 <= port <= 65535):
        raise InputError(f"The port must be from 1024 to 65535, not {port}.")
    try:
        return Meshcat(MeshcatParams(port=port))
    except RuntimeError:
        print(f"Port {port} is in use; Meshcat takes a free one.", file=sys.stderr)
        return Meshcat()


def _print(figures: dict[str, object]) -> None:
    units = {
        "normalized_return": "of 100",
        "joint_rmse_rad": "rad",
        "base_position_rmse_m": "m",
        "base_orientation_rmse_rad": "rad",
        "speed_mps": "m/s",
        "duration_s": "s",
        "simulated_s": "s",
    }
    rows = []
    for name, value in figures.items():
        text = f"{value:.3f}" if isinstance(value, float) else str(value)
        title = name
        for suffix in ("_rad", "_mps", "_m", "_s"):
            title = title.removesuffix(suffix)
        rows.append((title.replace("_", " "), text, units.get(name, "")))
    print_table("Simulation", ("figure", "value", "unit"), rows)
