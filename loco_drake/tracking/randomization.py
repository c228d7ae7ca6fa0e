"""Domain randomization: the distribution from which each episode draws a Domain."""

from dataclasses import dataclass, replace
from math import inf
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import tyro
from numpy.typing import NDArray

from loco_drake.common.errors import InputError, check_bounds
from loco_drake.control.domain import BOUNDS, Domain, Push, SensorErrors, error_vector
from loco_drake.control.terrain import (
    MAX_ROUGHNESS,
    MAX_SLOPE,
    Terrain,
    slope_gradient,
)

# Commands have these ranges as options; their --help does not wait for Drake.
if TYPE_CHECKING:
    from loco_drake.models.plant import PlantConfig
    from loco_drake.models.robots import SimulatedRobot
    from loco_drake.systems.scenario import Disturbances

Array = NDArray[np.float64]

# How --help shows parts that are off.
_OFF = "(default: off)"
Range = Annotated[
    tuple[float, float] | None,
    tyro.conf.arg(metavar="LOW HIGH", help_behavior_hint=_OFF),
]
Multiple = Annotated[float | None, tyro.conf.arg(help_behavior_hint=_OFF)]

PUSH_DURATION = 0.1  # s

# Standard deviations of the sensors' errors at noise 1. White: about those of the
# uniform noise of legged_gym (Rudin et al. 2022), .1 m/s and .2 rad/s for the base,
# .01 rad for the joints, but for the joints' speeds, which encoders give better than
# 1.5 rad/s. Bias: what calibration and state estimation leave.
WHITE = error_vector(
    orientation=0.01,
    position=0.005,
    joint_positions=0.005,
    angular_velocity=0.1,
    velocity=0.05,
    joint_velocities=0.5,
)
BIAS = error_vector(
    orientation=0.03,
    position=0.02,
    joint_positions=0.01,
    angular_velocity=0.01,
    velocity=0.03,
)


