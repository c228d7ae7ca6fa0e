"""The kinds of files that are damaged: how each is made, read and damaged."""

import csv
import hashlib
import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tests.fuzzing import archives, text
from tests.fuzzing.damage import Damage, Random, damage_bytes, hand_made

Damages = Callable[[bytes, Random], Iterator[Damage]]


@dataclass(frozen=True)
class Kind:
    """A kind of file, and a command that reads it.

    Attributes:
        name: of the kind.
        target: the file, in the working folder.
        command: what reads it; ``{target}`` is its path. All it writes goes to out/.
        make: writes the sound file, and whatever else the command needs.
        damages: edits that know the format.
        share: of the inputs.
        patches: constants of modules, and paths in the working folder for them.
        named: whether the command names the file, so that it may have another name.
        partial: whether a part of the work may be done and the status be 1.
        in_place: whether what is in out/ is what the command goes on with.
        values: whether another value in the file is another input, not damage, as long
            as what comes of it can be.
    """

    name: str
    target: str
    command: str
    make: Callable[[Path], None]
    damages: Damages
    share: float = 1.0
    patches: dict[str, str] = field(default_factory=dict)
    named: bool = True
    partial: bool = False
    in_place: bool = False
    values: bool = False


def _table(separator: str, header: int) -> Damages:
    def damages(data: bytes, random: Random) -> Iterator[Damage]:
        for _ in range(2):
            yield from text.tables(data.decode(), separator, header, random)
        yield from text.encodings(data.decode())

    return damages


def _of(*parts: Callable[[str, Random], Iterator[Damage]]) -> Damages:
    def damages(data: bytes, random: Random) -> Iterator[Damage]:
        for part in parts:
            yield from part(data.decode(), random)
        yield from text.encodings(data.decode())

    return damages


def _json(data: bytes, random: Random) -> Iterator[Damage]:
    yield from text.json_texts(json.loads(data), 250, random)
    yield from text.encodings(data.decode())


def _lines(data: bytes, random: Random) -> Iterator[Damage]:
    rows = data.decode().splitlines()
    for damage in text.json_texts(json.loads(rows[-1]), 80, random):
        body = b"\n".join([*(row.encode() for row in rows[:-1]), damage.data]) + b"\n"
        yield Damage(f"last line: {damage.what}", body)
    yield from text.encodings(data.decode())


def _motion(
    folder: Path,
    name: str = "motion.npz",
    label: str = "dog-trot",
    seconds: float = 1.0,
) -> None:
    from loco_drake.motion.motion_file import save_motion
    from tests.synthetic_motion import synthetic_motion

    save_motion(synthetic_motion(label, seconds), folder / name)


def _policy(folder: Path) -> None:
    from loco_drake.models.shipped import pretrained_path

    _motion(folder)
    shutil.copy(pretrained_path("policy_go2"), folder / "policy.safetensors")


def _model(folder: Path) -> None:
    from loco_drake.common.weights import save_network
    from tests.tiny_model import make_tiny_model

    model = make_tiny_model()
    save_network(
        folder / "tokenizer.safetensors", "tokenizer", model.tokenizer, half=True
    )
    save_network(
        folder / "generator.safetensors", "generator", model.generator, half=True
    )


def _references(folder: Path) -> None:
    for label in ("dog-trot", "dog-pace"):
        _motion(folder, f"motions/{label}.npz", label, 2.0)


def _run(folder: Path, *command: str) -> None:
    """Makes what a training leaves, by the command itself."""
    from tests.fuzzing.worker import Worker

    worker = Worker()
    run = worker.run(list(command), folder, seconds=200.0)
    worker.close()
    assert run.status == 0, run.stderr


_TOKENIZER = "train tokenizer --motions motions --steps 2 --out out/run"
_TRACKER = (
    "train tracker --references motions --steps 64 --batch 32 --workers 1 "
    "--per-worker 2 --out out/run --json out/figures.json"
)


def _tokenizer_run(folder: Path) -> None:
    _references(folder)
    _run(folder, *_TOKENIZER.split())


def _tracker_run(folder: Path) -> None:
    _references(folder)
    _run(folder, *_TRACKER.split())
    shutil.copy(folder / "out/run/checkpoint.safetensors", folder)


def _start(folder: Path) -> None:
    _tracker_run(folder)
    shutil.rmtree(folder / "out")


