"""What a damaged input may lead to, and what not."""

import hashlib
import io
import json
import re
import stat
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzzing.damage import Damage
from tests.fuzzing.kinds import Kind
from tests.fuzzing.worker import MEMORY, TRACEBACK, Run

Leaves = dict[str, Any]
Files = dict[str, tuple[str, ...]]

BEFORE = b"was there before\n"  # in outputs, before the command runs
LONGEST = 1000  # letters of a line
NEAR = 0.05  # of the highest value of a leaf
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\ufffd]")
ABSOLUTE = (Path("/tmp/loco_drake_canary"), Path("/tmp/loco_drake_canary.npy"))
_SKIPPED = ("provenance", "path", "content_hash")


def snapshot(folder: Path) -> Files:
    """Returns what lies in a folder: kind and content of each file."""
    found: Files = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        mode = path.lstat().st_mode
        if stat.S_ISLNK(mode):
            found[name] = ("link", str(path.readlink()))
        elif stat.S_ISREG(mode) and path.stat().st_size < 2**28:
            found[name] = ("file", hashlib.sha256(path.read_bytes()).hexdigest())
        elif not stat.S_ISDIR(mode):
            found[name] = ("other", str(stat.S_IFMT(mode)), str(path.lstat().st_size))
    return found


def outcome(folder: Path) -> Leaves:
    """Returns all figures and arrays that a command wrote, by file and name."""
    leaves: Leaves = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if not path.is_file() or path.suffix == ".png" or "events" in name:
            continue
        data = path.read_bytes()
        if data == BEFORE:
            continue
        if path.suffix == ".json":
            _flatten(name, json.loads(data), leaves)
        elif path.suffix == ".npz":
            for key, value in _npz(data).items():
                leaves[f"{name}:{key}"] = value
        elif path.suffix == ".jsonl":
            for k, line in enumerate(data.splitlines()):
                _flatten(f"{name}:{k}", json.loads(line), leaves)
        else:
            leaves[name] = hashlib.sha256(data).hexdigest()
    return leaves


def _npz(data: bytes) -> Leaves:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {
            name: np.load(io.BytesIO(archive.read(name)))
            for name in archive.namelist()
            if name != "header.npy"
        }


def _flatten(name: str, value: Any, leaves: Leaves) -> None:
    if isinstance(value, dict | list) and value:
        pairs = value.items() if isinstance(value, dict) else enumerate(value)
        for key, part in pairs:
            if not any(word in str(key) for word in _SKIPPED):
                _flatten(f"{name}:{key}", part, leaves)
    else:
        leaves[name] = value


def differing(one: Leaves, other: Leaves) -> list[str]:
    """Returns the names of what is not the same to the last bit."""
    return [
        name
        for name in one | other
        if name not in one or name not in other or not _same(one[name], other[name])
    ]


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and np.array_equal(a, b)
    return a == b and type(a) is type(b)


def judge(
    damage: Damage,
    kind: Kind,
    run: Run,
    clean: Run,
    files: tuple[Files, Files],
    leaves: tuple[Leaves, Leaves | str],
    varying: set[str],
) -> tuple[str, str]:
    """Returns the verdict on a run and the reason if it is "BAD".

    Args:
        damage: to the input.
        kind: of the input.
        run: what became of the command.
        clean: of the command with the sound input.
        files: in the working folder, before and after.
        leaves: the outcome with the sound input and with this one, or why it cannot be
            read.
        varying: names of the leaves that no two runs have in common.
    """
    why = _how_it_ended(run, clean) or _what_it_wrote(kind, run.status, *files)
    if why:
        return "BAD", why
    if run.status == 2:
        return "refused", ""
    if run.status == 1:
        return "failed", ""
    sound, own = leaves
    if isinstance(own, str):
        return "BAD", f"unreadable output: {own}"
    changed = [name for name in differing(sound, own) if name not in varying]
    if not changed:
        return "identical", ""
    if _said(run) - _said(clean):
        return "mended", ""
    gross = _gross(sound, own)
    if damage.near and not gross:
        gross = _far(sound, own, changed)
    if (kind.values or damage.legal or damage.near) and not gross:
        return "other value", ""
    return "BAD", f"silent change: {gross or ', '.join(changed)[:300]}"


def _said(run: Run) -> set[str]:
    """Returns the lines on stderr but for progress bars."""
    return {line for line in run.stderr.split("\n") if "\u2501" not in line} - {""}


