"""Segments: the stretches of recordings listed in ``segments.csv``."""

import csv
import io
import logging
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from loco_drake.common.errors import InputError, check_choice
from loco_drake.common.files import atomic_path, is_inside, parse_number, read_text
from loco_drake.datasets.recording import check_rate
from loco_drake.datasets.registry import DATASETS, read_clip
from loco_drake.motion.gaits import LABELS, GaitLabel
from loco_drake.motion.keypoints import KeypointClip

SHIPPED = Path(__file__).with_name("segments.csv")
COLUMNS = ("dataset", "file", "gait", "start_frame", "end_frame", "fps")

Row = dict[str, str]

# Horse<animal>_M<day of measurement>_<gait><number>...
_HORSE = re.compile(r"(Horse\d+)_M\d+_")


@dataclass(frozen=True)
class Segment:
    """A stretch of a recording with one gait.

    Raises:
        InputError: if it cannot be a stretch.
    """

    source: str  # a key of registry.DATASETS
    path: Path  # of the file
    gait: str  # need not be one of the fifteen labels
    start: int  # first frame, from 0, at the file's own rate
    end: int  # frame after the last
    fps: float  # of the file

    def __post_init__(self) -> None:
        GaitLabel(self.source, self.gait)  # checks the names
        if not 0 <= self.start < self.end:
            raise InputError(
                f"Frames {self.start} to {self.end} are not a valid stretch."
            )
        check_rate(self.fps)

    @property
    def name(self) -> str:
        """Names the segment and what is made of it: ``dog-trot-dog_walk04-232-545``.

        Recordings can be there in two formats; that of other files than .txt is named.
        """
        kind = "" if self.path.suffix == ".txt" else self.path.suffix.replace(".", "-")
        return f"{self.label}-{self.path.stem}{kind}-{self.start}-{self.end}"

    @property
    def label(self) -> str:
        """Label such as ``dog-trot``; need not be one of the fifteen."""
        return f"{self.source}-{self.gait}"

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return (self.end - self.start) / self.fps

    @property
    def recording(self) -> str:
        """Name of the file without its extension."""
        return self.path.stem

    @property
    def animal(self) -> str | None:
        """The animal, such as ``Horse3``, if the file's name contains it."""
        horse = _HORSE.match(self.path.name) if self.source == "horse" else None
        return horse[1] if horse else None

    @property
    def subject(self) -> str:
        """Source and animal, or source and recording if it is unknown."""
        return f"{self.source}-{self.animal or self.recording}"

    def read(self) -> KeypointClip:
        """Returns the frames, with recording, rate and animal in the provenance.

        Raises:
            InputError: if the file does not hold them.
        """
        clip = read_clip(
            self.source, self.path, self.gait, self.start, self.end, self.fps
        )
        origin = {"recording": self.recording, "recording_fps": f"{clip.fps:g}"}
        if self.animal is not None:
            origin["animal"] = self.animal
        return replace(clip, provenance={**clip.provenance, **origin})


def read_rows(table: Path) -> list[Row]:
    """Returns the rows of a table, without checking what their cells hold.

    Raises:
        InputError: if there is no such file, it is not a CSV table, or a row lacks one
            of ``COLUMNS``.
    """
    return [row for _, row in _numbered_rows(table)]


def _numbered_rows(table: Path) -> Iterator[tuple[int, Row]]:
    """Yields number of the line and cells of each row that is not blank."""
    text = read_text(table)
    separator = "," if "," in text.partition("\n")[0] else ";"
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
    try:
        names = [name.strip().lower() for name in next(reader, [])]
        if missing := [name for name in COLUMNS if name not in names]:
            raise InputError(f"{table}: line 1 lacks {', '.join(missing)}.")
        for cells in reader:
            line = reader.line_num
            if len(cells) > len(names):
                raise InputError(
                    f"{table}: line {line} has more cells than the header."
                )
            row = dict.fromkeys(names, "")
            row |= zip(names, map(str.strip, cells), strict=False)
            if any(row.values()):
                if missing := [name for name in COLUMNS if not row[name]]:
                    raise InputError(
                        f"{table}: line {line} lacks {', '.join(missing)}."
                    )
                yield line, row
    except csv.Error:
        raise InputError(
            f"{table} is damaged: after line {reader.line_num} it is not a CSV table."
        ) from None


