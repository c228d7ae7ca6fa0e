"""The loop: damage, run, judge, tell."""

import json
import os
import shutil
import tempfile
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tests.fuzzing.damage import Damage
from tests.fuzzing.judge import BEFORE, Leaves, differing, judge, outcome, snapshot
from tests.fuzzing.kinds import KINDS, Kind, inputs
from tests.fuzzing.processes import difference, run_process
from tests.fuzzing.worker import Run, Worker

VERDICTS = ("refused", "failed", "identical", "mended", "other value", "BAD")


@dataclass(kw_only=True)
class Options:
    """Damages files of every kind and gives them to the command line."""

    count: int = 3000
    """Damaged inputs in all."""
    keep: Path = Path("fuzzing")
    """Folder for the record, and for inputs that do what they must not."""
    seed: int = 0
    """What they are drawn with."""
    kinds: tuple[str, ...] = ()
    """Parts of the names of kinds. Default: all."""
    processes: int = 2
    """Inputs of each kind that a process of its own gets, too, for comparison."""
    again: bool = False
    """Tries those again that did what they must not; for a mended product."""
    anew: bool = False
    """Does not go on with the record, but writes a new one."""


@dataclass(frozen=True)
class Sound:
    """A kind's sound input, and what comes of it.

    Attributes:
        folder: with all files.
        run: of the command.
        leaves: what it wrote.
        varying: those that no two runs have in common.
        written: names of the files it wrote.
    """

    folder: Path
    run: Run
    leaves: Leaves
    varying: set[str]
    written: list[str]


def fuzz(options: Options) -> int:
    """Tries the inputs, prints the table; returns 1 if one did what it must not."""
    chosen = [
        kind
        for name, kind in KINDS.items()
        if not options.kinds or any(part in name for part in options.kinds)
    ]
    total = sum(kind.share for kind in chosen)
    options.keep.mkdir(parents=True, exist_ok=True)
    record = options.keep / f"record-{options.seed}.jsonl"
    if options.anew:
        record.unlink(missing_ok=True)
    done = {}
    if record.is_file():
        for line in record.read_text().splitlines():
            row = json.loads(line)
            done[row["kind"], row["index"], row["what"]] = row
    if options.again:
        done = {key: row for key, row in done.items() if row["verdict"] != "BAD"}
    rows = []
    start = time.monotonic()
    with Fuzzer(options.keep) as fuzzer, record.open("a") as file:
        for kind in chosen:
            count = round(options.count * kind.share / total)
            drawn = np.random.default_rng([options.seed, 1, *kind.name.encode()])
            real = set(drawn.permutation(count)[: options.processes].tolist())
            for index, damage in enumerate(fuzzer.inputs(kind, count, options.seed)):
                row = done.get((kind.name, index, damage.what))
                if row is None:
                    verdict, why = fuzzer.attempt(
                        kind, damage, f"{options.seed}-{index}", real=index in real
                    )
                    row = {"kind": kind.name, "index": index, "what": damage.what}
                    row |= {"verdict": verdict, "why": why, "process": index in real}
                    print(json.dumps(row), file=file, flush=True)
                    if verdict == "BAD":
                        print(f"{kind.name} {index}: {damage.what}: {why}", flush=True)
                rows.append(row)
    print_table(rows)
    compared = sum(row["process"] for row in rows)
    print(f"{len(rows)} inputs in {time.monotonic() - start:.0f} s")
    print(f"{compared} of them in a process of their own, too")
    return int(any(row["verdict"] == "BAD" for row in rows))


def print_table(rows: list[dict]) -> None:
    """Prints how many inputs of each kind came to which end."""
    counts: dict[str, Counter] = defaultdict(Counter)
    for row in rows:
        for name in (row["kind"], "all"):
            counts[name][row["verdict"]] += 1
    print(f"| {'kind':26} | inputs | {' | '.join(VERDICTS)} |")
    print("|---" * (len(VERDICTS) + 2) + "|")
    for name in [*dict.fromkeys(row["kind"] for row in rows), "all"]:
        count = counts[name]
        cells = " | ".join(f"{count[v]:{len(v)}}" for v in VERDICTS)
        print(f"| {name:26} | {sum(count.values()):6} | {cells} |")


