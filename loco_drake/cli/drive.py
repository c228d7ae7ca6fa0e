"""``loco-drake drive``: a person, a table or a recorded drive steers a robot."""

import hashlib
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from loco_drake.cli.options import (
    LABEL_CHOICES,
    Generator,
    Html,
    Json,
    Output,
    Policy,
    Port,
    Tokenizer,
    Weights,
    option,
)
from loco_drake.cli.output import do_all, write_json
from loco_drake.cli.simulation import (
    Pace,
    check_duration,
    override,
    print_figures,
    save_page,
    start_meshcat,
    use_weights,
)
from loco_drake.common.errors import InputError
from loco_drake.motion.gaits import ANY, ANY_INDEX, GAIT_CHOICES

if TYPE_CHECKING:
    from loco_drake.control.drive_file import Drive as DriveFile
    from loco_drake.control.driving import OrderTable
    from loco_drake.systems.scenario import Scenario

# Seconds that a table of commands is driven on after its last row.
_AFTER = 3.0
# What is driven without a scenario.
_DEFAULT = f"reference: !GeneratedReference {{gait: {ANY}}}"
_DIFFERS = (
    "loco-drake: The states differ from the recorded ones: another machine, or other "
    "versions of loco_drake and its libraries, computed them."
)


@dataclass(kw_only=True)
class Drive:
    """Drive a robot: keys, sliders, buttons and a gamepad on Meshcat's page."""

    # Robot: go2, a1, or a YAML file, see docs/own_robot.md.
    robot: Annotated[str | None, option(metavar="ROBOT|FILE", default="go2")] = None
    gait: Annotated[
        str | None,
        option(
            f"Gait: {LABEL_CHOICES}; or any, which goes with the command. Buttons on "
            "the page change it.",
            metavar="GAIT",
            default="any",
        ),
    ] = None
    # Duration in s.
    duration: Annotated[
        float | None,
        option(
            default="until Ctrl-C or the page's Stop button; with --commands, 3 s "
            "after the last row; with --replay, as recorded"
        ),
    ] = None
    # Seed: of the generated motion.
    seed: Annotated[int | None, option(default="0")] = None
    # Drive by a table of times and commands: CSV that begins with the line
    # time,forward,sideways,yaw_rate and may add the columns gait, push and reset. Units
    # are s, m/s, rad/s and N s to the left.
    commands: Annotated[Path | None, option(metavar="FILE")] = None
    # Record to write: the drive, for --replay.
    record: Annotated[Path | None, option(metavar="FILE"), Output.FILE] = None
    # Repeat a recorded drive to the last bit.
    replay: Annotated[Path | None, option(metavar="FILE")] = None
    policy: Policy = None
    tokenizer: Tokenizer = None
    generator: Generator = None
    weights: Weights = None
    # Show the robot in the browser, at most at real-time speed. Needed unless there is
    # a table of commands or a recorded drive.
    meshcat: bool = True
    # Show contact forces as arrows.
    forces: bool = False
    port: Port = None
    html: Html = None
    # YAML file of a scenario.
    scenario: Annotated[Path | None, option(metavar="FILE")] = None
    # YAML that overrides fields of the scenario, as in "plant: {accuracy: 1.0e-4}".
    overlay: Annotated[str | None, option(metavar="TEXT")] = None
    json: Json = None

    def run(self) -> int:
        """Drives, prints and writes; returns the exit status."""
        from loco_drake.cli.drive_view import DriveView
        from loco_drake.common.run_folder import stop_requests
        from loco_drake.control.drive_file import save_drive, states_sha256
        from loco_drake.control.plan import PLAN_DT
        from loco_drake.evaluation.drive_scores import drive_scores
        from loco_drake.evaluation.driving import drive
        from loco_drake.evaluation.tracking import (
            FRAMES_PER_SECOND,
            Recorder,
            tracking_metrics,
        )
        from loco_drake.models.robots import get_robot
        from loco_drake.models.scenery import publish_replay
        from loco_drake.systems.command_source import CommandSource
        from loco_drake.systems.meshcat_driver import MeshcatDriver

        recorded = self._read_replay()
        scenario = self._read_scenario(recorded)
        table = self._read_table(scenario, recorded)
        header = _header(scenario, recorded)
        robot = get_robot(header["robot"])
        duration = self._duration(table, recorded)
        meshcat = driver = None
        if self.meshcat or self.html is not None:
            meshcat = start_meshcat(self.port, announce=self.meshcat)
        if table is not None:
            source = CommandSource(table.at)
        else:
            assert meshcat is not None
            driver = MeshcatDriver(meshcat, GAIT_CHOICES, header["gait"])
            source = CommandSource(driver.sample)
        scenario.plant.visual = meshcat is not None
        recorder = Recorder(scenario, meshcat, source=source, follow=True)
        recorder.start()
        if meshcat is not None and self.html is not None:
            meshcat.StartRecording(frames_per_second=FRAMES_PER_SECOND)
        steps = None if duration is None else round(duration / PLAN_DT)
        # Unless Drake waits.
        waits = self.meshcat and scenario.simulator.target_realtime_rate == 0
        pace = Pace(recorder, waits)
        forces = scenario.visualization.publish_contacts
        with (
            stop_requests() as stop,
            DriveView(recorder, meshcat, driver, forces) as view,
        ):
            if steps is None:
                print("Drive on that page; its Stop button or Ctrl-C ends.", flush=True)

            def after_step(now: float, orders: Any) -> bool:
                view.update(now, orders)
                pace.keep(now)
                return not (stop.is_set() or (driver and driver.stopped))

            driven = drive(recorder, steps, after_step)
            elapsed = pace.elapsed
        rollout = driven.rollout
        outcome = {
            "steps": rollout.steps,
            "states_sha256": states_sha256(rollout.state),
        }
        simulated = rollout.steps * PLAN_DT
        figures: dict[str, Any] = {}

        def save_record() -> None:
            if self.record is not None:
                save_drive(self.record, driven.table, **header, **outcome)

        def report() -> None:
            figures.update(
                {
                    "robot": robot.name,
                    "gait": header["gait"],
                    "seed": header["seed"],
                    "duration_s": simulated if duration is None else duration,
                    "simulated_s": simulated,
                    "fell": rollout.fell,
                    "interrupted": stop.is_set(),
                    "falls": driven.falls,
                    **tracking_metrics(rollout),
                    **drive_scores(robot, driven),
                    "real_time_factor": simulated / driven.wall,
                    "wall_clock_s": elapsed,
                }
            )
            if recorded is not None and rollout.steps == recorded.header["steps"]:
                figures["identical"] = outcome.items() <= recorded.header.items()
            print_figures("Drive", figures)

        def save_replay() -> None:
            if meshcat is not None and self.html is not None:
                publish_replay(meshcat)
                save_page(meshcat, self.html, view.replay())

        # First what cannot be had again.
        do_all(save_record, report, lambda: write_json(self.json, figures), save_replay)
        if not figures.get("identical", True):
            print(_DIFFERS, file=sys.stderr)
        return 0

    def _read_replay(self) -> "DriveFile | None":
        """Returns the recorded drive to repeat, if any.

        Raises:
            InputError: if it is damaged, or an option contradicts it.
        """
        from loco_drake.control.drive_file import load_drive

        if self.replay is None:
            if self.commands is None and not self.meshcat:
                raise InputError(
                    "Without Meshcat a drive needs a table of commands or a recorded "
                    "drive: add --commands or --replay."
                )
            return None
        fixed = ("robot", "gait", "seed", "commands", "scenario", "overlay")
        for name in fixed:
            if getattr(self, name) is not None:
                raise InputError(
                    f"A recorded drive has its own {name}: leave out --{name}."
                )
        return load_drive(self.replay)

    def _read_scenario(self, recorded: "DriveFile | None") -> "Scenario":
        """Returns what to simulate.

        Raises:
            InputError: if a field is amiss.
        """
        from loco_drake.control.plan import PLAN_DT
        from loco_drake.systems.scenario import (
            GeneratedReference,
            LoadScenario,
            TrainedPolicy,
        )

        if recorded is not None:
            scenario = LoadScenario(data=recorded.header["scenario"])
        elif self.scenario is not None:
            scenario = LoadScenario(filename=self.scenario, overlay=self.overlay)
        else:
            scenario = LoadScenario(data=_DEFAULT, overlay=self.overlay)
        override(scenario, robot=self.robot)
        if not isinstance(scenario.reference, GeneratedReference):
            raise InputError("The reference of a scenario to drive must be generated.")
        override(scenario.reference, gait=self.gait, seed=self.seed)
        use_weights(
            scenario,
            weights=self.weights,
            tokenizer=self.tokenizer,
            generator=self.generator,
            policy=self.policy,
        )
        scenario.disturbances.pushes = True
        scenario.visualization.publish_contacts |= self.forces
        if scenario.plant.contact == "cenic":
            # Pictures at other times would change the steps of the integrator.
            scenario.visualization.publish_period = PLAN_DT
        scenario.check()
        if scenario.steering is None or not isinstance(scenario.policy, TrainedPolicy):
            raise InputError(
                "A scenario to drive must have steering and a trained policy."
            )
        if str(scenario.reference.gait) not in GAIT_CHOICES:
            raise InputError(
                "A drive begins with one gait, such as dog-trot, or with any, not with "
                "a schedule; buttons or a table of commands change it."
            )
        return scenario

    def _read_table(
        self, scenario: "Scenario", recorded: "DriveFile | None"
    ) -> "OrderTable | None":
        """Returns the orders to follow; None for those of a person.

        Raises:
            InputError: if a row is amiss, or the generator does not know a gait.
        """
        from loco_drake.control.driving import GAIT, read_commands
        from loco_drake.generation.motion_model import motion_model_of

        reference: Any = scenario.reference
        if recorded is not None:
            table = recorded.table
        elif self.commands is not None:
            table = read_commands(self.commands, str(reference.gait))
        else:
            return None
        labels = table.rows[:, GAIT].astype(np.int64)
        model = motion_model_of(
            scenario.robot, reference.tokenizer, reference.generator
        )
        model.check_labels(labels[labels != ANY_INDEX])
        return table

    def _duration(
        self, table: "OrderTable | None", recorded: "DriveFile | None"
    ) -> float | None:
        """Returns how long to drive, s; None for no end."""
        from loco_drake.control.plan import PLAN_DT

        duration = self.duration
        if duration is None:
            if recorded is not None:
                duration = recorded.header["steps"] * PLAN_DT
            elif table is not None:
                duration = float(table.times[-1]) + _AFTER
        if duration is not None:
            check_duration(duration)
        return duration


