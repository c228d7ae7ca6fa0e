"""Made motions, alone and by the folder."""

from pathlib import Path

import pytest

from loco_drake.common.weights import save_network
from loco_drake.motion.motion_file import save_motion
from tests.synthetic_motion import synthetic_motion
from tests.tiny_model import make_tiny_model


@pytest.fixture
def make_synthetic():
    """The function that makes a motion."""
    return synthetic_motion


@pytest.fixture(scope="session")
def motions(tmp_path_factory) -> Path:
    """A folder of eight motions: of two labels two recordings each, one held out."""
    folder = tmp_path_factory.mktemp("motions")
    for label in ("dog-trot", "dog-pace"):
        for i, (speed, turn) in enumerate(
            ((0.6, 0.0), (0.7, 0.3), (0.9, 0.0), (1.0, -0.2))
        ):
            motion = synthetic_motion(
                label,
                3.0,
                speed,
                turn,
                phase=0.1 * i,
                recording=f"{label}{i // 2}",
                split=("train", "validation")[i // 2],
            )
            save_motion(motion, folder / f"{label}-{i}.npz")
    return folder


@pytest.fixture(scope="module")
def model():
    return make_tiny_model()


@pytest.fixture(scope="module")
def base(model, tmp_path_factory):
    """The file of a tokenizer that knows the Go2, and was trained on one recording."""
    path = tmp_path_factory.mktemp("base") / "tokenizer.safetensors"
    info = {"training": {"recordings": {"dog-other": {"go2": 3.0}}}}
    save_network(path, "tokenizer", model.tokenizer, info)
    return path
