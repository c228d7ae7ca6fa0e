"""Quadruped locomotion learned from diverse motion, simulated in Drake.

The names below are what scripts need; each is imported when it is first asked for, so
that importing the package costs nothing. The parts that they come from, in the order in
which motion flows through them: :mod:`datasets`, :mod:`retargeting`, :mod:`generation`,
:mod:`control`, :mod:`systems`, :mod:`tracking`, :mod:`evaluation`; the robots are in
:mod:`models`. Importing the package makes ``gymnasium.make("loco_drake/Tracking-v0")``
known.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import gymnasium

if TYPE_CHECKING:
    from loco_drake.common.errors import InputError as InputError
    from loco_drake.control.actor_file import load_actor as load_actor
    from loco_drake.control.domain import Domain as Domain
    from loco_drake.control.plan import Plan as Plan
    from loco_drake.control.plan import plan_from_motion as plan_from_motion
    from loco_drake.generation.generate import generate_motion as generate  # noqa: F401
    from loco_drake.generation.motion_model import (
        pretrained_motion_model as pretrained_motion_model,
    )
    from loco_drake.models.robots import get_robot as get_robot
    from loco_drake.motion.motion import Motion as Motion
    from loco_drake.motion.motion_file import load_motion as load_motion
    from loco_drake.motion.motion_file import save_motion as save_motion
    from loco_drake.retargeting.retarget import retarget_clip as retarget  # noqa: F401
    from loco_drake.systems.diagram import AddLocomotion as AddLocomotion
    from loco_drake.systems.diagram import (
        MakeLocomotionDiagram as MakeLocomotionDiagram,
    )
    from loco_drake.systems.domain import SetDomain as SetDomain
    from loco_drake.systems.scenario import LoadScenario as LoadScenario
    from loco_drake.systems.scenario import Scenario as Scenario
    from loco_drake.systems.simulator import MakeSimulator as MakeSimulator
    from loco_drake.systems.simulator import StartEpisode as StartEpisode
    from loco_drake.tracking.environment import TrackingEnv as TrackingEnv

__version__ = "0.1.0"

_FROM = {
    "AddLocomotion": "systems.diagram",
    "Domain": "control.domain",
    "InputError": "common.errors",
    "LoadScenario": "systems.scenario",
    "MakeLocomotionDiagram": "systems.diagram",
    "MakeSimulator": "systems.simulator",
    "Motion": "motion.motion",
    "Plan": "control.plan",
    "Scenario": "systems.scenario",
    "SetDomain": "systems.domain",
    "StartEpisode": "systems.simulator",
    "TrackingEnv": "tracking.environment",
    "generate": "generation.generate:generate_motion",
    "get_robot": "models.robots",
    "load_actor": "control.actor_file",
    "load_motion": "motion.motion_file",
    "plan_from_motion": "control.plan",
    "pretrained_motion_model": "generation.motion_model",
    "retarget": "retargeting.retarget:retarget_clip",
    "save_motion": "motion.motion_file",
}
__all__ = list(_FROM)


def __getattr__(name: str) -> Any:
    if name not in _FROM:
        raise AttributeError(f"module 'loco_drake' has no attribute {name!r}")
    module, _, function = _FROM[name].partition(":")
    return getattr(import_module(f"loco_drake.{module}"), function or name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]


# Since version 1 of Gymnasium there are no entry points for this.
gymnasium.register(
    id="loco_drake/Tracking-v0",
    entry_point="loco_drake.tracking.environment:make_tracking",
)
