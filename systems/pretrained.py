"""The weights that come with the package."""

from importlib import resources
from pathlib import Path

from loco_drake.errors import InputError
from loco_drake.models.robots import ROBOTS, Robot


def pretrained_dir() -> Path:
    """Returns the folder of the shipped weights."""
    return Path(str(resources.files("loco_drake.models"))) / "pretrained"


def policy_path(robot: Robot) -> Path:
    """Returns the shipped policy of ``robot``.

    Raises:
        InputError: naming the robots that have one, if this robot has none.
    """
    paths = {name: pretrained_dir() / f"policy_{name}.safetensors" for name in ROBOTS}
    shipped = [name for name, path in paths.items() if path.is_file()]
    if robot.name not in shipped:
        raise InputError(
            f"There are no policy weights for {robot.name} yet; "
            f"there are some for {', '.join(shipped) or 'no robot'}."
        )
    return paths[robot.name]
