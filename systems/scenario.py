"""The scenario: a typed description of a simulation, which YAML can express."""

import copyreg
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.common.yaml import yaml_dump_typed, yaml_load_typed
from pydrake.systems.analysis import SimulatorConfig
from pydrake.visualization import VisualizationConfig

from loco_drake.common.errors import InputError, check_number
from loco_drake.common.typed_yaml import refuse_repeated_keys
from loco_drake.control.plan import PLAN_DT, UPDATE_PERIOD
from loco_drake.models.plant import PlantConfig
from loco_drake.models.robots import Robot, get_simulated
from loco_drake.motion.gaits import ANY, gait_index, parse_schedule

# Of a scenario's text: the loader recurses at each bracket, and copies at each alias.
_MAX_SIZE = 100_000
_MAX_BRACKETS = 200

# Dataclasses are mutable and have no tuples, as yaml_load_typed requires.


@dataclass(kw_only=True)
class GeneratedReference:
    """Motion generated while the simulation runs."""

    # Or a schedule such as dog-pace,dog-trot@3, or any, if the command is to choose.
    gait: str = "dog-trot"
    seed: int = 0  # of the tokens
    # Intended duration in s, which conditions the generator; the motion has no end.
    duration: float = 10.0
    temperature: float = 1.0  # 0 is greedy
    top_p: float = 0.95  # probability of the codes to sample from, the likeliest ones
    # Weights files of one's own training; null for the shipped ones.
    tokenizer: Path | None = None
    generator: Path | None = None

    def check(self) -> None:
        """Raises InputError unless every field is valid."""
        if "," in str(self.gait):
            parse_schedule(self.gait)
        else:
            gait_index(str(self.gait))
        whole = isinstance(self.seed, int | np.integer)
        if not (whole and 0 <= self.seed < 2**63):
            raise InputError(f"The seed must be 0 or more, not {self.seed!s:.40}.")
        check_number("The duration", self.duration, PLAN_DT)
        check_number("The temperature", self.temperature, 0.0)
        check_number("top_p", self.top_p, 1e-6, 1.0)


@dataclass(kw_only=True)
class MotionReference:
    """Motion from a Motion file."""

    path: Path = Path()


@dataclass(kw_only=True)
class PlanReference:
    """A plan set with StartEpisode or PlanPlayer.SetPlan; standing by default."""


@dataclass(kw_only=True)
class SmootherConfig:
    """Chunk and look-ahead of the smoother."""

    # Seconds of plan that are committed at a time. TOPP-RA solves for twice as much, so
    # that the motion can always continue.
    chunk: float = 0.96
    # Seconds of smoothed plan ahead of the clock.
    lookahead: float = 1.0
    # Largest downward acceleration of the base, g. Default: 2 for grounded motion and a
    # generator that learned from such, else 1.
    fall: float | None = None

    def check(self) -> None:
        """Raises InputError unless every field is valid."""
        # At least one period of its updates; and two chunks must fit into the 3 s that
        # the generator has written ahead, less what it writes at a time.
        check_number("The smoother's chunk", self.chunk, UPDATE_PERIOD, 1.4)
        # The policy looks .16 s ahead.
        check_number("The smoother's lookahead", self.lookahead, 0.16, 10.0)
        if self.fall is not None:
            check_number("The smoother's fall", self.fall, 0.1, 10.0)


@dataclass(kw_only=True)
class SteeringConfig:
    """How a plan follows the command, if the port "command" has a value."""

    # Seconds in which the plan covers 90 % of a step of the command.
    response: float = 0.6
    # Keep commands within the ranges measured for the robot's main policy; otherwise
    # only within what legs and joints can do.
    measured_ranges: bool = True
    # Bend the plan until it follows the command.
    bend: bool = True
    # Tell the generator the command, if the reference is generated.
    tell: bool = False

    def check(self) -> None:
        """Raises InputError unless every field is valid."""
        check_number("The steering's response", self.response, 0.1, 10.0)


@dataclass(kw_only=True)
class TrainedPolicy:
    """A trained policy."""

    # Weights, or the name of a shipped variant, such as randomized; the robot's main
    # shipped policy by default.
    weights: Path | None = None


@dataclass(kw_only=True)
class ExternalAction:
    """No policy: the diagram exports the input port "action"."""


@dataclass(kw_only=True)
class ExternalTargets:
    """The plant alone: the diagram exports its input port "desired_state"."""


# Hashable, since batches cache one diagram of each kind.
@dataclass(kw_only=True, unsafe_hash=True)
class Disturbances:
    """What a diagram needs to simulate a world unlike the model, see :mod:`.domain`.

    They have no effect until SetDomain sets a domain.
    """

    actuation: bool = False  # latency and strength of the motors
    pushes: bool = False  # forces on the trunk
    sensors: bool = False  # errors of the state that the policy observes
    terrain: bool = False  # ground that can be inclined


