"""Memory and time of retargeting, packing and training, against the number of clips.

`retarget` makes that many steered variants of 1.5 s of a cat's trot. The clips that are
packed and learned from, of 1.5 s too, are cut at different moments out of generated
motion that was steered: enough for memory, not for learning. Each command is a process
of its own, whose peak of resident memory Linux tells. Nothing is mapped into
memory, so that files which the system keeps there do not count.

100,000 clips take 5 GB of disk and about half an hour of one core. Run it from the root
of the repository:

    OMP_NUM_THREADS=1 python benchmarks/library.py --counts 1000 10000 100000

With `--made` only the tokenizer is trained, on features that are made instead of read,
which takes some minutes.
"""

import os
import re
import shutil
import subprocess
import sys
import time
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import NamedTemporaryFile, TemporaryDirectory
from typing import Any

import numpy as np
import tyro

from loco_drake.cli.output import write_json
from loco_drake.motion.motion import FPS, Motion
from loco_drake.motion.motion_file import motion_bytes
from loco_drake.motion.motion_folder import open_motions

GAITS = ("dog-trot", "dog-pace", "horse-walk", "mpc-bound", "solo8-crawl")
SECONDS = 10.0  # of each motion that clips are cut out of
FRAMES = round(1.5 * FPS) + 1  # of a clip
CAT = "examples/cat.bvh --source examples/cat.yaml --gait trot --start 275 --end 351"
STATUS = Path("/proc/self/status")
COMMANDS = ("retarget", "data pack", "train tokenizer", "train generator")


def peak_mb() -> float:
    """Returns the highest resident memory that this process had, in MB.

    Linux tells it. That of getrusage counts the parent of a process, too.
    """
    (line,) = re.findall(r"^VmHWM:\s*(\d+) kB$", STATUS.read_text(), re.M)
    return int(line) / 1024


def measured(*arguments: str) -> dict[str, float]:
    """Runs ``loco-drake`` with arguments; returns its peak memory, CPU time and time.

    Raises:
        RuntimeError: if it fails.
    """
    begin = time.perf_counter()
    with NamedTemporaryFile() as told:
        command = [sys.executable, __file__, "--run", told.name, *arguments]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            raise RuntimeError(f"{' '.join(arguments)} failed: {process.returncode}")
        peak = float(Path(told.name).read_text())
    return {
        "peak_mb": peak,
        "cpu_s": usage.ru_utime + usage.ru_stime,
        "wall_s": time.perf_counter() - begin,
    }


def run(told: Path, arguments: list[str]) -> int:
    """Runs ``loco-drake`` in this process and writes its peak memory to a file."""
    from loco_drake.cli.main import main

    status = main(arguments)
    told.write_text(str(peak_mb()))
    return status


def generate(folder: Path, motions: int) -> None:
    """Writes steered motion to cut clips out of, about as much of each gait."""
    for gait in GAITS:
        options = f"--gait {gait} --count {motions // len(GAITS)} --duration {SECONDS}"
        measured("generate", *options.split(), "--steer", "--out", str(folder))


def cut_clips(motions: Sequence[Motion], count: int) -> Iterator[bytes]:
    """Yields Motion files, cut at different moments.

    They say what they are cut out of, as those of recordings do; every tenth motion is
    held out.
    """
    starts = len(motions[0]) - FRAMES
    for number in range(count):
        turn, source = divmod(number, len(motions))
        start = 7 * turn % starts  # 7 divides no number of starts that is used here
        clip = motions[source].slice(start, start + FRAMES)
        origin = {
            "recording": str(source),
            "file": str(source),
            "frames": f"{start}-{start + FRAMES}",
            "split": "train" if source % 10 else "validation",
        }
        provenance = {**clip.provenance, **origin}
        yield motion_bytes(replace(clip, provenance=provenance))