def _header(scenario: "Scenario", recorded: "DriveFile | None") -> dict[str, Any]:
    """Returns what a recorded drive says of its scenario.

    Raises:
        InputError: if weights are not there, or not those of ``recorded``.
    """
    from loco_drake.models.robots import get_robot
    from loco_drake.models.shipped import network_path, policy_path
    from loco_drake.systems.scenario import DumpScenario

    policy: Any = scenario.policy
    reference: Any = scenario.reference
    robot = get_robot(scenario.robot)
    paths = {
        "policy": policy_path(robot, policy.weights),
        "tokenizer": reference.tokenizer or network_path(robot, "tokenizer"),
        "generator": reference.generator or network_path(robot, "generator"),
    }
    hashes = {}
    for kind, path in paths.items():
        if not path.is_file():
            raise InputError(f"There are no {kind} weights at {str(path)!r}.")
        weights = hashlib.sha256(path.read_bytes()).hexdigest()
        # Earlier drives tell the policy's only.
        if recorded and recorded.header.get(f"{kind}_sha256", weights) != weights:
            raise InputError(
                f"The weights at {path} are not those of the recorded drive; name "
                f"these with --{kind}."
            )
        hashes[f"{kind}_sha256"] = weights
    return {
        "robot": scenario.robot,
        "gait": str(reference.gait),
        "seed": int(reference.seed),
        "scenario": DumpScenario(scenario),
        **hashes,
    }
