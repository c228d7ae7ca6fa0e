"""The weights that come with the examples of robots of one's own."""

import json

import pytest
import torch

from loco_drake.cli.main import main
from loco_drake.generation.motion_model import pretrained_motion_model
from loco_drake.generation.tokenizer import BODY_ROWS, load_tokenizer
from loco_drake.models.robots import get_robot
from loco_drake.models.shipped import network_path, own_weights, pretrained_path
from tests.robot_files import OWN

pytestmark = pytest.mark.slow


@pytest.fixture(params=tuple(OWN))
def name(request):
    return request.param


def test_the_tokenizer_is_the_shipped_one_with_a_body(name):
    """Robots that it knew are encoded and decoded as before, to the last bit."""
    robot = get_robot(str(OWN[name]))
    own = load_tokenizer(network_path(robot, "tokenizer"))
    shipped = load_tokenizer(pretrained_path("tokenizer"))
    assert own.config.robots == (*shipped.config.robots, name)
    assert own.fingerprint == shipped.fingerprint
    state = own.state_dict()
    for key, value in shipped.state_dict().items():
        kept = state[key][: len(value)] if key in BODY_ROWS else state[key]
        assert torch.equal(kept, value), key
    assert set(own_weights(robot)) == {"tokenizer", "policy"}
    assert pretrained_motion_model(robot.definition).robot is robot


@pytest.mark.parametrize("gait", ["horse-trot", "solo8-walk"])
def test_it_walks_out_of_the_box(name, gait, tmp_path, capsys):
    path = tmp_path / "figures.json"
    line = f"simulate --robot {OWN[name]} --gait {gait} --no-meshcat --duration 3"
    assert main([*line.split(), "--json", str(path)]) == 0
    figures = json.loads(path.read_text())
    assert not figures["fell"]
    assert figures["normalized_return"] > 80
    assert figures["speed_mps"] > 0.3