def measure(folder: Path, sources: Path, count: int) -> dict[str, Any]:
    """Makes ``count`` clips, packs them and trains on them; returns the figures."""
    figures: dict[str, Any] = {"clips": count}
    options = f"{CAT} --steered {count} --out {folder}/cat"
    figures["retarget"] = measured("retarget", *options.split())
    shutil.rmtree(folder / "cat")
    plain, packed = folder / "plain", folder / "packed"
    plain.mkdir(parents=True)
    for number, content in enumerate(cut_clips(list(open_motions(sources)), count)):
        (plain / f"{number:06}.npz").write_bytes(content)
    figures["data pack"] = measured(
        "data", "pack", "--motions", str(plain), "--out", str(packed)
    )
    shutil.rmtree(plain)
    figures["packed_mb"] = sum(p.stat().st_size for p in packed.iterdir()) / 2**20
    runs = folder / "runs"
    options = f"--motions {packed} --steps 40 --out {runs}/tokenizer"
    figures["train tokenizer"] = measured("train", "tokenizer", *options.split())
    options = (
        f"--motions {packed} --steps 20 --out {runs}/generator --stitched 8 "
        f"--tokenizer {runs}/tokenizer/tokenizer.safetensors"
    )
    figures["train generator"] = measured("train", "generator", *options.split())
    shutil.rmtree(folder)
    return figures


def train_on_made(folder: Path, count: int, steps: int = 110) -> None:
    """Trains the tokenizer on random features of ``count`` clips; prints its memory."""
    from loco_drake.generation.clips import Chosen, Clip, ClipFile
    from loco_drake.generation.features import CONTACTS, HEIGHT, JOINTS, SIZE
    from loco_drake.generation.loop_settings import LoopSettings
    from loco_drake.generation.tokenizer import TokenizerConfig
    from loco_drake.generation.train_tokenizer import train_tokenizer
    from loco_drake.generation.training_motions import Library
    from loco_drake.models.robots import get_robot
    from loco_drake.motion.gaits import LABELS

    random = np.random.default_rng(0)
    base = np.cumsum(random.normal(size=(200, FRAMES, SIZE)) * 0.02, axis=1)
    base[..., JOINTS] += get_robot("go2").stand_joints
    base[..., HEIGHT] += 1
    base[..., CONTACTS] = base[..., CONTACTS] > 0
    begin = peak_mb()
    clips = ClipFile(folder)
    train, mirrors, held_out = (array("q") for _ in range(3))
    for number in range(count):
        features = np.roll(base[number % 200], number // 200 % FRAMES, axis=0)
        label, name = LABELS[number % len(GAITS)], f"r{number % 200}"
        clip = Clip("go2", label, name, features, f"{number:016x}")
        for rows in (train, mirrors) if number % 10 else (held_out,):
            rows.append(len(clips))
            clips.append(clip)  # itself in the place of its mirror image
    library = Library(Chosen(clips, train + mirrors), Chosen(clips, held_out))
    training = LoopSettings(folder / str(count), steps, 1e-3)
    train_tokenizer(library, TokenizerConfig(robots=("go2",)), training)
    print(
        f"{count:7} clips, train tokenizer: {peak_mb():.0f} MB, {begin:.0f} MB of "
        f"them before the first clip; {time.process_time():.0f} s of CPU",
        flush=True,
    )


def main(
    counts: tuple[int, ...] = (1000, 10_000, 100_000),
    motions: int = 250,
    folder: Path | None = None,
    json: Path | None = None,
    made: bool = False,
) -> None:
    """Prints peak memory and CPU time of each command at each number of clips.

    Args:
        counts: numbers of clips.
        motions: number of motions that they are cut out of.
        folder: where files are made and removed; temporary if there is none.
        json: file for the figures.
        made: whether only to train, on made features; several counts in a process each.
    """
    if made and len(counts) > 1:
        for count in counts:
            options = ["--made", "--counts", str(count)]
            options += [] if folder is None else ["--folder", str(folder)]
            subprocess.run([sys.executable, __file__, *options], check=True)
        return
    with TemporaryDirectory(dir=folder) as name:
        if made:
            train_on_made(Path(name), *counts)
            return
        sources = Path(name) / "sources"
        generate(sources, motions)
        found = []
        for count in counts:
            figures = measure(Path(name) / str(count), sources, count)
            found.append(figures)
            for command in COMMANDS:
                of, first = figures[command], found[0][command]
                print(
                    f"{count:7} clips, {command}: {of['peak_mb']:.0f} MB, "
                    f"{of['peak_mb'] / first['peak_mb']:.2f} of that at {counts[0]}; "
                    f"{of['cpu_s']:.0f} s of CPU",
                    flush=True,
                )
            print(f"{count:7} clips: {figures['packed_mb']:.0f} MB packed", flush=True)
    if json is not None:
        write_json(json, {"sizes": found})


if __name__ == "__main__":
    if sys.argv[1:2] == ["--run"]:
        sys.exit(run(Path(sys.argv[2]), sys.argv[3:]))
    tyro.cli(main)
