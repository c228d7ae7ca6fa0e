"""What ``data inspect --skeleton`` prints and writes."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import yaml

from loco_drake.cli.output import print_lines
from loco_drake.common.errors import InputError
from loco_drake.common.files import atomic_path
from loco_drake.datasets.guess_skeleton import Guess, guess_skeleton
from loco_drake.datasets.named_points import NamedPoints, read_points
from loco_drake.datasets.recording import check_rate
from loco_drake.datasets.skeleton import SUFFIXES, Skeleton, plain_source

_WIDTH = 88


def inspect_skeleton(file: Path, fps: float | None, out: Path | None) -> dict[str, Any]:
    """Prints what a file holds and proposes a skeleton; returns the figures.

    Args:
        file: a BVH file or a table of points.
        fps: its rate; None for the one it tells.
        out: the YAML file to write; None for none.

    Raises:
        InputError: if it cannot be read, or holds no animal with four legs.
    """
    if out is not None and out.suffix not in SUFFIXES:
        raise InputError(f"A skeleton's file ends in .yaml, unlike {out}.")
    try:
        named = read_points(file)
        if fps is not None:
            check_rate(fps)
        print_lines(_contents(file, named))
        guess = _guess(named, fps)
    except InputError as error:
        known = str(file) in str(error)
        raise InputError(str(error) if known else f"{file}: {error}") from None
    guess.skeleton.source = plain_source(out.stem) if out is not None else "animal"
    text = _text(guess)
    print_lines(["", *_measured(guess), "", *_marked(named, guess.joints), ""])
    if out is None:
        print_lines(text.splitlines())
    else:
        with atomic_path(out) as temporary:
            temporary.write_text(text)
        print_lines([*(f"Check: {doubt}" for doubt in guess.doubts), f"Wrote {out}."])
    return {
        "form": named.form,
        "frames": len(named.positions),
        "fps": guess.fps,
        "points": list(named.names),
        "parents": list(named.parents),
        "skeleton": _fields(guess.skeleton),
        "height_m": guess.height * guess.skeleton.metres,
        "doubts": list(guess.doubts),
    }


def _contents(file: Path, named: NamedPoints) -> list[str]:
    """Returns lines on form, length and points of a file."""
    frames = len(named.positions)
    points = "joints and ends" if named.is_tree else "points"
    rate = "rate unknown"
    if named.fps is not None:
        rate = f"{named.fps:g} frames/s, {(frames - 1) / named.fps:.2f} s"
    return [
        f"{file.name}: {named.form}, {frames} frames, {rate}, "
        f"{len(named.names)} {points}"
    ]


def _measured(guess: Guess) -> list[str]:
    """Returns lines on the measured conventions."""
    skeleton, unit = guess.skeleton, guess.skeleton.metres
    lines = [
        f"Up axis: {skeleton.up}",
        f"Unit: {skeleton.units}; the trunk is {guess.height:.3g} over the toes, "
        f"{guess.height * unit:.3g} m",
    ]
    if guess.speed is not None:
        lines.append(f"Mean speed: {guess.speed * unit:.3g} m/s")
    if guess.timing is not None:
        lags = ", ".join(f"{lag:.2f}" for lag in guess.timing.phase_lags)
        lines.append(
            f"Stride period: {guess.timing.stride_period:.3g} s; FL, FR, RL, RR lag "
            f"behind RL by {lags}"
        )
    return lines


def _guess(named: NamedPoints, fps: float | None) -> Guess:
    """Returns the guess; prints the joints before it fails, to name them by hand."""
    try:
        return guess_skeleton(named, fps)
    except InputError:
        print_lines(["", *_marked(named, {})])
        raise


def _marked(named: NamedPoints, joints: dict[str, tuple[int, ...]]) -> list[str]:
    """Returns the joints, each below the one it hangs on, with what they may be."""
    what: dict[int, list[str]] = {}
    for name, indices in joints.items():
        for k in indices:
            what.setdefault(k, []).append(name)
    lines = []
    for k, name in enumerate(named.names):
        indent = "  " * len(named.ancestors(k))
        mark = f"  <- {', '.join(what[k])}" if k in what else ""
        lines.append(f"{indent}{name}{mark}")
    return lines


def _fields(skeleton: Skeleton) -> dict[str, Any]:
    """Returns the fields of a skeleton that differ from their defaults, and units."""
    default = asdict(Skeleton())
    return {
        name: value
        for name, value in asdict(skeleton).items()
        if value != default[name] or name == "units"
    }


def _text(guess: Guess) -> str:
    """Returns the YAML file, with the doubts as comments."""
    text = "".join(f"# Check: {doubt}\n" for doubt in guess.doubts)
    fields = _fields(guess.skeleton)
    return text + yaml.safe_dump(
        fields, sort_keys=False, default_flow_style=None, width=_WIDTH
    )
