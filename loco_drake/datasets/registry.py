"""Registry of the sources of motion: folder, licence and reader of each."""

import logging
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.common.yaml import yaml_load

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError, check_choice, one_line
from loco_drake.common.files import cache_dir
from loco_drake.datasets import dog, horse, mpc, solo8
from loco_drake.datasets.conventions import measure
from loco_drake.datasets.recording import (
    Body,
    Recording,
    check_frames,
    check_range,
    check_rate,
)
from loco_drake.motion.keypoints import KeypointClip

DATA_VARIABLE = "LOCO_DRAKE_DATA"
# Entry point group in which installed packages register datasets.
ENTRY_POINTS = "loco_drake.datasets"
# Corrections of contradictions to the format, which are logged as warnings.
MENDED = ("up", "turned", "swapped", "ground")


@dataclass(frozen=True)
class Dataset:
    """One source of motion."""

    source: str  # its name, such as dog: lower-case letters and digits
    folder: str  # name of its folder inside the data folder
    licence: str  # licence of its files and of everything derived from them
    attribution: str  # authors to name
    # Reads one file, given its path, the first and end frame of interest and the rate,
    # each None if unknown. It may return more frames. Raises InputError for another
    # format.
    read: Callable[[Path, int | None, int | None, float | None], Recording]
    body: Body = field(default_factory=Body)  # bounds that recordings must satisfy
    # Its retargeting configuration, see retargeting.scaling, or a YAML file of it; if
    # None, loco_drake/retargeting/sources/SOURCE.yaml or the defaults.
    config: Path | Mapping[str, Any] | None = None
    # The YAML file that describes it, see datasets.skeleton.
    definition: Path | None = None


DATASETS: dict[str, Dataset] = {}


def register_dataset(dataset: Dataset) -> None:
    """Registers a source in this process; an entry point registers it in all.

    A source from the same YAML file is replaced.

    Raises:
        InputError: if its name or folder cannot be, or is taken.
    """
    if not (dataset.source.isalnum() and dataset.source.islower()):
        raise InputError(
            "The name of a source has lower-case letters and digits only, unlike "
            f"{dataset.source!r}."
        )
    if dataset.folder in ("", ".", "..") or Path(dataset.folder).name != dataset.folder:
        raise InputError(f"{dataset.folder!r} is not the name of a dataset's folder.")
    for other in DATASETS.values():
        if other.definition is not None and other.definition == dataset.definition:
            continue
        if dataset.source == other.source or dataset.folder == other.folder:
            raise InputError(
                f"There is a source {other.source!r} in the folder {other.folder!r}."
            )
    DATASETS[dataset.source] = dataset


_ORIGINS = yaml_load(filename=str(Path(__file__).with_name("origins.yaml")))
for _source, _read, _body in (
    ("dog", dog.read_dog, dog.BODY),
    ("horse", horse.read_horse, horse.BODY),
    ("mpc", mpc.read_mpc, mpc.BODY),
    ("solo8", solo8.read_solo8, solo8.BODY),
):
    register_dataset(Dataset(_source, read=_read, body=_body, **_ORIGINS[_source]))

for _entry in entry_points(group=ENTRY_POINTS):
    try:
        register_dataset(_entry.load())
    except Exception as error:
        raise InputError(
            f"The installed dataset {_entry.name!r} cannot be registered: "
            f"{type(error).__name__}: {error}"
        ) from error


def get_dataset(source: str) -> Dataset:
    """Returns the dataset of a source.

    Raises:
        InputError: naming the sources that can be read.
    """
    return DATASETS[check_choice("source", source, DATASETS)]


def read_clip(
    source: str,
    path: Path,
    gait: str,
    start: int | None = None,
    end: int | None = None,
    fps: float | None = None,
) -> KeypointClip:
    """Reads one stretch of one recording, with its licence in the provenance.

    Conventions are measured over the whole recording. Corrections are stored in the
    provenance and logged as warnings.

    The stretch begins with frame ``start``, from 0 and by default the first usable one,
    and ends before ``end``, by default that of the file. ``fps`` is inferred if it is
    None.

    Raises:
        InputError: if the source is unknown, the file is not of its format, the stretch
            is not within it, or its motion is implausible.
    """
    dataset, path = get_dataset(source), Path(path)
    try:
        if fps is not None:
            check_rate(fps)
        recording = measure(dataset.read(path, start, end, fps), dataset.body)
        points, first, stop = _stretch(recording, start, end)
    except Exception as error:  # whatever a reader stumbles over in a damaged file
        told = isinstance(error, InputError)
        reason = str(error) if told else f"{type(error).__name__}."
        if str(path) not in reason:
            reason = f"{path} cannot be read as a recording of {source}: {reason}"
        raise InputError(reason) from error
    for name in MENDED:
        if name in recording.notes:
            _warn(f"{path.name}: {name}: {recording.notes[name]}")
    return KeypointClip(
        source=source,
        gait=gait,
        fps=recording.fps,
        withers=points[:, 0],
        hip=points[:, 1],
        toes=points[:, 2:],
        provenance={
            "file": path.name,
            "frames": f"{first}-{stop}",
            **recording.notes,
            "licence": dataset.licence,
            "attribution": dataset.attribution,
        },
    )


def _stretch(
    recording: Recording, start: int | None, end: int | None
) -> tuple[Array, int, int]:
    """Returns points of a stretch, the number of its first frame, and that after it.

    They are turned and shifted so that the first frame's horizontal direction from hip
    to withers becomes +x, and the point under the middle between them the origin.
    """
    total = recording.first + len(recording.points)
    if start is None:
        start = recording.first if recording.start is None else recording.start
    first, stop = check_range(start, end, total)
    points = recording.points[first - recording.first : stop - recording.first]
    check_frames(points)
    withers, hip = points[0, 0], points[0, 1]
    x, y, _ = withers - hip
    length = np.hypot(x, y)
    if length < 1e-6:
        raise InputError("it starts with the withers right above the hip: no heading.")
    c, s = x / length, y / length
    R = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    origin = (withers + hip) / 2 * np.array([1.0, 1.0, 0.0])
    return (points - origin) @ R.T, first, stop


@cache
def _warn(text: str) -> None:
    """Logs a warning once per process."""
    logging.getLogger(__name__).warning("%s", one_line(text))


def data_target(path: Path | None = None) -> Path:
    """Returns the path of the data folder, which may not exist.

    It is ``path`` if given, else the variable ``LOCO_DRAKE_DATA``, else ``data`` in the
    user's cache folder.
    """
    return Path(path or os.environ.get(DATA_VARIABLE) or cache_dir() / "data")


def data_dir(path: Path | None = None) -> Path:
    """Returns the folder of the recordings, as :func:`data_target` chooses it.

    Raises:
        InputError: if there is no such folder.
    """
    folder = data_target(path)
    if not folder.is_dir():
        raise InputError(
            f"There is no data folder {str(folder)!r}: loco-drake data fetch downloads "
            "the recordings, or name a folder with --data-dir or the environment "
            f"variable {DATA_VARIABLE}."
        )
    return folder
