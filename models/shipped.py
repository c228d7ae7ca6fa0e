"""The weights that come with the package."""

from importlib import resources
from pathlib import Path

from loco_drake.common.errors import InputError

from .robots import ROBOTS, Robot


def pretrained_dir() -> Path:
    """Returns the folder of the shipped weights."""
    return Path(str(resources.files("loco_drake.models"))) / "pretrained"


def pretrained_path(name: str) -> Path:
    """Returns where the shipped weights called ``name`` are, such as "tokenizer"."""
    return pretrained_dir() / f"{name}.safetensors"


def policy_variants(robot: Robot) -> dict[str, Path]:
    """Returns by name the shipped policies of ``robot`` other than its main one."""
    prefix = f"policy_{robot.name}_"
    files = sorted(pretrained_dir().glob(f"{prefix}*.safetensors"))
    return {file.stem.removeprefix(prefix): file for file in files}


def policy_path(robot: Robot, policy: Path | None = None) -> Path:
    """Returns the file of a policy's weights.

    Args:
        robot: that it moves.
        policy: a file of weights, which is returned as it is, or the bare name of a
            shipped variant, such as "randomized"; the shipped policy if not given.

    Raises:
        InputError: if there is no such policy, naming those that there are.
    """
    if policy is None:
        return _main(robot)
    if policy.name != str(policy) or policy.suffix or policy.exists():
        return policy
    variants = policy_variants(robot)
    if str(policy) not in variants:
        names = ", ".join(variants)
        raise InputError(
            f"There are no policy weights at {str(policy)!r}, and no shipped policy of "
            f"{robot.name} has that name; "
            + (f"there are {names}." if names else "there is but the main one.")
        )
    return variants[str(policy)]


def _main(robot: Robot) -> Path:
    paths = {name: pretrained_dir() / f"policy_{name}.safetensors" for name in ROBOTS}
    shipped = [name for name, path in paths.items() if path.is_file()]
    if robot.name not in shipped:
        raise InputError(
            f"There are no policy weights for {robot.name} yet; "
            f"there are some for {', '.join(shipped) or 'no robot'}."
        )
    return paths[robot.name]
