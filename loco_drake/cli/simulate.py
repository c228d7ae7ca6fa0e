"""``loco-drake simulate``: simulates a robot that performs a gait."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from loco_drake.cli.options import (
    SCHEDULE,
    Generator,
    Html,
    Json,
    Policy,
    Port,
    Tokenizer,
    Video,
    Weights,
    option,
)
from loco_drake.cli.output import do_all, say, write_json
from loco_drake.cli.simulation import (
    Pace,
    check_duration,
    in_terminal,
    override,
    print_figures,
    save_page,
    start_meshcat,
    stay,
    use_weights,
)
from loco_drake.cli.video import make_video, prepare_video
from loco_drake.common.errors import InputError
from loco_drake.motion.gaits import ANY, parse_schedule
from loco_drake.motion.motion import Motion
from loco_drake.motion.motion_file import load_motion

if TYPE_CHECKING:
    from loco_drake.evaluation.tracking import Rollout
    from loco_drake.models.robots import SimulatedRobot
    from loco_drake.systems.scenario import Scenario
    from loco_drake.viewing.captions import Track
    from loco_drake.viewing.takes import Scene


_GENERATED = ("generated", "gpt")  # the latter formerly


@dataclass(kw_only=True)
class Simulate:
    """Simulate a robot in Drake that tracks generated motion or a Motion file."""

    # Robot: go2, a1, or a YAML file, see docs/own_robot.md; or g1, see
    # docs/humanoid.md.
    robot: Annotated[str | None, option(metavar="ROBOT|FILE", default="go2")] = None
    gait: Annotated[
        str | None,
        option(
            f"{SCHEDULE}; or any, which goes with --command. A Motion file has its "
            "own.",
            metavar="GAIT",
            default="dog-trot",
        ),
    ] = None
    # Duration in s: at most that of a Motion file.
    duration: Annotated[float | None, option(default="10.0")] = None
    # Seed: of the generated motion.
    seed: Annotated[int | None, option(default="0")] = None
    # Constant velocity to follow: forward and sideways m/s, yaw rate rad/s.
    command: Annotated[
        tuple[float, float, float] | None,
        option(metavar="VX VY WZ", default="the motion's own"),
    ] = None
    # What is tracked: generated, during the simulation; or a Motion file.
    reference: Annotated[
        str | None, option(metavar="NAME|FILE", default="generated")
    ] = None
    policy: Policy = None
    tokenizer: Tokenizer = None
    generator: Generator = None
    weights: Weights = None
    # Show the robot in the browser, at most at real-time speed.
    meshcat: bool = True
    # Keep the robot in the middle of the page, live and in the replay; otherwise the
    # camera stays, and the replay shows the whole path.
    follow: bool = True
    # Show contact forces as arrows.
    forces: bool = False
    # In a terminal, keep the page and its replay until Ctrl-C.
    wait: bool = True
    port: Port = None
    html: Html = None
    video: Video = None
    # Contact solver: similar, lagged, sap or cenic.
    contact: Annotated[str | None, option(metavar="NAME", default="similar")] = None
    # Time step of the physics, s.
    time_step: Annotated[float | None, option(default="0.01")] = None
    # Coulomb friction coefficient of the ground.
    friction: Annotated[float | None, option(default="0.8")] = None
    # YAML file of a scenario: its fields replace the defaults of the options above;
    # options that are given take precedence.
    scenario: Annotated[Path | None, option(metavar="FILE")] = None
    # YAML that overrides fields of the scenario, as in "plant: {accuracy: 1.0e-4}".
    overlay: Annotated[str | None, option(metavar="TEXT")] = None
    json: Json = None

    def run(self) -> int:
        """Simulates, prints and writes; returns 1 if it was stopped early, else 0."""
        from loco_drake.cli.run_view import RunView
        from loco_drake.common.run_folder import stop_requests
        from loco_drake.control.plan import PLAN_DT
        from loco_drake.control.state import POSITION
        from loco_drake.evaluation import tracking
        from loco_drake.models.robots import get_simulated
        from loco_drake.models.scenery import frame, publish_replay

        scenario, duration, motion = self._read()
        robot = get_simulated(scenario.robot)
        if self.video is not None:
            prepare_video(self.video, duration)
        meshcat = None
        if self.meshcat or self.html is not None:
            meshcat = start_meshcat(self.port, announce=self.meshcat)
        scenario.plant.visual = meshcat is not None
        shown = scenario.visualization
        shown.publish_contacts |= self.forces
        recorder = tracking.Recorder(scenario, meshcat, follow=self.follow)
        if self.command is not None:
            port = recorder.diagram.GetInputPort("command")
            port.FixValue(recorder.context, self.command)
        recorder.start()
        if meshcat is not None:
            meshcat.StartRecording(frames_per_second=tracking.FRAMES_PER_SECOND)
        # Unless Drake waits.
        waits = self.meshcat and scenario.simulator.target_realtime_rate == 0
        pace = Pace(recorder, waits)
        view = RunView(
            recorder,
            meshcat,
            forces=shown.publish_contacts,
            gait=None if motion is None or motion.gait_changes else str(motion.label),
            keep=self.video is not None,
        )
        with stop_requests() as stop:

            def after_step(now: float) -> bool:
                view.update(now)
                pace.keep(now)
                return not stop.is_set()

            rollout, wall = recorder.run(duration, after_step)
        if rollout.fell:
            view.fell(recorder.context.get_time())
        simulated = (len(rollout.state) - 1) * PLAN_DT
        reference: Any = scenario.reference
        figures = {
            "robot": robot.name,
            "gait": reference.gait if motion is None else str(motion.label),
            "seed": reference.seed if motion is None else self.seed or 0,
            "duration_s": duration,
            "simulated_s": simulated,
            "fell": rollout.fell,
            "interrupted": stop.is_set(),
            **tracking.tracking_metrics(rollout),
            "real_time_factor": simulated / wall,
        }
        if figures["gait"] == ANY:
            figures["chosen"] = str(recorder.gait)

        def save_replay() -> None:
            if meshcat is None:
                return
            publish_replay(meshcat)
            if not self.follow:
                frame(meshcat, rollout.state[POSITION])
            corner = view.replay()
            if self.html is not None:
                save_page(meshcat, self.html, corner)

        def save_video() -> None:
            if self.video is not None:
                make_video(self.video, [_scene(robot, rollout, view.track)])

        done = (
            f"Stopped after {simulated:g} of {duration:g} s; the figures are of these."
        )
        do_all(
            lambda: print_figures("Simulation", figures),
            lambda: say(done) if stop.is_set() else None,
            lambda: write_json(self.json, figures),
            save_replay,
            save_video,
        )
        if self.meshcat and self.wait and in_terminal() and not stop.is_set():
            stay()
        return int(stop.is_set())

    def _read(self) -> "tuple[Scenario, float, Motion | None]":
        """Returns what to simulate, for how long, and the motion to follow, if any.

        Raises:
            InputError: if an option or a field of the scenario is amiss.
        """
        from loco_drake.control.driving import check_command
        from loco_drake.models.robots import Robot, get_simulated
        from loco_drake.systems.scenario import (
            GeneratedReference,
            LoadScenario,
            MotionReference,
            TrainedPolicy,
        )

        scenario = LoadScenario(filename=self.scenario, overlay=self.overlay)
        override(scenario, robot=self.robot)
        names = ("contact", "time_step", "friction")
        override(scenario.plant, **{name: getattr(self, name) for name in names})
        if self.reference in _GENERATED:
            if not isinstance(scenario.reference, GeneratedReference):
                scenario.reference = GeneratedReference()
        elif self.reference is not None:
            if not Path(self.reference).is_file():
                raise InputError(
                    "The reference must be generated or a Motion file, and there is no "
                    f"file {self.reference!r}."
                )
            scenario.reference = MotionReference(path=Path(self.reference))
        use_weights(
            scenario,
            weights=self.weights,
            tokenizer=self.tokenizer,
            generator=self.generator,
            policy=self.policy,
        )
        reference = scenario.reference
        if isinstance(reference, GeneratedReference):
            given = {"gait": self.gait, "seed": self.seed, "duration": self.duration}
            override(reference, **given)
            duration = reference.duration
        else:
            duration = 10.0 if self.duration is None else self.duration
        check_duration(duration)
        scenario.check()
        if self.command is not None:
            check_command(self.command)
            if not isinstance(get_simulated(scenario.robot), Robot):
                raise InputError("--command is for robots with three joints a leg.")
            if scenario.steering is None:
                raise InputError("--command needs a scenario with steering.")
        if not isinstance(scenario.policy, TrainedPolicy):
            raise InputError("The policy of a scenario to simulate must be trained.")
        if isinstance(reference, GeneratedReference):
            if reference.gait != ANY:
                parse_schedule(reference.gait).check_ends_by(duration)
            elif self.command is None:
                raise InputError(
                    "The gait any is chosen by the command: add --command, or name a "
                    "gait, such as dog-trot."
                )
            return scenario, duration, None
        if not isinstance(reference, MotionReference):
            raise InputError(
                "The reference of a scenario to simulate must be generated or a Motion."
            )
        if self.reference is None and (self.gait, self.seed) != (None, None):
            raise InputError(
                "--gait and --seed are of generated motion, and the scenario's is a "
                "file: add --reference generated."
            )
        motion = load_motion(reference.path)
        name = get_simulated(scenario.robot).name
        if motion.robot != name:
            raise InputError(
                f"{reference.path} is a motion of {motion.robot}, not of {name}."
            )
        return scenario, min(duration, motion.duration), motion


def _scene(robot: "SimulatedRobot", rollout: "Rollout", track: "Track") -> "Scene":
    """Returns what a robot did, with its plan's keypoints and what is said of it."""
    from loco_drake.control.state import split
    from loco_drake.motion.motion import FPS
    from loco_drake.systems.keypoint_visualizer import keypoints
    from loco_drake.viewing.takes import Scene, Take

    q, _ = split(rollout.state)
    plan_q, _ = split(rollout.plan_state)
    take = Take(robot.name, robot, FPS, q, keypoints(robot, plan_q))
    return Scene((take,), track=track, whose="plan")
