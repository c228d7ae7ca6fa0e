"""Fixtures for tests of commands that simulate."""

import pytest
import torch

from loco_drake.control.actor import Actor, ActorConfig
from loco_drake.control.actor_file import save_actor
from loco_drake.motion.motion_file import save_motion
from tests.synthetic_motion import synthetic_motion


@pytest.fixture(scope="session")
def weights(tmp_path_factory):
    """Policies that know nothing: one leaves the reference alone, one tumbles."""
    folder = tmp_path_factory.mktemp("weights")
    for name, bias in (("calm", 0.0), ("wild", 8.0)):
        actor = Actor(ActorConfig(robot="go2", labels=["dog-trot"]))
        last = actor.layers[-1]
        with torch.no_grad():
            last.weight.zero_()
            # Stretches the front legs and folds the rear ones.
            last.bias.copy_(bias * torch.tensor([0, 1, 1] * 2 + [0, -1, -1] * 2))
        save_actor(actor, folder / f"{name}.safetensors")
    return folder


@pytest.fixture(scope="session")
def references(tmp_path_factory):
    """A folder with one Motion file of a Go2, a slow trot of two seconds."""
    folder = tmp_path_factory.mktemp("references")
    save_motion(synthetic_motion("dog-trot", 2.0, 0.3), folder / "trot.npz")
    return folder