def write_rows(table: Path, rows: Iterable[Row]) -> None:
    """Writes a table with the columns of all rows."""
    rows = list(rows)
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with (
        atomic_path(table) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def add_shipped_rows(rows: Iterable[Row], files: Iterable[str]) -> list[Row]:
    """Returns a table with the shipped stretches of some files added.

    Files that are already in the table keep their rows, which may be the user's. The
    order is that of the shipped table, with rows of other files last.

    Args:
        rows: the table so far.
        files: names of files inside the data folder, such as
            ``dog_mann/keypoints/dog_walk00.txt``.
    """
    own = _by_file(rows)
    added = set(files)
    merged = []
    for name, stretches in _by_file(read_rows(SHIPPED)).items():
        if name in own:
            merged += own.pop(name)
        elif name in added:
            merged += stretches
    return merged + [row for stretches in own.values() for row in stretches]


def _by_file(rows: Iterable[Row]) -> dict[str, list[Row]]:
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(f"{row['dataset']}/{row['file']}", []).append(row)
    return found


def read_segments(data_dir: Path) -> list[Segment]:
    """Returns the segments of all known sources, in the file's order.

    Raises:
        InputError: if ``segments.csv`` is missing or damaged, a row cannot be or
            repeats another, or there is none of a source that can be read.
    """
    table = Path(data_dir) / "segments.csv"
    if not table.is_file():
        raise InputError(
            f"The data folder {str(data_dir)!r} lacks segments.csv; "
            "loco-drake data fetch writes it."
        )
    sources = {dataset.folder: dataset.source for dataset in DATASETS.values()}
    segments: list[Segment] = []
    lines: dict[str, int] = {}
    unknown = []
    for line, row in _numbered_rows(table):
        if row["dataset"] not in sources:
            unknown.append(line)
            continue
        if not is_inside(row["file"]):
            raise InputError(
                f"{table}: line {line} names no file inside the folder of its dataset."
            )
        try:
            segment = Segment(
                source=sources[row["dataset"]],
                path=Path(data_dir) / row["dataset"] / row["file"],
                gait=row["gait"],
                start=_parse_frame(row["start_frame"]),
                end=_parse_frame(row["end_frame"]),
                fps=parse_number(row["fps"]),
            )
        except InputError as error:
            raise InputError(f"{table}: line {line} is invalid: {error}") from None
        except ValueError:
            raise InputError(
                f"{table}: line {line} has frames or a rate that are not numbers."
            ) from None
        if (first := lines.setdefault(segment.name, line)) != line:
            raise InputError(f"{table}: line {line} repeats line {first}.")
        segments.append(segment)
    if unknown:
        text = (
            f"{table}: line {unknown[0]} is of another dataset than "
            f"{', '.join(sources)}"
        )
        if not segments:
            raise InputError(f"{text}, as are all.")
        logging.getLogger(__name__).warning("%s, and is left out.", text)
    if not segments:
        raise InputError(f"{table} lists no segments.")
    return segments


def _parse_frame(text: str) -> int:
    parse_number(text)
    return int(text)


def one_format(segments: Iterable[Segment]) -> list[Segment]:
    """Returns the segments without converted copies of recordings.

    The horses' ``.csv`` files are as measured; their ``.txt`` files, converted by
    others, contain the same strides.
    """
    segments = list(segments)
    measured = [s for s in segments if s.path.suffix == ".csv"]
    recordings = {(s.source, s.recording) for s in measured}
    return [
        s
        for s in segments
        if s in measured or (s.source, s.recording) not in recordings
    ]


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
    """Returns the segments of ``source`` (None: any) and of ``gaits``.

    Without gaits, these are the segments with one of the fifteen labels.

    Raises:
        InputError: if a gait, or everything, has no segment; names those that do.
    """
    of_source = [s for s in segments if source in (None, s.source)]
    name, wanted = source or "any source", list(gaits)
    if not of_source:
        raise InputError(f"segments.csv has no stretch of {name}.")
    available = list(dict.fromkeys(segment.gait for segment in of_source))
    for gait in wanted:
        check_choice(f"gait of {name}", gait, available)
    if wanted:
        return [s for s in of_source if s.gait in wanted]
    labels = {str(label) for label in LABELS}
    found = [s for s in of_source if s.label in labels]
    if not found:
        there = ", ".join(dict.fromkeys(segment.label for segment in of_source))
        raise InputError(
            f"segments.csv has none of the fifteen gaits of {name}, only {there}: name "
            f"what to take with --gait {available[0]}."
        )
    return found
