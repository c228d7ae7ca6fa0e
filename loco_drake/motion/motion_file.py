"""Reads and writes Motion files: an ``.npz`` of arrays with a JSON header."""

import io
import json
import math
import sys
import warnings
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from loco_drake.common.errors import InputError, one_line, quoted
from loco_drake.common.files import atomic_path, content_sha256, parse_json
from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.motion import UNITS, Motion

SCHEMA_VERSION = 1
MAX_BYTES = 512 * 2**20  # of a file, and of its arrays once unpacked
_MAX_HEADER_BYTES = 4 * 2**20
_FLOATS = (("f", 4), ("f", 8))


def save_motion(motion: Motion, path: Path) -> None:
    """Writes ``motion`` to a self-describing ``.npz``, atomically."""
    write_motion(motion_bytes(motion), path)


def write_motion(content: bytes, path: Path) -> None:
    """Writes what :func:`motion_bytes` returned to a Motion file, atomically."""
    path = Path(path)
    if path.suffix != ".npz":
        raise InputError(f"A Motion file must be named *.npz, not {quoted(path.name)}.")
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def motion_bytes(motion: Motion) -> bytes:
    """Returns the content of a Motion file."""
    header: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "robot": motion.robot,
        "source": motion.source,
        "gait": motion.gait,
        "fps": motion.fps,
        "joint_names": list(motion.joint_names),
        "units": UNITS,
        "provenance": motion.provenance,
    }
    if motion.gait_changes:
        changes = [(start, k.source, k.gait) for start, k in motion.gait_changes]
        header["gait_changes"] = changes
    arrays = {name: getattr(motion, name) for name in UNITS}
    header["content_sha256"] = _content_sha256(header, arrays)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, header=json.dumps(header), **arrays)
    return buffer.getvalue()


def load_motion(path: Path) -> Motion:
    """Reads a Motion file and checks it; all commands and functions use this reader.

    See :func:`parse_motion`.

    Raises:
        InputError: as there, or if there is no such file.
    """
    return _load(Path(path), str(path))


def parse_motion(content: bytes, name: str) -> Motion:
    """Returns the motion of a file's content, checked; ``name`` is that in messages.

    Joints in another order than the robot's are reordered, which is reported on stderr
    and in the provenance. So are, on stderr only, velocities in a file without a hash
    that differ from the derivatives of the positions.

    Raises:
        InputError: if the content is damaged, of a newer schema, or fails a check of
            :class:`Motion` or :func:`.conventions.check_conventions`.
    """
    return _load(io.BytesIO(content), name)


def _load(source: Path | io.BytesIO, name: str) -> Motion:
    # It imports Drake, which --help and writers do not need.
    from loco_drake.motion.conventions import (
        check_conventions,
        in_robot_order,
        velocity_deviations,
    )

    try:
        if isinstance(source, Path) and not source.is_file():
            raise InputError(f"There is no Motion file {name!r}.")
        header, arrays = _read(source)
        claimed = header.pop("content_sha256", None)
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused
            motion = _make(header, arrays)
            if claimed not in (None, _content_sha256(header, arrays)):
                raise InputError("It is damaged: its content does not match its hash.")
            check_conventions(ordered := in_robot_order(motion))
    except InputError as error:
        named = name in str(error)
        raise InputError(str(error) if named else f"{name}: {error}") from None
    except Exception:  # zipfile, numpy and json raise many kinds
        raise InputError(
            f"{name} is not a Motion file: it must be an .npz with a JSON header."
        ) from None
    if ordered is not motion:
        text = f"{name}: joints {ordered.provenance['joints']}."
        print(one_line(text), file=sys.stderr)
    deviations = velocity_deviations(ordered) if claimed is None else {}
    if deviations:
        worst = ", ".join(f"{key} by {off:.0%}" for key, off in deviations.items())
        text = (
            f"{name} has no hash, and velocities differ from the derivatives of the "
            f"positions: {worst} of the highest."
        )
        print(one_line(text), file=sys.stderr)
    return ordered


