"""The weights that come with the package."""

from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from loco_drake.generation.motion_model import MotionModel, load_motion_model


def pretrained_path(name: str) -> Path:
    """Returns where the shipped weights called ``name`` are, such as "tokenizer"."""
    # Wheels and checkouts both lie in ordinary folders.
    return Path(str(files("loco_drake.models") / "pretrained" / f"{name}.safetensors"))


@lru_cache
def pretrained_motion_model(robot: str) -> MotionModel:
    """Returns the shipped motion model for ``robot``; it is loaded once.

    Raises:
        InputError: if there are no weights for that robot.
    """
    return load_motion_model(
        pretrained_path("tokenizer"), pretrained_path("generator"), robot
    )
