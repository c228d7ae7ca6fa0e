"""Human clips out of the package that ships them, from the user's package index.

The wheel for one version of Python is taken on every machine, and never installed: only
the clips and their skeleton are kept.
"""

import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

from pydrake.common.yaml import yaml_load

from loco_drake.common.errors import InputError, one_line
from loco_drake.datasets.download import RemoteFile
from loco_drake.datasets.human import FOLDER

PACKAGE = "pybullet==3.2.7"
# Whichever Python runs this: its clips are the same in all wheels.
_WHEEL = ("--platform", "manylinux2014_x86_64", "--python-version", "3.11")
_FILES = Path(__file__).with_name("human_files.yaml")
_SECONDS = 3600.0


def human_files() -> list[RemoteFile]:
    """Returns the files of human motion, which have no address of their own."""
    listed = yaml_load(filename=str(_FILES))
    return [
        RemoteFile(f"{FOLDER}/{name}", "", file["bytes"], file["sha256"])
        for name, file in listed.items()
    ]


def unpack_package(files: Sequence[RemoteFile], folder: Path) -> None:
    """Downloads the package with pip, and puts these files of it into a folder.

    Their paths there are those in a data folder.

    Raises:
        InputError: if pip cannot have it, or the package lacks a file.
    """
    with tempfile.TemporaryDirectory() as temporary:
        wheel = _download(Path(temporary))
        with zipfile.ZipFile(wheel) as archive:
            members = {PurePosixPath(name).name: name for name in archive.namelist()}
            for file in files:
                name = PurePosixPath(file.name).name
                if name not in members:
                    raise InputError(f"{PACKAGE} has no {name}.")
                target = folder / file.name
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(archive.read(members[name]))


def _download(folder: Path) -> Path:
    """Returns the path of the package's wheel in a folder."""
    command = [sys.executable, "-m", "pip", "download", PACKAGE, "--no-deps", *_WHEEL]
    command += ["--only-binary", ":all:", "--quiet", "--dest", str(folder)]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_SECONDS, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise InputError(f"pip cannot download {PACKAGE}: {error}.") from None
    wheels = list(folder.glob("*.whl"))
    if done.returncode or len(wheels) != 1:
        lines = [line for line in done.stderr.splitlines() if line.strip()]
        reason = one_line(lines[-1]) if lines else "it says nothing"
        raise InputError(
            f"pip cannot download {PACKAGE} ({reason}); fetch it in another way and "
            "name a folder with the clips with --from."
        )
    return wheels[0]
