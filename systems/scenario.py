"""What to simulate, as typed data that can be written in YAML."""

from dataclasses import dataclass, field
from pathlib import Path

from pydrake.common.yaml import yaml_load_typed

from loco_drake.common.errors import InputError
from loco_drake.models.plant import PlantConfig

from .toppra_smoother import SmootherConfig

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


@dataclass(kw_only=True)
class MotionReference:
    """A Motion file."""

    path: Path = Path()


@dataclass(kw_only=True)
class PlanReference:
    """A plan set from code with PlanPlayer.SetPlan; at first, to stand still."""


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


@dataclass(kw_only=True)
class Scenario:
    """Everything that :func:`MakeLocomotionDiagram` needs to know."""

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


def LoadScenario(
    *, filename: Path | None = None, data: str | None = None, overlay: str | None = None
) -> Scenario:
    """Returns the scenario in a YAML file or text, defaults filled in.

    Args:
        filename: a YAML file; or
        data: YAML text.
        overlay: YAML text that overrides fields of the above.

    Raises:
        InputError: if a field is unknown or of a wrong type, or a file is missing.
    """
    scenario = Scenario()
    try:
        if filename is not None and not Path(filename).is_file():
            raise InputError(f"There is no scenario file {str(filename)!r}.")
        if filename is not None or data is not None:
            scenario = yaml_load_typed(
                schema=Scenario,
                filename=None if filename is None else str(filename),
                data=data,
                defaults=scenario,
            )
        if overlay is not None:
            scenario = yaml_load_typed(schema=Scenario, data=overlay, defaults=scenario)
    except InputError:
        raise
    except Exception as error:
        # The loader raises whatever the YAML library and the types raise.
        reason = " ".join(str(error).split())
        raise InputError(f"This scenario cannot be read: {reason}") from None
    return scenario
