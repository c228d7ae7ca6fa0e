"""A policy of two networks, from two that were trained by themselves."""

from dataclasses import replace
from pathlib import Path

import torch

from loco_drake.common.errors import InputError
from loco_drake.control.actor import Actor
from loco_drake.control.actor_file import make_actor, read_actor, save_actor
from loco_drake.control.recovery import RECOVERY


def joined(near: Actor, far: Actor, recovery: list[float] | None = None) -> Actor:
    """Returns a policy that acts as ``near`` near the plan and as ``far`` far from it.

    Both must have networks of the same widths, and one network each. Observations are
    normalized as those of ``near``; the first layer of ``far`` makes up for that, if
    the statistics of both are symmetric.

    Args:
        near: acts at distances below the thresholds.
        far: acts from about 1.4 times these on.
        recovery: the thresholds; by default RECOVERY.

    Raises:
        ValueError: if the networks do not fit.
    """
    if near.config.hidden != far.config.hidden:
        raise ValueError("networks of other widths")
    actor = make_actor(replace(near.config, recovery=recovery or RECOVERY))
    actor.layers.load_state_dict(near.layers.state_dict())
    actor.recovery.load_state_dict(far.layers.state_dict())
    actor.mean.copy_(near.mean)
    actor.variance.copy_(near.variance)
    first = actor.recovery[0]
    assert isinstance(first, torch.nn.Linear)
    with torch.no_grad():
        deviation = torch.sqrt(far.variance + 1e-8)
        first.bias.add_(first.weight @ ((near.mean - far.mean) / deviation))
        first.weight.mul_(torch.sqrt(near.variance + 1e-8) / deviation)
    return actor.eval()


def near_of(actor: Actor) -> Actor:
    """Returns the network that acts near the plan, by itself."""
    return _alone(actor, actor.layers)


def recovery_of(actor: Actor) -> Actor | None:
    """Returns the network that acts far from the plan, by itself, if there is one."""
    return _alone(actor, actor.recovery) if actor.config.recovery else None


def join_policies(near: Path, far: Path, target: Path) -> None:
    """Writes the policy of two policy files; a training begins with that of ``near``.

    Raises:
        InputError: if a file is missing or damaged, or they do not fit.
    """
    (one, learner), (other, _) = map(read_actor, (near, far))
    configs = [replace(actor.config, labels=[]) for actor in (one, other)]
    if configs[0] != configs[1] or configs[0].recovery or configs[0].history:
        raise InputError(f"The policies in {near} and {far} do not fit each other.")
    save_actor(joined(one, other), target, learner=learner)


def _alone(actor: Actor, layers: torch.nn.Module) -> Actor:
    """Returns a policy of one of a policy's networks."""
    alone = make_actor(replace(actor.config, recovery=None))
    alone.layers.load_state_dict(layers.state_dict())
    alone.mean.copy_(actor.mean)
    alone.variance.copy_(actor.variance)
    return alone.eval()
