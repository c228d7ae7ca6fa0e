"""Retargeting configuration of a source, a short YAML file."""

from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path

from loco_drake.common.errors import InputError
from loco_drake.common.typed_yaml import read_yaml
from loco_drake.datasets.registry import get_dataset

_FOLDER = Path(__file__).parent / "sources"


@dataclass(kw_only=True)
class ContactConfig:
    """Contact thresholds; see :mod:`loco_drake.retargeting.contacts`."""

    # A toe lands below the first height and leaves above the second, both as fractions
    # of the stance height.
    land_height: float = 0.05
    leave_height: float = 0.09
    # ... and when it is slower, or faster, than these fractions of the trunk's speed,
    # or than these speeds in m/s where that is more.
    land_speed_ratio: float = 0.35
    leave_speed_ratio: float = 0.5
    land_speed: float = 0.4
    leave_speed: float = 0.7
    # Shorter contacts and shorter flights are taken for noise; s.
    shortest_stance: float = 0.04
    shortest_swing: float = 0.06


@dataclass(kw_only=True)
class SmoothingConfig:
    """Cut-off frequencies of the zero-phase low-pass filters, in Hz."""

    # Of the trunk's position, heading and pitch.
    base: float = 5.0
    # Of the toes.
    toes: float = 7.0


@dataclass(kw_only=True)
class RetargetConfig:
    """Parameters that map the keypoints of one source to targets of a robot."""

    # The source's stance height in m, where all its clips are of one body that may
    # creep or stand tall. Without it, it is clip by clip this percentile of the height
    # of the middle between withers and hip.
    stance_height: float | None = None
    stance_height_percentile: float = 50.0
    # Where the virtual hip joints lie, on the line from hip to withers: ahead of the
    # withers and ahead of the hip, and to the sides of that line, as fractions of the
    # stance height.
    front_hip: float = 0.0
    rear_hip: float = 0.0
    hip_spread: float = 0.0
    # Added to the height of the robot's trunk, m.
    base_height_offset: float = 0.0
    # Multiplies the height of the toes beside the scale.
    swing_height: float = 1.0
    contact: ContactConfig = field(default_factory=ContactConfig)
    smoothing: SmoothingConfig = field(default_factory=SmoothingConfig)


def load_config(source: str) -> RetargetConfig:
    """Returns the configuration of a source: its dataset's, or the shipped one.

    A dataset that has neither gets the defaults.

    Raises:
        InputError: naming the sources that there are.
    """
    own, shipped = get_dataset(source).config, _FOLDER / f"{source}.yaml"
    if own is None and not shipped.is_file():
        return RetargetConfig()
    return read_config(own or shipped)


def read_config(path: Path) -> RetargetConfig:
    """Returns the configuration in a YAML file; fields not named keep their default.

    Raises:
        InputError: if the file is missing, names an unknown field, or holds a value
            that cannot be.
    """
    config = read_yaml(path, RetargetConfig, "a retargeting configuration")
    above_0 = {
        "swing_height": config.swing_height,
        "stance_height": 1.0 if config.stance_height is None else config.stance_height,
        **{f"smoothing.{key}": value for key, value in vars(config.smoothing).items()},
        **{f"contact.{key}": value for key, value in vars(config.contact).items()},
    }
    for name, value in above_0.items():
        if not 0 < value < float("inf"):
            raise InputError(f"{path}: {name} must be above 0, not {value}.")
    for name in ("front_hip", "rear_hip", "hip_spread", "base_height_offset"):
        if not isfinite(value := getattr(config, name)):
            raise InputError(f"{path}: {name} must be finite, not {value}.")
    if not 0 <= config.stance_height_percentile <= 100:
        raise InputError(f"{path}: stance_height_percentile must be within 0 to 100.")
    return config