@dataclass(kw_only=True)
class Scenario:
    """Everything that defines a diagram and its simulator."""

    robot: str = "go2"  # go2, a1, g1, or a robot's YAML file
    plant: PlantConfig = field(default_factory=PlantConfig)
    reference: GeneratedReference | MotionReference | PlanReference = field(
        default_factory=GeneratedReference
    )
    # Steering of the motion by the port "command"; null to leave it out.
    steering: SteeringConfig | None = field(default_factory=SteeringConfig)
    # Re-timing of the motion; null to track it as it is.
    smoother: SmootherConfig | None = field(default_factory=SmootherConfig)
    policy: TrainedPolicy | ExternalAction | ExternalTargets = field(
        default_factory=TrainedPolicy
    )
    disturbances: Disturbances = field(default_factory=Disturbances)
    # Only target_realtime_rate; the integrator follows from plant.contact.
    simulator: SimulatorConfig = field(default_factory=SimulatorConfig)
    # Of Meshcat.
    visualization: VisualizationConfig = field(
        default_factory=lambda: VisualizationConfig(
            publish_proximity=False, publish_inertia=False, publish_contacts=False
        )
    )

    def check(self) -> None:
        """Raises InputError unless every field is valid."""
        robot = get_simulated(self.robot)
        if not isinstance(robot, Robot):
            self._check_humanoid(robot.name)
        for part in (self.plant, self.reference, self.steering, self.smoother):
            if not isinstance(part, MotionReference | PlanReference | None):
                part.check()
        if getattr(self.reference, "gait", None) == ANY and self.steering is None:
            raise InputError("The gait any needs steering, whose command chooses it.")
        rate = self.simulator.target_realtime_rate
        check_number("The simulator's target_realtime_rate", rate, 0.0)
        if repr(self.simulator) != repr(SimulatorConfig(target_realtime_rate=rate)):
            raise InputError(
                "Of a scenario's simulator only target_realtime_rate can be set: the "
                "integrator follows from the plant's contact, accuracy and time_step."
            )
        period = self.visualization.publish_period
        check_number("The visualization's publish_period", period, 1e-3, 10.0)

    def _check_humanoid(self, name: str) -> None:
        """Raises InputError unless a robot that is no quadruped can do it."""
        follows = not isinstance(self.policy, ExternalTargets)
        if follows and isinstance(self.reference, GeneratedReference):
            raise InputError(
                f"Motion is generated for robots with three joints a leg; {name} "
                "follows a Motion file: name it as the reference."
            )
        if self.disturbances != Disturbances():
            raise InputError(
                f"Disturbances are of robots with three joints a leg, not of {name}."
            )


def _pickled(config: SimulatorConfig | VisualizationConfig) -> tuple[Any, ...]:
    return _unpickled, (type(config), yaml_dump_typed(config))


def _unpickled(schema: type, text: str) -> Any:
    return yaml_load_typed(schema=schema, data=text)


# Drake 1.51 cannot pickle these two, and worker processes are sent scenarios.
copyreg.pickle(SimulatorConfig, _pickled)
copyreg.pickle(VisualizationConfig, _pickled)


def LoadScenario(
    *, filename: Path | None = None, data: str | None = None, overlay: str | None = None
) -> Scenario:
    """Returns the scenario in a YAML file or text, with defaults for missing fields.

    ``data`` is YAML text instead of a file; ``overlay``, too, overrides fields.

    Raises:
        InputError: if a file cannot be read, or a field is unknown, has the wrong type
            or is out of its bounds.
    """
    if filename is not None:
        data = _read(Path(filename))
    scenario = Scenario()
    for text in (data, overlay):
        if text is not None:
            scenario = _overlaid(scenario, text)
    scenario.check()
    return scenario


def DumpScenario(scenario: Scenario) -> str:
    """Returns a scenario as YAML text, of which LoadScenario makes the same one."""
    text: str = yaml_dump_typed(scenario)
    # Drake leaves out what is null.
    nulls = [name for name, value in vars(scenario).items() if value is None]
    return text + "".join(f"{name}: null\n" for name in nulls)


def _read(path: Path) -> str:
    try:
        if not path.is_file():
            raise InputError(f"There is no scenario file {str(path)!r}.")
        if path.stat().st_size > _MAX_SIZE:
            raise InputError(
                f"{path} has more than {_MAX_SIZE} B and is not a scenario."
            )
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(
            f"{path} is not a scenario: it is not text in UTF-8."
        ) from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None


def _overlaid(scenario: Scenario, text: str) -> Scenario:
    if len(text) > _MAX_SIZE or sum(map(text.count, "[{*")) > _MAX_BRACKETS:
        raise InputError(
            f"A scenario has at most {_MAX_SIZE} characters and {_MAX_BRACKETS} "
            "brackets and aliases."
        )
    try:
        refuse_repeated_keys(text)
        result = yaml_load_typed(schema=Scenario, data=text, defaults=scenario)
    except Exception as error:
        # The YAML library and the types raise many kinds.
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        raise InputError(f"This scenario cannot be read: {reason}") from None
    assert isinstance(result, Scenario)
    return result
