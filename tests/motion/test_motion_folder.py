"""Packed folders: what they hold, and what becomes of damage and of kills."""

import json
import os
import shutil
import signal
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from loco_drake.cli.main import main
from loco_drake.common.errors import InputError
from loco_drake.motion import packing
from loco_drake.motion.motion import UNITS
from loco_drake.motion.motion_file import save_motion
from loco_drake.motion.motion_folder import INDEX, MotionFiles, open_motions
from tests.synthetic_motion import synthetic_motion


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """Folders of two robots, of 4 and 3 motions; one is inside another folder."""
    folder = tmp_path_factory.mktemp("plain")
    for robot, count in (("go2", 4), ("a1", 3)):
        for i in range(count):
            name = f"more/{i}.npz" if i == 1 else f"{i}.npz"
            side = "validation" if i == 2 else "train"
            motion = synthetic_motion(
                ("dog-trot", "dog-pace")[i % 2], 0.2 + 0.02 * i, name=robot, split=side
            )
            save_motion(motion, folder / robot / name)
    return folder


@pytest.fixture
def three(monkeypatch):
    """Shards of three motions."""
    monkeypatch.setattr(packing, "SHARD_MOTIONS", 3)


def folders(plain):
    return plain / "go2", plain / "a1"


def files_of(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_a_packed_folder_holds_the_motions_as_they_were(plain, three, tmp_path):
    out = tmp_path / "packed"
    told = []
    packed = packing.pack(folders(plain), out, report=lambda *done: told.append(done))
    assert told == [(3, 7), (6, 7), (7, 7)]
    assert (packed.motions, packed.shards, packed.robots) == (7, 3, {"go2", "a1"})
    assert packed.of_label == {"dog-trot": 4, "dog-pace": 3}
    shards = [f"motions-0000{i}.zip" for i in range(3)]
    assert list(files_of(out)) == [*shards, INDEX]
    motions = open_motions(out)
    go2 = ["0.npz", "2.npz", "3.npz", "more/1.npz"]
    a1 = ["0.npz", "2.npz", "more/1.npz"]
    assert motions.names == [*(f"go2/{x}" for x in go2), *(f"a1/{x}" for x in a1)]
    files = [plain / name for name in motions.names]
    for row, path in enumerate(files):
        assert motions.content(row) == path.read_bytes()
    both = [*open_motions(folders(plain)[0]), *open_motions(folders(plain)[1])]
    for a, b in zip(motions, both, strict=True):
        assert (a.robot, a.label, a.provenance) == (b.robot, b.label, b.provenance)
        for name in UNITS:
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert [m.provenance["split"] for m in motions[1:3]] == ["validation", "train"]
    assert len(motions[-1]) == len(both[-1])


def test_packed_folders_can_be_packed(plain, three, tmp_path):
    packing.pack(folders(plain), tmp_path / "one")
    packing.pack([tmp_path / "one"], tmp_path / "two")
    one, two = map(open_motions, (tmp_path / "one", tmp_path / "two"))
    assert two.names == [f"one/{name}" for name in one.names]
    assert [two.content(i) for i in range(7)] == [one.content(i) for i in range(7)]


def test_the_index_says_what_there_is(plain, tmp_path):
    packing.pack(folders(plain), tmp_path)
    header, *lines = map(json.loads, (tmp_path / INDEX).read_text().splitlines())
    assert header == {"schema_version": 1, "motions": 7, "shards": 1}
    assert {line["robot"] for line in lines} == {"go2", "a1"}
    assert lines[1]["label"] == "dog-trot"
    assert lines[1]["split"] == "validation"
    assert [line["frames"] for line in lines[:3]] == [11, 13, 14]


def test_a_killed_packing_goes_on_and_makes_the_same_files(plain, tmp_path):
    """It is killed as it writes the second shard of three."""
    script = (
        "import os, signal, sys\n"
        "from pathlib import Path\n"
        "from loco_drake.motion import packing\n"
        "packing.SHARD_MOTIONS = 3\n"
        "plain = packing._member\n"
        "def member(name):\n"
        "    if name == 'go2/more/1.npz':\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "    return plain(name)\n"
        "packing._member = member\n"
        "packing.pack([Path(a) for a in sys.argv[2:]], Path(sys.argv[1]))\n"
    )
    names = map(str, folders(plain))
    out = tmp_path / "killed"
    done = subprocess.run([sys.executable, "-c", script, str(out), *names], check=False)
    assert done.returncode == -signal.SIGKILL
    left = [path.name for path in out.iterdir() if not path.name.startswith(".")]
    assert left == ["motions-00000.zip"]
    assert len(list(out.iterdir())) == 2
    with pytest.raises(InputError, match="not packed to its end; `data pack --resume"):
        open_motions(out)
    with pytest.raises(InputError, match="holds packed motion already; go on with"):
        packing.pack(folders(plain), out)
    whole = tmp_path / "whole"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(packing, "SHARD_MOTIONS", 3)
        first = (out / "motions-00000.zip").stat().st_ino
        packing.pack(folders(plain), out, resume=True)
        packing.pack(folders(plain), whole)
    assert (out / "motions-00000.zip").stat().st_ino == first
    assert files_of(out) == files_of(whole)


@pytest.fixture
def packed(plain, three, tmp_path):
    packing.pack(folders(plain), tmp_path / "packed")
    return tmp_path / "packed"


@pytest.mark.parametrize(
    "damage",
    [
        lambda path: path.write_bytes(path.read_bytes()[:-100]),
        lambda path: path.write_bytes(b"nothing"),
        lambda path: path.unlink(),
        lambda path: flip(path, path.stat().st_size // 3),
        lambda path: swap(path, path.with_name("motions-00000.zip")),
    ],
)
def test_a_damaged_shard_is_told_and_mended(damage, plain, packed, capsys):
    whole = files_of(packed)
    damage(packed / "motions-00001.zip")
    motions = open_motions(packed)
    assert len(motions) == 7
    with pytest.raises(InputError, match=r"damaged.*`data pack --resume` mends it\.$"):
        list(motions)
    line = ["train", "tokenizer", "--motions", str(packed), "--steps", "1"]
    assert main([*line, "--out", str(packed.parent / "run")]) == 2
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1
    assert str(packed) in printed
    assert not (packed.parent / "run").exists()
    packing.pack(folders(plain), packed, resume=True)
    assert files_of(packed) == whole


def flip(path, at):
    data = bytearray(path.read_bytes())
    data[at] ^= 1
    path.write_bytes(data)


def swap(path, other):
    """Puts another shard in the place of one, whose names are its own."""
    with zipfile.ZipFile(path) as a, zipfile.ZipFile(other) as b:
        content = b.read(b.namelist()[0])
        members = {name: a.read(name) for name in a.namelist()}
    members[next(iter(members))] = content
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[:-20],
        lambda text: "".join(text.splitlines(keepends=True)[:-1]),
        lambda text: text.replace('"shard": 1', '"shard": "x"'),
        lambda text: text.replace("go2/0", "../go2/0"),
        lambda text: text.replace('"motions": 7', '"motions": NaN'),
        lambda text: "",
    ],
)
def test_a_damaged_index_is_told_and_mended(damage, plain, packed):
    index = packed / INDEX
    text = index.read_text()
    index.write_text(damage(text))
    with pytest.raises(InputError, match=r"jsonl is damaged or cut off, after \d mot"):
        open_motions(packed)
    packing.pack(folders(plain), packed, resume=True)
    assert index.read_text() == text