class Fuzzer:
    """Makes sound files once for each kind, and tries damaged ones."""

    def __init__(self, keep: Path) -> None:
        self._keep = keep
        self._worker = Worker()
        self._sound: dict[str, Sound] = {}

    def __enter__(self) -> "Fuzzer":
        self._scratch = tempfile.TemporaryDirectory(prefix="fuzzing-")
        return self

    def __exit__(self, *_: object) -> None:
        self._worker.close()
        self._scratch.cleanup()

    def inputs(self, kind: Kind, count: int, seed: int) -> list[Damage]:
        """Returns the damaged files to try."""
        data = (self._of(kind).folder / kind.target).read_bytes()
        random = np.random.default_rng([seed, *kind.name.encode()])
        return inputs(kind, data, count, random)

    def attempt(
        self, kind: Kind, damage: Damage, label: str, real: bool = False
    ) -> tuple[str, str]:
        """Returns the verdict on one input, and the reason if it is "BAD".

        Args:
            kind: of the input.
            damage: to the input.
            label: name of the folder for it if it is "BAD".
            real: whether to compare with a process of its own.
        """
        sound = self._of(kind)
        target = self._lay(kind, damage, sound)
        case = Path(self._scratch.name) / "case"
        work = case / "work"
        if kind.alike is not None and damage.place is None:
            data = (sound.folder / kind.target).read_bytes()
            legal = damage.legal or kind.alike(data, damage.data)
            damage = replace(damage, legal=legal)
        before = snapshot(case)
        run = self._run(kind, work, target.relative_to(work), sound.run.seconds)
        leaves: Leaves | str = {}
        if run.status == 0:
            try:
                leaves = outcome(work / "out")
            except Exception as error:  # whatever a half-written file leads to
                leaves = f"{type(error).__name__}: {error}"
        files = before, snapshot(case)
        verdict, why = judge(
            damage,
            kind,
            run,
            sound.run,
            files,
            (sound.leaves, leaves),
            sound.varying,
        )
        if real and verdict != "BAD":
            shutil.rmtree(case)
            self._lay(kind, damage, sound)
            place = target.relative_to(work)
            alone = self._run(kind, work, place, sound.run.seconds, real=True)
            why = difference(run, alone)
            if why:
                verdict, why = "BAD", f"a process of its own: {why}"
        if verdict == "BAD":
            kept = self._keep / re_named(kind.name) / label
            shutil.rmtree(kept, ignore_errors=True)
            kept.mkdir(parents=True)
            if damage.place is None:
                (kept / Path(kind.target).name).write_bytes(damage.data[: 2**24])
            told = [damage.what, why, " ".join(self._argv(kind, target)), run.stderr]
            (kept / "what").write_text("\n".join(told), errors="replace")
        shutil.rmtree(case)
        return verdict, why

    def _lay(self, kind: Kind, damage: Damage, sound: Sound) -> Path:
        """Lays out what a command needs, with the damaged file; returns its path."""
        work = Path(self._scratch.name) / "case" / "work"
        shutil.copytree(sound.folder, work)
        target = work / kind.target
        target.unlink()
        if damage.name is not None:
            target = target.with_name(damage.name)
        if damage.place is None:
            target.write_bytes(damage.data)
        else:
            damage.place(target)
        if not kind.in_place:
            for name in sound.written:
                (work / "out" / name).parent.mkdir(parents=True, exist_ok=True)
                (work / "out" / name).write_bytes(BEFORE)
        return target

    def _argv(self, kind: Kind, target: Path) -> list[str]:
        return [
            os.fspath(target) if word == "{target}" else word
            for word in kind.command.split()
        ]

    def _run(
        self, kind: Kind, work: Path, target: Path, seconds: float, real: bool = False
    ) -> Run:
        (work / "out").mkdir(exist_ok=True)
        cache = Path(tempfile.gettempdir()) / "loco_drake_fuzzing_cache"
        run = run_process if real else self._worker.run
        return run(
            self._argv(kind, target),
            work,
            {name: str(work / path) for name, path in kind.patches.items()},
            {"LOCO_DRAKE_CACHE": str(cache)},
            seconds,
        )

    def _of(self, kind: Kind) -> Sound:
        if kind.name not in self._sound:
            folder = Path(self._scratch.name) / re_named(kind.name)
            folder.mkdir()
            kind.make(folder)
            ends = []
            for k in range(2):
                work = Path(self._scratch.name) / f"sound-{k}"
                shutil.rmtree(work, ignore_errors=True)
                shutil.copytree(folder, work)
                run = self._run(kind, work, Path(kind.target), 200.0)
                assert run.status == 0, (kind.name, run)
                ends.append((run, outcome(work / "out")))
                out = work / "out"
                written = [
                    path.relative_to(out).as_posix()
                    for path in out.rglob("*")
                    if path.is_file() and "events" not in path.name
                ]
                shutil.rmtree(work)
            (run, leaves), (_, again) = ends
            varying = set(differing(leaves, again))
            self._sound[kind.name] = Sound(folder, run, leaves, varying, written)
        return self._sound[kind.name]


def re_named(name: str) -> str:
    """Returns a kind's name as that of a folder."""
    return name.replace(", ", "-").replace(" ", "-")
