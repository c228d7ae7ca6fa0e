"""The shipped weights."""

from pathlib import Path
from typing import TYPE_CHECKING

from loco_drake.common.errors import InputError

# Help of commands lists the policies, and does not wait for Drake.
if TYPE_CHECKING:
    from .simulated import SimulatedRobot

_HOW_TO_TRAIN = " Train one with loco-drake train tracker, and give it with --policy"
_OR_NAME_IT = ", or name its folder as weights in the robot's file."


def pretrained_dir() -> Path:
    """Returns the folder of the shipped weights."""
    return Path(__file__).parent / "pretrained"


def pretrained_path(name: str) -> Path:
    """Returns the path of the shipped weights ``name``, such as "tokenizer"."""
    return pretrained_dir() / f"{name}.safetensors"


def weights_in(folder: Path) -> dict[str, Path]:
    """Returns the weights in a folder of runs, by "tokenizer", "generator", "policy".

    They are in the folder itself, which may be that of a run, or in those of its runs,
    such as ``runs/tokenizer/tokenizer.safetensors``. Those that are not there are left
    out.

    Raises:
        InputError: if there are none, or several of a kind in the folder's runs.
    """
    found: dict[str, Path] = {}
    for kind in ("tokenizer", "generator", "policy"):
        name = f"{kind}.safetensors"
        files = sorted(folder.glob(name)) or sorted(folder.glob(f"[!.]*/{name}"))
        if len(files) > 1:
            places = ", ".join(str(file.parent) for file in files)
            raise InputError(
                f"Several runs in {str(folder)!r} have a {kind}: {places}; name one "
                f"with --{kind}, or the folder of a run."
            )
        if files:
            found[kind] = files[0]
    if not found:
        raise InputError(
            f"There are no weights in {str(folder)!r}, nor in the runs in it: neither "
            "tokenizer.safetensors, generator.safetensors nor policy.safetensors."
        )
    return found


def chosen_weights(folder: Path | None, **files: Path | None) -> dict[str, Path | None]:
    """Returns weights by kind: those of ``files``, else those in a folder of runs.

    Raises:
        InputError: as :func:`weights_in`.
    """
    found = weights_in(folder) if folder is not None else {}
    return {kind: file or found.get(kind) for kind, file in files.items()}


def shipped_policies() -> dict[str, Path]:
    """Returns the shipped policies: "go2", "go2_unprivileged", and so on."""
    return {
        file.stem.removeprefix("policy_"): file
        for file in sorted(pretrained_dir().glob("policy_*.safetensors"))
    }


def policy_variants(robot: "SimulatedRobot") -> dict[str, Path]:
    """Returns the shipped policies of ``robot`` except the main one, by name."""
    prefix = f"{robot.name}_"
    shipped = shipped_policies().items()
    return {k.removeprefix(prefix): f for k, f in shipped if k.startswith(prefix)}


def own_weights(robot: "SimulatedRobot") -> dict[str, Path]:
    """Returns the weights in the folder that a robot's file names, as weights_in.

    Raises:
        InputError: if there is no such folder, or it has several of a kind.
    """
    if robot.weights is None:
        return {}
    if not robot.weights.is_dir():
        raise InputError(
            f"{robot.definition} names the weights {str(robot.weights)!r}, but there "
            "is no such folder."
        )
    return weights_in(robot.weights)


def network_path(robot: "SimulatedRobot", kind: str) -> Path:
    """Returns a robot's weights of a kind, its own or the shipped "tokenizer", ...

    Raises:
        InputError: as :func:`own_weights`.
    """
    return own_weights(robot).get(kind, pretrained_path(kind))


def policy_path(robot: "SimulatedRobot", policy: Path | None = None) -> Path:
    """Returns the weights file of a policy.

    ``policy`` is a weights file, which is returned as it is, or the name of a shipped
    variant, such as "unprivileged"; by default it is the robot's main policy: the
    shipped one, or that in the folder that the robot's file names.

    Raises:
        InputError: if there is no such policy; names the existing ones.
    """
    if policy is None:
        shipped = pretrained_path(f"policy_{robot.name}")
        main = own_weights(robot).get("policy", shipped)
        if not main.is_file():
            from .biped import Biped
            from .robots import ROBOTS

            how = "" if robot.name in ROBOTS else _HOW_TO_TRAIN
            how += "." if isinstance(robot, Biped) else _OR_NAME_IT * bool(how)
            present = [n for n in ROBOTS if pretrained_path(f"policy_{n}").is_file()]
            raise InputError(
                f"There are no policy weights for {robot.name} yet; "
                f"there are some for {', '.join(present) or 'no robot'}." + how
            )
        return main
    if policy.name != str(policy) or policy.suffix or policy.exists():
        return policy
    variants = policy_variants(robot)
    if str(policy) not in variants:
        names = ", ".join(variants)
        raise InputError(
            f"There are no policy weights at {str(policy)!r}, and no shipped policy of "
            f"{robot.name} has that name; "
            + (f"there are {names}." if names else "there is only the main one.")
        )
    return variants[str(policy)]


def training_path(name: Path) -> Path:
    """Returns the file that a training starts from.

    ``name`` is a file, which is returned as it is, or a shipped policy: a robot, or a
    robot and a variant, such as "a1_unprivileged".

    Raises:
        InputError: if there is neither; names the shipped policies.
    """
    if name.is_file():
        return name
    shipped = shipped_policies()
    if str(name) not in shipped:
        raise InputError(
            f"There is nothing to start from at {str(name)!r}; give a checkpoint or "
            f"policy of a run, or a shipped policy: {', '.join(shipped) or 'none'}."
        )
    return shipped[str(name)]


def results_path(name: str) -> Path:
    """Returns the path of shipped figures, such as "steering-go2"."""
    return pretrained_dir() / "results" / f"{name}.json"
