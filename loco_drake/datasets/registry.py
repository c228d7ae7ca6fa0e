"""The sources of motion: where their files lie, whose they are, what reads them."""

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from loco_drake.common.errors import InputError, check_choice
from loco_drake.common.files import cache_dir
from loco_drake.datasets.dog import read_dog
from loco_drake.datasets.horse import read_horse
from loco_drake.datasets.mpc import read_mpc
from loco_drake.datasets.solo8 import read_solo8
from loco_drake.motion.keypoints import KeypointClip

DATA_VARIABLE = "LOCO_DRAKE_DATA"


class Reader(Protocol):
    """Reads frames ``start`` to ``end`` (exclusive) of one file as a clip."""

    def __call__(
        self,
        path: Path,
        *,
        gait: str,
        start: int | None = None,
        end: int | None = None,
        fps: float | None = None,
    ) -> KeypointClip:
        """Returns the clip; raises InputError for a file of another format."""
        ...


@dataclass(frozen=True)
class Dataset:
    """One source of motion.

    Attributes:
        source: one of :data:`loco_drake.motion.gaits.SOURCES`.
        folder: name of its folder inside the data folder.
        licence: under which its files, and all that is made from them, may be used.
        attribution: whom to name.
        read: reads one file.
    """

    source: str
    folder: str
    licence: str
    attribution: str
    read: Reader


DATASETS = {
    dataset.source: dataset
    for dataset in (
        Dataset(
            source="dog",
            folder="dog_mann",
            licence="CC BY-NC 4.0",
            attribution="Zhang, Starke, Komura, Saito 2018 (MANN, AI4Animation)",
            read=read_dog,
        ),
        Dataset(
            source="horse",
            folder="horse_vhdc",
            licence="CC BY-SA 4.0 (3.0 by another catalogue)",
            attribution="Vienna Horse Data Collection (VHDC), Vetmeduni Vienna / Bonn",
            read=read_horse,
        ),
        Dataset(
            source="mpc",
            folder="mpc_rfmpc",
            licence="none stated (made with RF-MPC, MIT)",
            attribution="LearnDiverseLoco's authors 2025, with RF-MPC by Yanran Ding",
            read=read_mpc,
        ),
        Dataset(
            source="solo8",
            folder="solo8_cassi",
            licence="BSD-3-Clause",
            attribution="Li et al. 2023 (CASSI), as points by LearnDiverseLoco",
            read=read_solo8,
        ),
    )
}


def get_dataset(source: str) -> Dataset:
    """Returns the dataset of a source.

    Raises:
        InputError: naming the sources that can be read.
    """
    return DATASETS[check_choice("source", source, DATASETS)]


def read_clip(
    source: str,
    path: Path,
    *,
    gait: str,
    start: int | None = None,
    end: int | None = None,
    fps: float | None = None,
) -> KeypointClip:
    """Reads one stretch of one recording, its licence in the provenance.

    Args:
        source: whose format the file has, a key of :data:`DATASETS`.
        path: the file.
        gait: what the animal or robot does in that stretch.
        start: first frame, from 0; None for the first of use.
        end: frame after the last; None for the end of the file.
        fps: frames per second; None if the format, the file or its motion tells.

    Raises:
        InputError: if the source is unknown, the file not of its format, the stretch
            not within it, or the rate not above 0.
    """
    dataset = get_dataset(source)
    if fps is not None and not 0 < fps < float("inf"):
        raise InputError(f"A rate must be above 0 frames/s, not {fps:g}.")
    clip = dataset.read(path, gait=gait, start=start, end=end, fps=fps)
    origin = {"licence": dataset.licence, "attribution": dataset.attribution}
    return replace(clip, provenance={**clip.provenance, **origin})


def data_target(path: Path | None = None) -> Path:
    """Returns where the folder of the recordings is, or is to be.

    It is ``path`` if given, else that of the variable ``LOCO_DRAKE_DATA``, else
    ``data`` in the user's cache folder.
    """
    given = path or os.environ.get(DATA_VARIABLE)
    return Path(given) if given else cache_dir() / "data"


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
