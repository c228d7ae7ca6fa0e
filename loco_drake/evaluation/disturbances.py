"""What a robot is to survive in ``evaluate robustness``: kinds, sizes, and worlds.

============ ======== ================================================================
kind         unit     what happens
============ ======== ================================================================
push         N s      impulse of a force on the trunk that lasts .1 s, forward, back,
                      left or right in the plan's heading; it begins when the plan's FL
                      lands for the first time after 2 s, or half a stride later: in
                      turns, from way to way, level to level and seed to seed
slope        degrees  ground that rises along, against or across the x axis, along which
                      plans begin
step         m        a step up across the way, .3 m ahead of the plan's base at 1.5 s
friction              Coulomb coefficient of the ground; a contact has the harmonic mean
                      with the feet's .8
payload      kg       mass added to the trunk
latency      s        delay of the set-points
============ ======== ================================================================
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from loco_drake.common.errors import check_choice
from loco_drake.common.rotations import yaw_of
from loco_drake.control.domain import Domain, Push
from loco_drake.control.plan import PLAN_DT, Plan
from loco_drake.control.state import ORIENTATION, POSITION
from loco_drake.control.terrain import Terrain, slope_gradient
from loco_drake.models.legs import LEGS
from loco_drake.tracking.randomization import PUSH_DURATION

DURATION = 6.0  # s, of every episode
_PUSH_TIME = 2.0  # s, when the first landing is looked for
_PHASES = (0, 50)  # % of a stride after the landing of FL
_LANDING = LEGS.index("FL")
_LONGEST_STRIDE = 1.5  # s; a plan that has none by then is pushed all the same
_STEP_TIME, _STEP_AHEAD = 1.5, 0.3  # s, m


@dataclass(frozen=True)
class Kind:
    """A kind of disturbance."""

    title: str
    unit: str  # for people
    factor: float  # takes levels to that unit
    nominal: float  # the level of the undisturbed world
    levels: tuple[float, ...]  # from mild to severe
    ways: tuple[str, ...] = ("",)  # directions, each of which is tried


KINDS = {
    "push": Kind(
        "push", "N s", 1, 0.0, (8, 16, 24, 32), ("forward", "back", "left", "right")
    ),
    "slope": Kind("slope", "°", 1, 0.0, (3, 6, 10), ("up", "down", "side")),
    "step": Kind("step", "cm", 100, 0.0, (0.01, 0.03, 0.05)),
    "friction": Kind("friction", "", 1, 0.8, (0.5, 0.3, 0.2)),
    "payload": Kind("payload", "kg", 1, 0.0, (2, 4, 8)),
    "latency": Kind("latency", "ms", 1000, 0.0, (0.01, 0.02, 0.04)),
}
_ANGLES = dict(
    zip(KINDS["push"].ways, (0.0, np.pi, np.pi / 2, -np.pi / 2), strict=True)
)
_RISES = dict(zip(KINDS["slope"].ways, (0.0, np.pi, np.pi / 2), strict=True))


@dataclass(frozen=True)
class Disturbance:
    """One kind at one level; none if the kind is empty."""

    kind: str = ""
    level: float = 0.0
    way: str = ""  # of the kind's ways
    phase: int = 0  # of a push, % of a stride

    @property
    def curves(self) -> list[str]:
        """The names of the curves that it belongs to."""
        names = [self.kind]
        if self.way:
            names.append(f"{self.kind}_{self.way}")
        if self.kind == "push":
            names.append(f"push_phase_{self.phase}")
        return names


def disturbances(kinds: Sequence[str], seed: int = 0) -> Iterator[Disturbance]:
    """Yields all disturbances of these kinds, for the plans of a seed.

    Raises:
        InputError: if a kind is unknown.
    """
    for kind in kinds:
        check_choice("kind", kind, KINDS)
    for kind in kinds:
        known = KINDS[kind]
        places = product(enumerate(known.levels), enumerate(known.ways))
        for (i, level), (j, way) in places:
            phase = _PHASES[(i + j + seed) % 2] if kind == "push" else 0
            yield Disturbance(kind, level, way, phase)


def curve_names(kinds: Sequence[str]) -> list[str]:
    """Returns the names of all curves of these kinds, in order."""
    names: dict[str, None] = {}
    for kind in kinds:
        for disturbance in disturbances([kind]):
            names |= dict.fromkeys(disturbance.curves)
    return sorted(names, key=lambda name: list(KINDS).index(name.split("_")[0]))


def push_of(plan: Plan, disturbance: Disturbance) -> Push:
    """Returns the push of a disturbance of that kind, on a plan that starts at 0."""
    begin = push_sample(plan, disturbance.phase)
    angle = yaw_of(plan.q[ORIENTATION])[begin] + _ANGLES[disturbance.way]
    direction = np.array([np.cos(angle), np.sin(angle), 0.0])
    force = disturbance.level / PUSH_DURATION * direction
    return Push(start=begin * PLAN_DT, duration=PUSH_DURATION, force_W=force)


def push_sample(plan: Plan, phase: int) -> int:
    """Returns the sample at which a push begins, see above; ``phase`` is in %."""
    start = round(_PUSH_TIME / PLAN_DT)
    down = plan.contacts[start : start + round(2 * _LONGEST_STRIDE / PLAN_DT), _LANDING]
    landings = start + 1 + np.flatnonzero(down[1:] & ~down[:-1])
    if len(landings) == 0:
        return start
    stride = landings[1] - landings[0] if len(landings) > 1 else 0
    return int(landings[0] + round(phase / 100 * stride))


def domain_of(plan: Plan, disturbance: Disturbance) -> Domain:
    """Returns the world of a disturbance, for a plan that starts at 0."""
    level = disturbance.level
    if disturbance.kind == "push":
        return Domain(pushes=(push_of(plan, disturbance),))
    if disturbance.kind == "slope":
        gradient = slope_gradient(level, _RISES[disturbance.way])
        return Domain(terrain=Terrain(gradient=gradient))
    if disturbance.kind == "step":
        x = float(plan.q[POSITION][plan.index(_STEP_TIME), 0]) + _STEP_AHEAD
        terrain = Terrain(gradient=np.zeros(2), step=level, step_x=max(0.0, x))
        return Domain(terrain=terrain)
    if disturbance.kind == "friction":
        return Domain(friction=level)
    if disturbance.kind == "payload":
        return Domain(payload=level)
    return Domain(latency=level) if disturbance.kind == "latency" else Domain()
