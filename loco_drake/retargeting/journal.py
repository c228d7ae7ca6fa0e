"""What a run of ``retarget`` has done, so that one that was stopped can go on.

A hidden file beside the Motion files has a line of JSON that says how they were made,
and one for each that was written. A line that was torn by a kill, or damaged, is as if
it were not there. A run that comes to its end leaves no such file.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from loco_drake.common.errors import InputError
from loco_drake.common.files import content_sha256, parse_json
from loco_drake.common.typed import FieldError, convert
from loco_drake.datasets.segments import Segment
from loco_drake.datasets.split import Split
from loco_drake.models.quadruped import Quadruped
from loco_drake.retargeting.report import RetargetReport
from loco_drake.retargeting.scaling import Variant

JOURNAL = ".retargeted.jsonl"
Entry = dict[str, Any]


def settings_of(
    robot: Quadruped, variant: Variant, files: tuple[Path, ...] = ()
) -> Entry:
    """Returns what all motions of a run depend on; ``files`` describe its sources."""
    own = Path(robot.definition)
    described = [*files, *([own] if own.is_file() else [])]
    return {
        "loco_drake": version("loco_drake"),
        "robot": robot.name,
        "files": [sha256(path.read_bytes()).hexdigest() for path in described],
        **asdict(variant),
    }


class Journal:
    """Notes the motions in a folder, and finds those of a run before.

    Args:
        folder: of the Motion files.
        settings: as :func:`settings_of` returns; those of a run that goes on.
        split: that is noted in the motions, if it is.
        resume: go on with the run in the folder; otherwise it is forgotten.

    Raises:
        InputError: if there is no run to go on with, or its settings were others.
    """

    def __init__(
        self,
        folder: Path,
        settings: Mapping[str, Any],
        split: Split | None = None,
        *,
        resume: bool = False,
    ) -> None:
        self._path, self._split = folder / JOURNAL, split
        self._settings, self._begun = dict(settings), resume
        self._done: dict[str, Entry] = self._read() if resume else {}

    def find(self, segment: Segment, path: Path) -> RetargetReport | None:
        """Returns the report of a motion that is in ``path`` as it was written."""
        entry = self._done.get(segment.name)
        if entry is None:
            return None
        try:
            same = entry["of"] == self._key(segment)
            if not same or path.stat().st_size != entry["bytes"]:
                return None
            report: RetargetReport = convert(entry["report"], RetargetReport)
        except (OSError, KeyError, FieldError):
            return None
        return report

    def note(self, segment: Segment, path: Path, report: RetargetReport) -> None:
        """Notes a motion that has been written to ``path``."""
        entry = {
            "name": segment.name,
            "of": self._key(segment),
            "bytes": path.stat().st_size,
            "report": asdict(report),
        }
        with self._path.open("a" if self._begun else "w") as file:
            if not self._begun:
                file.write(_line(self._settings))
            file.write(_line(entry))
        self._begun = True

    def end(self) -> None:
        """Forgets the run, which has come to its end."""
        self._path.unlink(missing_ok=True)

    def _key(self, segment: Segment) -> Entry:
        recording = segment.path.stat()
        return {
            "source": segment.source,
            "gait": segment.gait,
            "frames": [segment.start, segment.end, segment.fps],
            "recording": [recording.st_size, recording.st_mtime_ns],
            "split": self._split and self._split.side(segment),
        }

    def _read(self) -> dict[str, Entry]:
        lines = self._path.read_bytes().split(b"\n") if self._path.is_file() else [b""]
        first, *others = map(_parsed, lines)
        folder = str(self._path.parent)
        if first is None:
            raise InputError(
                f"No run of retarget in {folder!r} was stopped that could go on; leave "
                "out --resume."
            )
        differ = [
            name for name, own in self._settings.items() if first.get(name) != own
        ]
        if differ:
            raise InputError(
                f"The motions in {folder!r} were made with other {', '.join(differ)}; "
                "go on with the same, or leave out --resume."
            )
        if lines[-1]:  # torn by a kill
            with self._path.open("ab") as file:
                file.write(b"\n")
        return {str(entry.get("name")): entry for entry in others if entry is not None}


def _line(entry: Entry) -> str:
    return json.dumps({"entry": entry, "sha256": content_sha256(entry, {})}) + "\n"


def _parsed(line: bytes) -> Entry | None:
    try:
        value = parse_json(line.decode())
    except ValueError:
        return None
    entry = value.get("entry")
    whole = isinstance(entry, dict) and content_sha256(entry, {}) == value.get("sha256")
    return entry if whole else None