def _recording(form: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        from tests import synthetic, synthetic_bvh, synthetic_horse, synthetic_robots

        path = folder / RECORDINGS[form][0]
        match form:
            case "dog":
                synthetic.write_dog_recording(path, "trot", seconds=2.0)
            case "dog BVH":
                synthetic_bvh.write_dog_bvh(path, "trot", seconds=1.5)
            case "horse":
                horse = synthetic_horse.make_horse("trot", 60.0, 3.0)
                synthetic_horse.write_world_recording(path, horse)
            case "horse, raw":
                horse = synthetic_horse.make_horse("walk", 60.0, 4.0)
                synthetic_horse.write_raw_recording(path, horse)
            case "mpc":
                synthetic_robots.write_mpc_recording(path, "trot", seconds=2.0)
            case "solo8":
                synthetic_robots.write_solo8_recording(path)

    return make


# File, source, gait, and how its numbers are written.
RECORDINGS = {
    "dog": ("dog.txt", "dog", "trot", _table(",", 0)),
    "dog BVH": ("dog.bvh", "dog", "trot", None),
    "horse": ("horse.csv", "horse", "trot", _table(",", 0)),
    "horse, raw": ("raw.csv", "horse", "walk", _table(",", 1)),
    "mpc": ("mpc.txt", "mpc", "trot", _table(",", 0)),
    "solo8": ("solo8.txt", "solo8", "wave", _table(",", 0)),
}


def _bvh(data: bytes, random: Random) -> Iterator[Damage]:
    lines = data.decode().splitlines()
    head = next(k for k, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    yield from text.tables(data.decode(), " ", head, random)
    yield from text.encodings(data.decode())
    words = (
        "",
        "nan",
        "-1",
        "1e300",
        "0",
        "1e9",
        "x" * 10_000,
        "ROOT",
        "End",
        "{",
        "6",
    )
    words += ("}", "Xposition", "a\nb", "\x1b[31m", "3.7", "16.6667", "٣")
    places = [
        (k, n) for k, line in enumerate(lines[:head]) for n in range(len(line.split()))
    ]
    for k in random.permutation(len(places) * len(words))[:200]:
        (row, column), word = places[k // len(words)], words[k % len(words)]
        cells = lines[row].split()
        old, cells[column] = cells[column], word
        new = [*lines[:row], " ".join(cells), *lines[row + 1 :]]
        what = f"line {row + 1}: {old} is {word[:20]!a}"
        yield Damage(what, ("\n".join(new) + "\n").encode())
    for k in random.permutation(head)[:25]:
        gone, twice = lines[:k] + lines[k + 1 :], lines[: k + 1] + lines[k:]
        yield Damage(f"line {k + 1} missing", ("\n".join(gone) + "\n").encode())
        yield Damage(f"line {k + 1} twice", ("\n".join(twice) + "\n").encode())
    deep = "HIERARCHY\nROOT a\n" + "{\nJOINT a\n" * 20_000
    yield Damage("deep", deep.encode())


def _data(folder: Path) -> None:
    from tests.synthetic import write_data_folder

    write_data_folder(folder / "data", ("pace", "trot"), 2.0)


def _mirror(folder: Path) -> None:
    from tests.synthetic import write_data_folder

    mirror = write_data_folder(folder / "mirror", ("pace", "trot"), 1.0)
    rows = [["file", "repository", "commit", "path", "bytes", "sha256"]]
    for path in sorted(mirror.rglob("*.txt")):
        content = path.read_bytes()
        name = path.relative_to(mirror).as_posix()
        checksum = hashlib.sha256(content).hexdigest()
        rows.append([name, "owner/name", "0" * 40, name, str(len(content)), checksum])
    with (folder / "manifest.csv").open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
    shutil.copy(mirror / "segments.csv", folder / "shipped.csv")


def _fetched(folder: Path) -> None:
    _mirror(folder)
    shutil.copytree(folder / "mirror", folder / "out/data")


_FETCH = "data fetch --mirror mirror --data-dir out/data --json out/figures.json"
_FETCH_PATCHES = {
    "loco_drake.datasets.download.MANIFEST": "manifest.csv",
    "loco_drake.datasets.segments.SHIPPED": "shipped.csv",
}


def _robot(folder: Path) -> None:
    from tests.made_inputs import robot_yaml, urdf

    _recording("dog")(folder)
    (folder / "robot.urdf").write_text(urdf())
    (folder / "robot.yaml").write_text(robot_yaml("robot.urdf"))


def _sources(folder: Path) -> None:
    from loco_drake.retargeting import scaling

    _recording("dog")(folder)
    shutil.copytree(Path(scaling.__file__).parent / "sources", folder / "sources")


def _result(name: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        from loco_drake.models.shipped import pretrained_dir

        (folder / "results").mkdir()
        shutil.copy(pretrained_dir() / "results" / f"{name}.json", folder / "results")

    return make


def _scenario(folder: Path) -> None:
    _motion(folder)
    (folder / "scenario.yaml").write_text(
        "robot: go2\n"
        "plant: {contact: similar, time_step: 0.01, friction: 0.8}\n"
        "reference: !MotionReference {path: motion.npz}\n"
        "policy: !TrainedPolicy {}\n"
    )


def _kinds() -> Iterator[Kind]:
    simulate = "simulate --no-meshcat --duration 0.06 --json out/figures.json"
    yield Kind(
        "Motion, simulated",
        "motion.npz",
        f"{simulate} --reference {{target}}",
        _motion,
        archives.npz_files,
        share=5.0,
    )
    yield Kind(
        "Motion, trained on",
        "motions/dog-trot.npz",
        _TOKENIZER,
        _references,
        archives.npz_files,
        share=1.0,
        named=False,
    )
    yield Kind(
        "policy",
        "policy.safetensors",
        f"{simulate} --reference motion.npz --policy {{target}}",
        _policy,
        archives.safetensors_files,
        share=2.0,
    )
    generate = (
        "generate --tokenizer {0} --generator {1} --duration 0.4 --out out "
        "--json out/figures.json"
    )
    for name, files in (
        ("tokenizer", ("{target}", "generator.safetensors")),
        ("generator", ("tokenizer.safetensors", "{target}")),
    ):
        yield Kind(
            name,
            f"{name}.safetensors",
            generate.format(*files),
            _model,
            archives.safetensors_files,
            share=2.0,
        )
    yield Kind(
        "checkpoint of a tokenizer",
        "out/run/checkpoint.safetensors",
        f"{_TOKENIZER} --resume",
        _tokenizer_run,
        archives.safetensors_files,
        named=False,
        in_place=True,
    )
    yield Kind(
        "checkpoint of a tracker",
        "out/run/checkpoint.safetensors",
        f"{_TRACKER} --resume",
        _tracker_run,
        archives.safetensors_files,
        share=0.2,
        named=False,
        in_place=True,
    )
    yield Kind(
        "log of a tracker",
        "out/run/progress.jsonl",
        f"{_TRACKER} --resume",
        _tracker_run,
        _lines,
        share=0.1,
        named=False,
        in_place=True,
        values=True,
    )
    yield Kind(
        "checkpoint to start from",
        "checkpoint.safetensors",
        f"{_TRACKER} --start-from {{target}}",
        _start,
        archives.safetensors_files,
        share=0.2,
    )
    for form, (file, source, gait, damages) in RECORDINGS.items():
        options = f"--source {source} --json out/figures.json"
        for name, command, share in (
            ("retargeted", f"retarget --gait {gait} --out out", 2.0),
            ("inspected", "data inspect --out out/clip.png", 1.0),
        ):
            yield Kind(
                f"{form}, {name}",
                file,
                f"{command} {options} {{target}}",
                _recording(form),
                damages or _bvh,
                share=share / 2,
                values=True,
            )
    yield Kind(
        "segments, listed",
        "data/segments.csv",
        "data list --data-dir data --json out/figures.json",
        _data,
        _of(text.csv_cells),
        named=False,
        values=True,
    )
    yield Kind(
        "segments, retargeted",
        "data/segments.csv",
        "retarget --data-dir data --out out/motions --json out/figures.json "
        "--trajectories 0",
        _data,
        _of(text.csv_cells),
        named=False,
        partial=True,
        values=True,
    )
    yield Kind(
        "segments, fetched",
        "out/data/segments.csv",
        _FETCH,
        _fetched,
        _of(text.csv_cells),
        patches=_FETCH_PATCHES,
        share=0.5,
        named=False,
        partial=True,
        in_place=True,
        values=True,
    )
    yield Kind(
        "manifest",
        "manifest.csv",
        _FETCH,
        _mirror,
        _of(text.csv_cells),
        patches=_FETCH_PATCHES,
        share=1.0,
        named=False,
        partial=True,
        values=True,
    )
    yield Kind(
        "copy of a recording",
        "mirror/dog_mann/keypoints/made_trot.txt",
        _FETCH,
        _mirror,
        _table(",", 0),
        patches=_FETCH_PATCHES,
        share=0.3,
        named=False,
        partial=True,
    )
    retarget = (
        "retarget dog.txt --source dog --gait trot --out out --json out/figures.json"
    )
    yield Kind(
        "robot",
        "robot.yaml",
        f"{retarget} --robot {{target}}",
        _robot,
        _of(text.yaml_texts),
        share=1.5,
        values=True,
    )
    yield Kind(
        "URDF",
        "robot.urdf",
        f"{retarget} --robot robot.yaml",
        _robot,
        _of(text.xml_texts),
        share=2.0,
        named=False,
        values=True,
    )
    yield Kind(
        "source",
        "sources/dog.yaml",
        retarget,
        _sources,
        _of(text.yaml_texts),
        patches={"loco_drake.retargeting.scaling._SOURCES": "sources"},
        named=False,
        values=True,
    )
    for name in ("tracking-go2-generated", "retargeting", "generation", "learning-go2"):
        yield Kind(
            f"results, {name}",
            f"results/{name}.json",
            "report --results results --replays none --out out/report.html "
            "--json out/figures.json",
            _result(name),
            _json,
            share=0.2,
            named=False,
        )
    yield Kind(
        "scenario",
        "scenario.yaml",
        f"{simulate} --scenario {{target}}",
        _scenario,
        _of(text.yaml_texts),
        share=1.5,
        values=True,
    )


KINDS = {kind.name: kind for kind in _kinds()}


def inputs(kind: Kind, data: bytes, count: int, random: Random) -> list[Damage]:
    """Returns ``count`` damaged files of a kind, spread over all ways to damage it."""
    known = [
        damage
        for damage in (
            *hand_made(data, Path(kind.target).name),
            *kind.damages(data, random),
        )
        if kind.named or damage.name is None
    ]
    at_random = count // 4
    if len(known) > count - at_random:
        kept = sorted(random.permutation(len(known))[: count - at_random])
        known = [known[int(k)] for k in kept]
    more = [damage_bytes(data, random) for _ in range(count - len(known))]
    return known + more
