"""The kinds of files that are damaged: how each is made, read and damaged."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tests.fuzzing import drives, formats, makers, motions, text, weights
from tests.fuzzing.damage import Damage, Random, damage_bytes, hand_made
from tests.fuzzing.formats import Damages


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
        alike: tells of the sound file and another whether that may be sound, too.
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
    alike: Callable[[bytes, bytes], bool] | None = None


# File, source, gait, and how its numbers are written.
RECORDINGS = {
    "dog": ("dog.txt", "dog", "trot", formats.table(",", 0)),
    "dog BVH": ("dog.bvh", "dog", "trot", formats.bvh),
    "horse": ("horse.csv", "horse", "trot", formats.table(",", 0)),
    "horse, raw": ("raw.csv", "horse", "walk", formats.table(",", 1)),
    "mpc": ("mpc.txt", "mpc", "trot", formats.table(",", 0)),
    "solo8": ("solo8.txt", "solo8", "wave", formats.table(",", 0)),
}


_FETCH = "data fetch --from mirror --data-dir out/data --json out/figures.json"
_FETCH_PATCHES = {
    "loco_drake.datasets.download.MANIFEST": "manifest.csv",
    "loco_drake.datasets.segments.SHIPPED": "shipped.csv",
}


def _kinds() -> Iterator[Kind]:
    simulate = "simulate --no-meshcat --duration 0.06 --json out/figures.json"
    # All that the motion holds.
    simulate_all = simulate.replace("0.06", "1.0")
    yield Kind(
        "Motion, simulated",
        "motion.npz",
        f"{simulate_all} --reference {{target}}",
        makers.motion,
        motions.npz_files,
        share=5.0,
    )
    yield Kind(
        "Motion, trained on",
        "motions/dog-trot.npz",
        makers.TOKENIZER,
        makers.references,
        motions.npz_files,
        share=1.0,
        named=False,
    )
    yield Kind(
        "policy",
        "policy.safetensors",
        f"{simulate} --reference motion.npz --policy {{target}}",
        makers.policy,
        weights.safetensors_files,
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
            makers.model,
            weights.safetensors_files,
            share=2.0,
        )
    yield Kind(
        "checkpoint of a tokenizer",
        "out/run/checkpoint.safetensors",
        f"{makers.TOKENIZER} --resume",
        makers.tokenizer_run,
        weights.safetensors_files,
        named=False,
        in_place=True,
    )
    yield Kind(
        "checkpoint of a tracker",
        "out/run/checkpoint.safetensors",
        f"{makers.TRACKER} --resume",
        makers.tracker_run,
        weights.safetensors_files,
        share=0.8,
        named=False,
        in_place=True,
    )
    yield Kind(
        "log of a tracker",
        "out/run/progress.jsonl",
        f"{makers.TRACKER} --resume",
        makers.tracker_run,
        formats.last_line,
        share=0.8,
        named=False,
        in_place=True,
        alike=formats.logs_alike,
    )
    yield Kind(
        "checkpoint to start from",
        "checkpoint.safetensors",
        f"{makers.TRACKER} --start-from {{target}}",
        makers.start,
        weights.safetensors_files,
        share=0.8,
    )
    yield Kind(
        "policy to start from",
        "policy.safetensors",
        f"{makers.TRACKER} --start-from {{target}}",
        makers.start,
        weights.safetensors_files,
        share=0.8,
    )
    for form, (file, source, gait, damages) in RECORDINGS.items():
        options = f"--source {source} --json out/figures.json"
        for name, command, share in (
            ("retargeted", f"retarget --gait {gait} --out out", 2.0),
            ("inspected", "data inspect --save out/clip.png", 1.0),
        ):
            yield Kind(
                f"{form}, {name}",
                file,
                f"{command} {options} {{target}}",
                makers.recording(form, file),
                damages,
                share=share / 2,
                values=True,
            )
    yield Kind(
        "segments, listed",
        "data/segments.csv",
        "data list --data-dir data --json out/figures.json",
        makers.data,
        formats.document(text.csv_cells),
        named=False,
        values=True,
    )
    yield Kind(
        "segments, retargeted",
        "data/segments.csv",
        "retarget --data-dir data --out out/motions --json out/figures.json "
        "--trajectories 0",
        makers.data,
        formats.document(text.csv_cells),
        named=False,
        partial=True,
        values=True,
    )
    yield Kind(
        "segments, fetched",
        "out/data/segments.csv",
        _FETCH,
        makers.fetched,
        formats.document(text.csv_cells),
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
        makers.mirror,
        formats.document(text.csv_cells),
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
        makers.mirror,
        formats.table(",", 0),
        patches=_FETCH_PATCHES,
        share=0.8,
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
        makers.robot,
        formats.document(text.yaml_texts),
        share=1.5,
        values=True,
    )
    yield Kind(
        "URDF",
        "robot.urdf",
        f"{retarget} --robot robot.yaml",
        makers.robot,
        formats.document(text.xml_texts),
        share=2.0,
        named=False,
        values=True,
    )
    yield Kind(
        "source",
        "sources/dog.yaml",
        retarget,
        makers.sources,
        formats.document(text.yaml_texts),
        patches={"loco_drake.retargeting.scaling._SOURCES": "sources"},
        named=False,
        values=True,
    )
    for name in makers.results():
        yield Kind(
            f"results, {name}",
            f"results/{name}.json",
            "report --results results --labels none --html out/report.html "
            "--json out/figures.json",
            makers.result(name),
            formats.json_document,
            share=0.8,
            named=False,
        )
    yield Kind(
        "scenario",
        "scenario.yaml",
        f"{simulate} --scenario {{target}}",
        makers.scenario,
        formats.document(text.yaml_texts),
        share=1.5,
        values=True,
    )
    yield Kind(
        "commands to drive by",
        "commands.csv",
        f"{makers.DRIVE} --commands {{target}} --json out/figures.json "
        "--record out/drive.jsonl",
        makers.commands,
        formats.commands,
        values=True,
    )
    yield Kind(
        "drive, repeated",
        "drive.jsonl",
        f"{makers.DRIVE} --replay {{target}} --json out/figures.json "
        "--record out/drive.jsonl",
        makers.drive,
        drives.drive_files,
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
