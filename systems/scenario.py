"""What to simulate, as typed data that can be written in YAML."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pydrake.common.yaml import yaml_load_typed
from pydrake.systems.analysis import SimulatorConfig
from pydrake.visualization import VisualizationConfig

from loco_drake.common.errors import (
    InputError,
    check_choice,
    check_number,
)
from loco_drake.control.plan import PLAN_DT, UPDATE_PERIOD
from loco_drake.models.plant import PlantConfig
from loco_drake.models.robots import ROBOTS
from loco_drake.motion.gait_schedule import parse_schedule

# Of a scenario's text: the loader calls itself for each bracket, and copies at each
# alias.
_MAX_SIZE = 100_000
_MAX_BRACKETS = 200

# Mutable dataclasses and no tuples: yaml_load_typed sets fields one by one.


@dataclass(kw_only=True)
class GeneratedReference:
    """Motion written by the generator while the simulation runs."""

    # A gait label, source-gait; or several, the later ones with the s at which they
    # begin, such as dog-pace,dog-trot@3.
    gait: str = "dog-trot"
    # What the tokens are drawn with.
    seed: int = 0
    # Duration in s that the generator is told; the motion goes on beyond it.
    duration: float = 10.0
    # Of the distribution that tokens are drawn from; 0 takes the likeliest.
    temperature: float = 1.0
    # Tokens are drawn from the likeliest that make up this much probability.
    top_p: float = 0.95

    def check(self) -> None:
        """Raises InputError unless every field is sound."""
        parse_schedule(str(self.gait))
        whole = isinstance(self.seed, int | np.integer)
        if not (whole and 0 <= self.seed < 2**63):
            raise InputError(f"The seed must be 0 or more, not {self.seed!s:.40}.")
        check_number("The duration", self.duration, PLAN_DT)
        check_number("The temperature", self.temperature, 0.0)
        check_number("top_p", self.top_p, 1e-6, 1.0)


@dataclass(kw_only=True)
class MotionReference:
    """A Motion file."""

    path: Path = Path()


@dataclass(kw_only=True)
class PlanReference:
    """A plan set from code with PlanPlayer.SetPlan; at first, to stand still."""


@dataclass(kw_only=True)
class SmootherConfig:
    """How far and how often plans are re-timed."""

    # Seconds of plan that are committed at a time; as much again is solved for, so that
    # the motion can always go on from what is committed.
    chunk: float = 0.96
    # Seconds of smoothed plan kept ahead of the clock.
    lookahead: float = 1.0

    def check(self) -> None:
        """Raises InputError unless the smoother can work so."""
        # At least one period of its updates; and two chunks must fit into the 3 s that
        # the generator has written ahead, less what it writes at a time.
        check_number("The smoother's chunk", self.chunk, UPDATE_PERIOD, 1.4)
        # The policy looks .16 s ahead.
        check_number("The smoother's lookahead", self.lookahead, 0.16, 10.0)


@dataclass(kw_only=True)
class TrainedPolicy:
    """The learned policy."""

    # Weights, or the name of a shipped variant, such as randomized; the shipped policy
    # of the robot if not given.
    weights: Path | None = None


@dataclass(kw_only=True)
class ExternalAction:
    """The diagram's input port "action" takes the place of the policy."""


@dataclass(kw_only=True)
class ExternalTargets:
    """The diagram's input port "desired_state" is the PD's: there is only the plant."""


# Hashable: batches keep one diagram of each kind.
@dataclass(kw_only=True, unsafe_hash=True)
class Disturbances:
    """Which systems a diagram has for domains unlike the model; see :mod:`.domain`.

    They do nothing until SetDomain tells them what.
    """

    # Latency and strength of the motors.
    actuation: bool = False
    # Forces on the trunk.
    pushes: bool = False
    # Errors of what the policy sees of the robot's state.
    sensors: bool = False


def _visualization() -> VisualizationConfig:
    return VisualizationConfig(
        publish_proximity=False, publish_inertia=False, publish_contacts=False
    )


@dataclass(kw_only=True)
class Scenario:
    """Everything that a diagram and its simulator are made of."""

    # One of loco_drake.models.robots.ROBOTS.
    robot: str = "go2"
    # Contact, time step and friction.
    plant: PlantConfig = field(default_factory=PlantConfig)
    # Where the motion to be tracked comes from.
    reference: GeneratedReference | MotionReference | PlanReference = field(
        default_factory=GeneratedReference
    )
    # How the motion is re-timed; without it the plan is tracked as it was written.
    smoother: SmootherConfig | None = field(default_factory=SmootherConfig)
    # What drives the joints.
    policy: TrainedPolicy | ExternalAction | ExternalTargets = field(
        default_factory=TrainedPolicy
    )
    # What there is between policy and robot beyond the model.
    disturbances: Disturbances = field(default_factory=Disturbances)
    # Drake's: target_realtime_rate. The integrator follows from the plant's contact.
    simulator: SimulatorConfig = field(default_factory=SimulatorConfig)
    # Drake's: what Meshcat shows, and how often.
    visualization: VisualizationConfig = field(default_factory=_visualization)

    def check(self) -> None:
        """Raises InputError unless every field is sound."""
        check_choice("robot", self.robot, ROBOTS)
        self.plant.check()
        if isinstance(self.reference, GeneratedReference):
            self.reference.check()
        if self.smoother is not None:
            self.smoother.check()
        rate = self.simulator.target_realtime_rate
        check_number("The simulator's target_realtime_rate", rate, 0.0)
        if repr(self.simulator) != repr(SimulatorConfig(target_realtime_rate=rate)):
            raise InputError(
                "Of a scenario's simulator only target_realtime_rate can be set: the "
                "integrator follows from the plant's contact, accuracy and time_step."
            )
        period = self.visualization.publish_period
        check_number("The visualization's publish_period", period, 1e-3, 10.0)


def LoadScenario(
    *, filename: Path | None = None, data: str | None = None, overlay: str | None = None
) -> Scenario:
    """Returns the scenario in a YAML file or text, defaults filled in.

    Args:
        filename: a YAML file; or
        data: YAML text.
        overlay: YAML text that overrides fields of the above.

    Raises:
        InputError: if a file cannot be read, a field is unknown or of a wrong type, or
            a value is out of its bounds.
    """
    if filename is not None:
        data = _read(Path(filename))
    scenario = Scenario()
    for text in (data, overlay):
        if text is not None:
            scenario = _overlaid(scenario, text)
    scenario.check()
    return scenario


def _read(path: Path) -> str:
    try:
        if not path.is_file():
            raise InputError(f"There is no scenario file {str(path)!r}.")
        if path.stat().st_size > _MAX_SIZE:
            raise InputError(f"{path} has more than {_MAX_SIZE} B, and is no scenario.")
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path} is no scenario: it is not text in UTF-8.") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None


def _overlaid(scenario: Scenario, text: str) -> Scenario:
    # The loader would recurse for each bracket, and copy for each alias.
    if len(text) > _MAX_SIZE or sum(map(text.count, "[{*")) > _MAX_BRACKETS:
        raise InputError(
            f"A scenario has at most {_MAX_SIZE} characters and {_MAX_BRACKETS} "
            "brackets and aliases."
        )
    try:
        result = yaml_load_typed(schema=Scenario, data=text, defaults=scenario)
    except Exception as error:
        # The loader raises whatever the YAML library and the types raise.
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        raise InputError(f"This scenario cannot be read: {reason}") from None
    assert isinstance(result, Scenario)
    return result