@dataclass(kw_only=True)
class RandomizationConfig:
    """Ranges from which each episode's world is drawn; a part that is None is off.

    Draws are uniform unless stated otherwise. docs/tracking_method.md describes the
    model of each part and the sources of the ranges in STANDARD.
    """

    # Coulomb friction coefficient of the ground. A contact uses the harmonic mean with
    # the feet's .8.
    friction: Range = None
    # Stiffness of the ground in N/m, log-uniform; in series with the feet's 5e4.
    stiffness: Range = None
    # Mass added to the trunk in kg; may be negative.
    payload: Range = None
    # Shift of the trunk's centre of mass along each of its axes, m.
    com_shift: Range = None
    # Torque of each motor over that of its model.
    motor_strength: Range = None
    # Delay of the set-points in s, rounded to whole time steps.
    latency: Range = None
    # Change of the robot's velocity by a push in a random horizontal direction, m/s.
    # The force lasts .1 s.
    push: Range = None
    # Time from the start to the first push and between pushes, s.
    push_interval: tuple[float, float] = (1.0, 3.0)
    # Damping of the motors over that of their model.
    damping: Range = None
    # Coulomb friction of each joint, N m.
    joint_friction: Range = None
    # Incline of the ground in degrees, in a random direction.
    slope: Range = None
    # Height range of smooth bumps of the ground, m.
    roughness: Range = None
    # Sensor errors, as a multiple of the standard deviations in
    # docs/tracking_method.md.
    noise: Multiple = None
    # Share of the worlds that are like the model but for their pushes, so that a policy
    # stays exact there.
    nominal_share: float = 0.0

    def check(
        self, robot: "SimulatedRobot | None" = None, plant: "PlantConfig | None" = None
    ) -> None:
        """Raises InputError unless every range can be drawn from.

        The motors of ``robot``, if given, must be able to be as weak in ``plant``.
        """
        from loco_drake.models.parameters import check_strength
        from loco_drake.models.plant import PlantConfig
        from loco_drake.models.robots import Robot

        limits = {**BOUNDS, "push": (0.0, inf), "push_interval": (PUSH_DURATION, inf)}
        limits["motor_strength"] = limits.pop("strength")
        limits |= {"slope": (0.0, MAX_SLOPE), "roughness": (0.0, MAX_ROUGHNESS)}
        for name, (least, most) in limits.items():
            bounds = getattr(self, name)
            if bounds is None:
                continue
            low, high = bounds
            if not (least <= low <= high <= most and np.isfinite(high)):
                limit = f" and at most {most:g}" if np.isfinite(most) else ""
                raise InputError(
                    f"The randomization's {name} must be two numbers, the smaller one "
                    f"first, of at least {least:g}{limit}, not {low:g} and {high:g}."
                )
        if robot is not None and not isinstance(robot, Robot):
            if self.is_off:
                return
            raise InputError(
                f"Worlds are randomized of robots with three joints a leg, not of "
                f"{robot.name}: leave out --randomize, pushes and all ranges."
            )
        lightest = (self.payload or (0.0,))[0]
        if robot is not None and lightest < robot.least_payload:
            raise InputError(
                f"The randomization's payload of {robot.name} must be at least "
                f"{robot.least_payload:.2g} kg, not {lightest:g}: its trunk is light."
            )
        if robot is not None and not (self.motor_strength is self.damping is None):
            weakest = (self.motor_strength or (1.0,))[0] * (self.damping or (1.0,))[0]
            check_strength(robot, plant or PlantConfig(), weakest)
        if self.noise is not None:
            check_bounds("The randomization's noise", self.noise, 0)
        check_bounds("The randomization's nominal_share", self.nominal_share, 0, 1)

    def with_standard(self) -> "RandomizationConfig":
        """Returns a copy in which every part that is off is as in STANDARD."""
        off = [name for name, value in vars(self).items() if value is None]
        return replace(self, **{name: getattr(STANDARD, name) for name in off})

    @property
    def disturbances(self) -> "Disturbances":
        """The systems that a diagram needs for it."""
        from loco_drake.systems.scenario import Disturbances

        return Disturbances(
            actuation=any(
                part is not None
                for part in (
                    self.motor_strength,
                    self.latency,
                    self.damping,
                    self.joint_friction,
                )
            ),
            pushes=self.push is not None,
            sensors=self.noise is not None,
            terrain=not (self.slope is self.roughness is None),
        )

    @property
    def changes_physics(self) -> bool:
        """Whether worlds differ from the model in more than what is measured."""
        others = replace(
            self,
            noise=None,
            push_interval=STANDARD.push_interval,
            nominal_share=STANDARD.nominal_share,
        )
        return others != RandomizationConfig()

    @property
    def is_off(self) -> bool:
        """Whether every world is like the model."""
        return not self.changes_physics and self.noise is None

    def draw(
        self,
        robot: "SimulatedRobot",
        random: np.random.Generator,
        start: float,
        end: float,
    ) -> Domain:
        """Returns a world; parts that are off draw nothing.

        Args:
            robot: the robot, whose mass says what impulse a push is.
            random: draws.
            start: context time at which the episode begins, s.
            end: and ends.
        """

        def uniform(bounds: Any, size: int | None = None) -> Any:
            if bounds is None:
                return None
            return random.uniform(bounds[0], bounds[1], size)

        if self.nominal_share > 0 and random.uniform() < self.nominal_share:
            return self._nominal(self._draw_pushes(robot, random, start, end))
        log_stiffness = self.stiffness and np.log(self.stiffness)
        friction, stiffness = uniform(self.friction), uniform(log_stiffness)
        return Domain(
            friction=friction,
            stiffness=None if stiffness is None else float(np.exp(stiffness)),
            payload=uniform(self.payload),
            com_shift=uniform(self.com_shift, 3),
            strength=uniform(self.motor_strength, 12),
            latency=uniform(self.latency) or 0.0,
            pushes=self._draw_pushes(robot, random, start, end),
            sensors=None
            if self.noise is None
            else SensorErrors(
                bias=self.noise * BIAS * random.standard_normal(len(BIAS)),
                white=self.noise * WHITE,
                seed=int(random.integers(2**32)),
            ),
            damping=uniform(self.damping),
            joint_friction=uniform(self.joint_friction) or 0.0,
            terrain=self._draw_terrain(random),
        )

    def _nominal(self, pushes: tuple[Push, ...]) -> Domain:
        """Returns the model's world. A Context keeps what a domain does not give."""
        from loco_drake.models.ground import STIFFNESS
        from loco_drake.models.plant import PlantConfig

        nothing = np.zeros(len(BIAS))
        sensors = SensorErrors(bias=nothing, white=nothing, seed=0)
        return Domain(
            friction=None if self.friction is None else PlantConfig().friction,
            stiffness=None if self.stiffness is None else STIFFNESS,
            payload=None if self.payload is None else 0.0,
            com_shift=None if self.com_shift is None else np.zeros(3),
            strength=None if self.motor_strength is None else np.ones(12),
            damping=None if self.damping is None else 1.0,
            pushes=pushes,
            sensors=None if self.noise is None else sensors,
        )

    def _draw_terrain(self, random: np.random.Generator) -> Terrain | None:
        if self.slope is self.roughness is None:
            return None
        gradient = np.zeros(2)
        if self.slope is not None:
            degrees = random.uniform(*self.slope)
            gradient = slope_gradient(degrees, random.uniform(-np.pi, np.pi))
        if self.roughness is None:
            return Terrain(gradient=gradient)
        return Terrain(
            gradient=gradient,
            roughness=random.uniform(*self.roughness),
            seed=int(random.integers(2**32)),
        )

    def _draw_pushes(
        self,
        robot: "SimulatedRobot",
        random: np.random.Generator,
        start: float,
        end: float,
    ) -> tuple[Push, ...]:
        from loco_drake.control.plan import PLAN_DT

        if self.push is None:
            return ()
        pushes = []
        time = start + random.uniform(*self.push_interval)
        while time < end:
            begin = round(time / PLAN_DT) * PLAN_DT  # of a control period
            size, angle = random.uniform(*self.push), random.uniform(-np.pi, np.pi)
            direction = np.array([np.cos(angle), np.sin(angle), 0.0])
            force = robot.mass * size / PUSH_DURATION * direction
            pushes.append(Push(start=begin, duration=PUSH_DURATION, force_W=force))
            time += random.uniform(*self.push_interval)
        return tuple(pushes)


STANDARD = RandomizationConfig(
    friction=(0.35, 1.25),
    stiffness=(2e4, 1e6),
    payload=(-1.0, 3.0),
    com_shift=(-0.03, 0.03),
    motor_strength=(0.85, 1.15),
    latency=(0.0, 0.02),
    push=(0.1, 0.8),
    noise=1.0,
)

# The pushes of `evaluate tracking --pushes`.
PUSHES = RandomizationConfig(push=(1.0, 1.0), push_interval=(2.0, 2.0))
