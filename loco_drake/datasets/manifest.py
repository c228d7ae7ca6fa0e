"""The files of the recordings: where each is published, and its checksum."""

import csv
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from loco_drake.datasets.registry import DATASETS

MANIFEST = Path(__file__).with_name("manifest.csv")


@dataclass(frozen=True)
class RemoteFile:
    """One file of a recording as its authors, or others, published it.

    Attributes:
        name: its path inside the data folder, with ``/``.
        repository: ``owner/name`` on GitHub.
        commit: the commit in which it has the content that ``sha256`` describes.
        path: its path inside the repository.
        size: bytes.
        sha256: checksum of the content, in hexadecimal.
    """

    name: str
    repository: str
    commit: str
    path: str
    size: int
    sha256: str

    @property
    def folder(self) -> str:
        """The dataset's folder, the first part of the name."""
        return self.name.split("/")[0]

    @property
    def url(self) -> str:
        """Address of the content, which no later commit can change."""
        return (
            f"https://raw.githubusercontent.com/{self.repository}/{self.commit}/"
            f"{quote(self.path)}"
        )


def read_manifest(path: Path) -> list[RemoteFile]:
    """Returns the files listed in a manifest, in its order."""
    with path.open(newline="", encoding="utf-8") as file:
        return [
            RemoteFile(
                name=row["file"],
                repository=row["repository"],
                commit=row["commit"],
                path=row["path"],
                size=int(row["bytes"]),
                sha256=row["sha256"],
            )
            for row in csv.DictReader(file)
        ]


def files_by_source() -> dict[str, list[RemoteFile]]:
    """Returns the shipped manifest's files of each source that can be read."""
    files = read_manifest(MANIFEST)
    found = {
        source: [file for file in files if file.folder == dataset.folder]
        for source, dataset in DATASETS.items()
    }
    return {source: listed for source, listed in found.items() if listed}
