"""A source from a short YAML file that names six points of its BVH files or tables.

::

    source: cat
    withers: Neck
    hip: Pelvis
    toes: {FL: Paw_FL, FR: Paw_FR, RL: Paw_RL, RR: Paw_RR}
    units: cm

Up axis, ground, sides and rate are measured as those of every source are, see
:mod:`loco_drake.datasets.conventions`.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError, quoted
from loco_drake.common.typed_yaml import read_yaml
from loco_drake.datasets import registry
from loco_drake.datasets.conventions import turn_up, with_z_up
from loco_drake.datasets.gaps import LONGEST_GAP, mend_gaps, usable_stretch
from loco_drake.datasets.named_points import NamedPoints, read_points
from loco_drake.datasets.recording import (
    Recording,
    check_frames,
    check_rate,
)
from loco_drake.datasets.registry import Dataset, get_dataset, register_dataset
from loco_drake.models.legs import LEGS

SUFFIXES = (".yaml", ".yml")
# Metres in each.
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
AXES = ("x", "y", "z", "-x", "-y", "-z")

# A joint, a path of joints, the number of a point, or several whose middle it is.
Point = str | int | list[str | int]


@dataclass(kw_only=True)
class Skeleton:
    """What a file of recordings of one animal calls its points."""

    # Name of the animal, the source in gait labels. Default: letters of the file's.
    source: str = ""
    # The trunk over the front legs, and the pelvis.
    withers: Point = ""
    hip: Point = ""
    # By FL, FR, RL and RR.
    toes: dict[str, Point] = field(default_factory=dict)
    # Unit of length: one of UNITS, or how many metres it has.
    units: str | float = "m"
    # Axis that points up, such as y or -z. Default: along which the trunk is above the
    # toes.
    up: str = ""
    # Frames per second. Default: those of the BVH file, or by the table's time.
    fps: float | None = None
    # Of a table whose header does not tell: the three columns of each point, by names
    # or numbers from 0.
    columns: dict[str, list[str | int]] = field(default_factory=dict)
    # For the provenance of all that is made of the recordings.
    licence: str = "not stated"
    attribution: str = "not stated"
    # Fields of retargeting.scaling.RetargetConfig.
    retargeting: dict[str, Any] = field(default_factory=dict)

    @property
    def metres(self) -> float:
        """Metres in a unit of length."""
        return UNITS[self.units] if isinstance(self.units, str) else self.units

    @property
    def points(self) -> list[Point]:
        """Withers, hip and toes FL, FR, RL, RR."""
        return [self.withers, self.hip, *(self.toes[leg] for leg in LEGS)]


def read_skeleton(path: Path) -> Skeleton:
    """Returns the skeleton in a YAML file.

    Raises:
        InputError: naming what is missing, unknown or impossible.
    """
    path = Path(path)
    skeleton = read_yaml(path, Skeleton, "a skeleton's file")
    skeleton.source = skeleton.source or plain_source(path.stem)
    try:
        _check(skeleton)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return skeleton


def plain_source(stem: str) -> str:
    """Returns the name of a source for a file's: ``my_cat`` becomes ``mycat``."""
    return "".join(filter(str.isalnum, stem.lower()))


def _check(skeleton: Skeleton) -> None:
    missing = [
        n for n in ("withers", "hip", "toes") if getattr(skeleton, n) in ("", {})
    ]
    if missing:
        raise InputError(f"It lacks {', '.join(missing)}.")
    if set(skeleton.toes) != set(LEGS):
        raise InputError(
            f"toes must be {', '.join(LEGS)}, not {', '.join(sorted(skeleton.toes))}."
        )
    points = [str(point) for point in skeleton.points]
    if twice := sorted({p for p in points if points.count(p) > 1}):
        raise InputError(f"{twice[0]} is named twice.")
    if skeleton.units not in UNITS and not (
        isinstance(skeleton.units, float) and 0 < skeleton.units < float("inf")
    ):
        raise InputError(
            f"units must be {', '.join(UNITS)}, or the metres in a unit, not "
            f"{quoted(skeleton.units)}."
        )
    if skeleton.up not in ("", *AXES):
        raise InputError(f"up must be {', '.join(AXES)}, not {quoted(skeleton.up)}.")
    if skeleton.fps is not None:
        if not isfinite(skeleton.fps):
            raise InputError(f"fps must be a rate, not {skeleton.fps}.")
        check_rate(skeleton.fps)


def load_source(definition: str) -> str:
    """Returns the name of a source, given by it or by a skeleton's YAML file.

    A file's source is registered in this process.

    Raises:
        InputError: if there is no such source, or the file will not do.
    """
    if Path(definition).suffix in SUFFIXES:
        return load_sources([Path(definition)])[0]
    try:
        get_dataset(definition)
    except InputError as error:
        choices = str(error).removesuffix(".")
        raise InputError(f"{choices}, or a skeleton's YAML file.") from None
    return definition


def load_sources(paths: Iterable[Path]) -> list[str]:
    """Registers the sources of skeletons' YAML files; returns their names.

    Raises:
        InputError: if a file will not do, or its source has the name of another.
    """
    names = []
    for path in paths:
        skeleton = read_skeleton(path)
        dataset = Dataset(
            source=skeleton.source,
            folder=skeleton.source,
            licence=skeleton.licence,
            attribution=skeleton.attribution,
            read=partial(read_recording, skeleton),
            config=skeleton.retargeting,
            definition=Path(path).resolve(),
        )
        try:
            register_dataset(dataset)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        names.append(skeleton.source)
    return names


def loaded_files() -> tuple[Path, ...]:
    """Returns the YAML files of the sources registered here, for worker processes."""
    files = (dataset.definition for dataset in registry.DATASETS.values())
    return tuple(file for file in files if file is not None)


def read_recording(
    skeleton: Skeleton,
    path: Path,
    start: int | None,
    end: int | None,
    fps: float | None,
) -> Recording:
    """Reads a BVH file or a table of points by a skeleton.

    Raises:
        InputError: if it is neither, or lacks a point, naming those that it has; if its
            rate is unknown, or points are missing in the stretch.
    """
    named = read_points(path, skeleton.columns)
    rate = fps or skeleton.fps or named.fps
    if rate is None:
        raise InputError(
            "its rate is not in the file; give its frames per second as fps in the "
            "skeleton's YAML file, or with --fps."
        )
    check_frames(named.positions)
    check_rate(rate)
    points = skeleton.metres * pick(named, skeleton.points)
    notes: dict[str, str] = {}
    points, bridged = mend_gaps(points, round(LONGEST_GAP * rate))
    if bridged:
        notes["gaps"] = f"{bridged} frames bridged"
    whole, first = usable_stretch(points, start, end)
    points = points[whole]
    if skeleton.up:
        axis = "xyz".index(skeleton.up[-1])
        points = with_z_up(points, axis, len(skeleton.up) == 1)
    else:
        points = turn_up(points, {})
    return Recording(points, rate, whole.start, first, notes)


def pick(named: NamedPoints, points: Iterable[Point]) -> Array:
    """Returns the positions of points, each the middle of its joints, (T, P, 3).

    Raises:
        InputError: if there is no such joint; names those that there are.
    """
    picked = []
    for point in points:
        parts = point if isinstance(point, list) else [point]
        if not parts:
            raise InputError("A point of the skeleton is an empty list.")
        found = [named.find(str(part)) for part in parts]
        picked.append(named.positions[:, found].mean(axis=1))
    return np.stack(picked, axis=1)