def test_an_index_of_the_future_is_refused(packed):
    text = (packed / INDEX).read_text()
    (packed / INDEX).write_text(text.replace('version": 1', 'version": 2'))
    with pytest.raises(InputError, match="has schema 2; this version reads 1"):
        open_motions(packed)


def test_other_motion_is_not_packed_over(plain, packed, tmp_path):
    before = files_of(packed)
    for others in ([plain / "a1"], [plain / "a1", plain / "go2"]):
        with pytest.raises(InputError, match="holds other motion than the folders"):
            packing.pack(others, packed, resume=True)
    assert files_of(packed) == before
    with pytest.raises(InputError, match="nothing to resume"):
        packing.pack(folders(plain), tmp_path / "none", resume=True)


def test_what_changed_since_is_packed_again(plain, three, tmp_path):
    source = tmp_path / "go2"
    shutil.copytree(plain / "go2", source)
    out = tmp_path / "packed"
    packing.pack([source], out)
    changed = replace(synthetic_motion(seconds=0.2), provenance={"new": "yes"})
    save_motion(changed, source / "0.npz")
    packing.pack([source], out, resume=True)
    assert open_motions(out)[0].provenance == {"new": "yes"}


def test_a_damaged_file_is_not_packed(plain, three, tmp_path):
    source = tmp_path / "go2"
    shutil.copytree(plain / "go2", source)
    flip(source / "more" / "1.npz", 1000)
    with pytest.raises(InputError, match=r"go2/more/1\.npz"):
        packing.pack([source], tmp_path / "packed")
    names = [path.name for path in (tmp_path / "packed").iterdir()]
    assert names == ["motions-00000.zip"]


def test_two_folders_of_one_name_are_refused(plain, tmp_path):
    with pytest.raises(InputError, match="Two folders are called 'go2'"):
        packing.pack([plain / "go2", plain / "go2"], tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"no Motion files \(\*\.npz\) in '.*empty'"):
        packing.pack([tmp_path / "empty"], tmp_path / "out")


def test_plain_folders_are_read_in_the_order_of_paths(tmp_path):
    for name in ("a-b/0.npz", "a/1.npz", "a/b/2.npz", "a/b.npz", ".0123.npz", "x.txt"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"")
    named = [path.relative_to(tmp_path) for path in sorted(tmp_path.rglob("[!.]*.npz"))]
    assert list(map(Path, MotionFiles(tmp_path).names)) == named
    assert MotionFiles(tmp_path, nested=False).names == []


def test_the_command_packs_and_counts(plain, tmp_path, capsys):
    out, figures = tmp_path / "out", tmp_path / "a.json"
    line = ["data", "pack", "--motions", *map(str, folders(plain)), "--out", str(out)]
    assert main([*line, "--json", str(figures)]) == 0
    assert "7 motions of a1, go2" in capsys.readouterr().out
    told = json.loads(figures.read_text())
    assert told["labels"]["dog-pace"]["motions"] == 3
    assert main(line) == 2
    assert capsys.readouterr().err.count("\n") == 1
    os.remove(out / INDEX)
    assert main([*line, "--resume"]) == 0
    assert (out / INDEX).exists()