def _how_it_ended(run: Run, clean: Run) -> str:
    if run.status is None:
        return f"hangs: {run.seconds:.0f} s"
    if "Traceback (most recent call last)" in run.stderr or run.status == TRACEBACK:
        return "traceback: " + run.stderr.strip().splitlines()[-1][:300]
    if run.status not in (0, 1, 2):
        return f"crash: status {run.status}: {run.stderr[-300:]!r}"
    if run.memory > clean.memory + MEMORY:
        return f"memory: {run.memory / 2**30:.1f} GB"
    for line in [*run.stderr.split("\n"), *run.stdout.split("\n")]:
        if len(line) > LONGEST and line not in clean.stdout:
            return f"a line of {len(line)} letters: {line[:100]!r}"
        if found := _CONTROL.search(line):
            return f"control letter {found[0]!r} in {line[:200]!r}"
    lines = [line for line in run.stderr.split("\n") if line]
    if run.status == 2:
        # Warnings may come first; what is wrong comes last, and once.
        said = [line for line in lines if not line.startswith("loco-drake: ")]
        if len(lines) != 1 or said:
            return f"not one sentence: {run.stderr[:300]!r}"
    if run.status == 1:
        if not lines:
            return "failed without a word"
        strange = [
            line
            for line in lines
            if not line.startswith(("loco-drake: ", "Failed: ", "The same command"))
        ]
        if strange:
            return f"not a sentence of ours: {strange[0][:300]!r}"
    return ""


def _what_it_wrote(kind: Kind, status: int | None, before: Files, after: Files) -> str:
    changed = {name for name in before | after if before.get(name) != after.get(name)}
    for path in ABSOLUTE:
        if path.exists():
            path.unlink()
            return f"written outside: {path}"
    for name in changed:
        if Path(name).name.startswith("canary") or not name.startswith("work/out/"):
            return f"written outside: {name}"
        if Path(name).name.startswith(".") and name in after:
            return f"left behind: {name}"
    if status == 2 and changed:
        return f"refused, but changed {', '.join(sorted(changed))[:300]}"
    if status == 1 and changed and not kind.partial:
        return f"failed, but changed {', '.join(sorted(changed))[:300]}"
    return ""


def _far(sound: Leaves, own: Leaves, changed: list[str]) -> str:
    """Returns what of an outcome is not near the sound one; empty if all is."""
    for name in changed:
        one, other = sound.get(name), own.get(name)
        numbers = (int, float, np.ndarray)
        if not isinstance(one, numbers) or not isinstance(other, numbers):
            return f"{name} is {other}, not {one}"
        off = np.abs(np.subtract(other, one, dtype=float)).max()
        if off > NEAR * np.abs(one).max() + 1e-3:
            return f"{name} is {off:.3g} from that of the sound input"
    return ""


def _gross(sound: Leaves, own: Leaves) -> str:
    """Returns what of a changed outcome cannot be; empty if all can be.

    The bounds are wide: another body moves so, but not this one.
    """
    for name, value in own.items():
        clean = sound.get(name)
        if isinstance(value, float) and not np.isfinite(value):
            return f"{name} is {value}"
        if "stance_height_m" in name or name.endswith(":scale"):
            ours = [v for k, v in sound.items() if k.endswith(name.rsplit(":", 1)[1])]
            if value is not None and ours and not 0.67 < value / ours[0] < 1.5:
                return f"{name} is {value}, not {ours[0]}"
        if "speed_mean_mps" in name and clean and not 0.5 < value / clean < 2:
            return f"{name} is {value}, not {clean}"
        if "correction_rmse_m" in name and value and value > 0.15:
            return f"{name} is {value}"
        if name.endswith("joint_speed_ratio_max") and value and value > 2.5:
            return f"{name} is {value}"
        if "base_velocity" in name:
            speed = np.linalg.norm(value, axis=1).max()
            usual = [
                np.linalg.norm(v, axis=1).max()
                for k, v in sound.items()
                if "base_velocity" in k
            ]
            if speed > 2 * max(usual) + 0.5:
                return f"{name} reaches {speed:.1f} m/s, not {max(usual):.1f}"
        if "base_angular_velocity" in name and np.abs(value).max() > 15:
            return f"{name} reaches {np.abs(value).max():.0f} rad/s"
        if "joint_velocities" in name and np.abs(value).max() > 60:
            return f"{name} reaches {np.abs(value).max():.0f} rad/s"
    return ""