def _read(
    source: Path | io.BytesIO,
) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Returns header and arrays; no more is unpacked than is asked for and fits."""
    with source.open("rb") if isinstance(source, Path) else source as file:
        if file.seek(0, io.SEEK_END) > MAX_BYTES:
            raise InputError(f"It is larger than {MAX_BYTES >> 20} MB.")
        return _unpacked(file)


def _unpacked(file: IO[bytes]) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    with zipfile.ZipFile(file) as archive:
        members = {info.filename: info for info in archive.infolist()}
        if "header.npy" not in members:
            raise ValueError("no header")
        missing = [name for name in UNITS if f"{name}.npy" not in members]
        if missing:
            raise InputError(f"It lacks {', '.join(missing)}.")
        sizes = {name: members[f"{name}.npy"].file_size for name in ("header", *UNITS)}
        if sizes.pop("header") > _MAX_HEADER_BYTES or sum(sizes.values()) > MAX_BYTES:
            raise InputError(f"Its arrays are larger than {MAX_BYTES >> 20} MB.")
        header = parse_json(_array(archive, members["header.npy"]).item())
        arrays = {name: _array(archive, members[f"{name}.npy"]) for name in UNITS}
    return header, arrays


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[Any]:
    """Returns an array of text, bool or floating point of the size that it declares."""
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError("packed in a way that numpy does not")
    with archive.open(info) as member, warnings.catch_warnings():
        warnings.simplefilter("error")
        old = npy.read_magic(member) == (1, 0)
        read = npy.read_array_header_1_0 if old else npy.read_array_header_2_0
        shape, fortran, dtype = read(member)
        size = math.prod(shape) * dtype.itemsize
        if min(shape, default=0) < 0 or size != info.file_size - member.tell():
            raise ValueError("not of the size that it declares")
        data = member.read(size)
        if member.read(1) or len(data) != size:
            raise ValueError("not of the size that it declares")
    if dtype.kind == "b" and size and max(data) > 1:
        raise ValueError("neither true nor false")
    if dtype.kind not in "bU" and (dtype.kind, dtype.itemsize) not in _FLOATS:
        raise InputError(
            f"The {info.filename.removesuffix('.npy')} of a motion must be floating "
            f"point of 32 or 64 bits, not {dtype}."
        )
    order = "F" if fortran else "C"
    return np.frombuffer(data, dtype).reshape(shape, order=order)  # type: ignore[call-overload]


def _make(header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Motion:
    """Returns the motion that a file describes."""
    version = header.get("schema_version")
    if type(version) is not int or version < 1:
        raise InputError("It has a damaged Motion header.")
    if version > SCHEMA_VERSION:
        newest = f"this version reads up to {SCHEMA_VERSION}"
        raise InputError(f"It has Motion schema {version}; {newest}.")
    required = ("robot", "source", "gait", "fps", "joint_names")
    missing = [name for name in required if name not in header]
    if missing:
        raise InputError(f"It lacks {', '.join(missing)}.")
    units = header.get("units", UNITS)
    texts = [header[name] for name in ("robot", "source", "gait")]
    joint_names, provenance = header["joint_names"], header.get("provenance", {})
    sound = (
        type(header["fps"]) in (int, float)
        and isinstance(units, dict)
        and isinstance(joint_names, list)
        and isinstance(provenance, dict)
        and all(isinstance(text, str) for text in (*texts, *joint_names))
    )
    try:
        changes = tuple(
            (int(start), GaitLabel(source, gait))
            for start, source, gait in header.get("gait_changes", ())
        )
    except (TypeError, ValueError):
        sound = False
    if not sound:
        raise InputError("It has a damaged Motion header.")
    wrong = [name for name, unit in UNITS.items() if units.get(name, unit) != unit]
    if wrong:
        raise InputError(
            f"Its {wrong[0]} is given in {quoted(units[wrong[0]])}, but Motion files "
            f"hold {quoted(UNITS[wrong[0]])}."
        )
    values: dict[str, Any] = {
        name: array.astype(np.float64) if array.dtype.kind == "f" else array.copy()
        for name, array in arrays.items()
    }
    return Motion(
        robot=header["robot"],
        source=header["source"],
        gait=header["gait"],
        fps=float(header["fps"]),
        joint_names=tuple(joint_names),
        provenance={str(k): str(v) for k, v in provenance.items()},
        gait_changes=changes,
        **values,
    )


def _content_sha256(header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> str:
    return content_sha256(
        header,
        {f"{k} {a.dtype.str} {a.shape}": a.tobytes() for k, a in arrays.items()},
    )
