"""Which stretch of which file holds which gait: ``segments.csv`` of the data folder."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from loco_drake.common.errors import InputError, check_choice
from loco_drake.datasets.registry import DATASETS, read_clip
from loco_drake.datasets.segment_table import read_rows
from loco_drake.motion.keypoints import KeypointClip

# Horse<animal>_M<day of measurement>_<gait><number>...
_HORSE = re.compile(r"(Horse\d+)_M\d+_")


@dataclass(frozen=True)
class Segment:
    """A stretch of a recording that holds one gait.

    Attributes:
        source: one of :data:`loco_drake.motion.gaits.SOURCES`.
        path: the file.
        gait: name of the gait; need not be one of the fifteen labels.
        start: first frame, from 0, at the file's own rate.
        end: frame after the last.
        fps: frames per second of the file.
    """

    source: str
    path: Path
    gait: str
    start: int
    end: int
    fps: float

    @property
    def name(self) -> str:
        """Names the segment and what is made of it: ``dog-trot-dog_walk04-232-545``.

        Recordings can be there in two formats; that of other files than .txt is named.
        """
        kind = "" if self.path.suffix == ".txt" else self.path.suffix.replace(".", "-")
        return f"{self.label}-{self.path.stem}{kind}-{self.start}-{self.end}"

    @property
    def label(self) -> str:
        """What it holds, such as ``dog-trot``; need not be one of the fifteen."""
        return f"{self.source}-{self.gait}"

    @property
    def seconds(self) -> float:
        """Length of the segment."""
        return (self.end - self.start) / self.fps

    @property
    def recording(self) -> str:
        """Names the file, without its ending."""
        return self.path.stem

    @property
    def animal(self) -> str | None:
        """Names the animal where the file's name does: ``Horse3``."""
        horse = _HORSE.match(self.path.name) if self.source == "horse" else None
        return horse[1] if horse else None

    @property
    def subject(self) -> str:
        """Names the animal, or else the recording, and its source."""
        return f"{self.source}-{self.animal or self.recording}"

    def read(self) -> KeypointClip:
        """Returns the frames, with recording, rate and animal in the provenance.

        Raises:
            InputError: if the file does not hold them.
        """
        clip = read_clip(
            self.source,
            self.path,
            gait=self.gait,
            start=self.start,
            end=self.end,
            fps=self.fps,
        )
        origin = {"recording": self.recording, "recording_fps": f"{clip.fps:g}"}
        if self.animal is not None:
            origin["animal"] = self.animal
        return replace(clip, provenance={**clip.provenance, **origin})


def read_segments(data_dir: Path) -> list[Segment]:
    """Returns the segments of all sources that can be read, in the file's order.

    Raises:
        InputError: if ``segments.csv`` is missing or damaged.
    """
    table = Path(data_dir) / "segments.csv"
    sources = {dataset.folder: dataset.source for dataset in DATASETS.values()}
    try:
        rows = read_rows(table)
    except OSError:
        raise InputError(
            f"The data folder {str(data_dir)!r} lacks segments.csv; "
            "loco-drake data fetch writes it."
        ) from None
    segments = []
    for line, row in enumerate(rows, start=2):
        if row["dataset"] not in sources:
            continue
        try:
            segment = Segment(
                source=sources[row["dataset"]],
                path=Path(data_dir) / row["dataset"] / row["file"],
                gait=row["gait"],
                start=int(row["start_frame"]),
                end=int(row["end_frame"]),
                fps=float(row["fps"]),
            )
        except ValueError:
            raise InputError(
                f"{table}: line {line} has frames or a rate that are not numbers."
            ) from None
        if not (0 <= segment.start < segment.end and 0 < segment.fps < float("inf")):
            raise InputError(
                f"{table}: line {line} has an empty or impossible stretch."
            )
        segments.append(segment)
    return segments


def one_format(segments: Iterable[Segment]) -> list[Segment]:
    """Returns the segments without those of recordings that are there as measured, too.

    The horses' ``.csv`` files are as they were measured; others have made ``.txt``
    files of some of them, which hold the same strides again.
    """
    segments = list(segments)
    measured = {(s.source, s.recording) for s in segments if _is_measured(s)}
    return [
        segment
        for segment in segments
        if _is_measured(segment) or (segment.source, segment.recording) not in measured
    ]


def _is_measured(segment: Segment) -> bool:
    return segment.path.suffix == ".csv"


def select_labels(segments: Iterable[Segment], labels: Iterable[str]) -> list[Segment]:
    """Returns the segments of ``labels``, such as ``dog-trot`` (empty: all).

    Raises:
        InputError: if a label, or everything, has no segment; names those that do.
    """
    segments = list(segments)
    if not segments:
        raise InputError("segments.csv has no stretch of a source that can be read.")
    available = list(dict.fromkeys(segment.label for segment in segments))
    wanted = [check_choice("label", label, available) for label in labels]
    return [s for s in segments if not wanted or s.label in wanted]


def select_segments(
    segments: Iterable[Segment], source: str | None, gaits: Iterable[str]
) -> list[Segment]:
    """Returns the segments of ``source`` (None: any) and of ``gaits`` (empty: any).

    Raises:
        InputError: if a gait, or everything, has no segment; names those that do.
    """
    of_source = [s for s in segments if source in (None, s.source)]
    if not of_source:
        raise InputError(
            f"segments.csv has no stretch of the source {source or 'any'!r}."
        )
    available = list(dict.fromkeys(segment.gait for segment in of_source))
    wanted = list(gaits)
    for gait in wanted:
        if gait not in available:
            raise InputError(
                f"segments.csv has no {gait!r} of {source or 'any source'}; "
                f"the choices are {', '.join(available)}."
            )
    return [s for s in of_source if not wanted or s.gait in wanted]
