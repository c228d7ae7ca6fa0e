"""What people's files and machines brought to light, through the command line."""

import io
import json
import re
import struct
import warnings
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from loco_drake.cli.main import main
from loco_drake.motion.motion_file import load_motion, save_motion
from tests.made_inputs import (
    mpc_points,
    robot_yaml,
    save_dog,
    save_rows,
    urdf,
    walking_animal,
)
from tests.synthetic_bvh import write_dog_bvh
from tests.synthetic_horse import make_horse, write_raw_recording, write_world_recording
from tests.synthetic_motion import synthetic_motion
from tests.synthetic_robots import write_mpc_recording, write_solo8_recording


@pytest.fixture
def cli(tmp_path, monkeypatch, capsys, caplog):
    """Runs a command in an empty folder; returns status, figures and stderr.

    Without pytest, warnings that are logged are lines on stderr.
    """
    monkeypatch.chdir(tmp_path)

    def run(line, *more):
        words = [*line.split(), *map(str, more)]
        figures = Path("figures.json")
        figures.unlink(missing_ok=True)
        status = main([*words, "--json", str(figures)])
        captured = capsys.readouterr()
        said = [*(r.getMessage() for r in caplog.records), captured.err.strip()]
        caplog.clear()
        found = json.loads(figures.read_text()) if figures.exists() else None
        return status, found, "\n".join(filter(None, said))

    return run


def assert_refused(result, *words):
    status, figures, error = result
    assert status == 2, error
    assert figures is None
    assert error.startswith("loco-drake: ")
    assert "\n" not in error
    assert len(error) < 700
    for word in words:
        assert word in error


def retarget(cli, file, source="dog", gait="trot", *more):
    """Returns the figures of one file, its motion and what was said."""
    status, figures, error = cli(
        f"retarget --source {source} --gait {gait} --out motions", file, *more
    )
    assert status == 0, error
    (row,) = figures.values()
    return row, load_motion(Path(row["path"])), error


# Conventions of recordings


@pytest.mark.parametrize("offset", [0.1, 1.0, -0.3])
def test_floor_of_a_dog_may_be_anywhere(cli, offset):
    """dog_floor_offset: the robot does the same, wherever the file has its floor."""
    withers, hip, toes = walking_animal()
    up = np.array([0.0, 0.0, offset])
    save_dog(Path("floor.txt"), withers, hip, toes)
    save_dog(Path("raised.txt"), withers + up, hip + up, toes + up)
    row, motion, _ = retarget(cli, "floor.txt")
    other, moved, _ = retarget(cli, "raised.txt")
    assert row["scale"] == pytest.approx(0.689, abs=0.02)
    assert other["scale"] == pytest.approx(row["scale"], rel=1e-3)
    assert moved.base_position == pytest.approx(motion.base_position, abs=2e-3)


# Of each form of a recording: source, what writes it, the first column of a height, how
# many columns lie between two, and how many of its units make a metre.
HORSE = make_horse("trot", 60.0, 4.0)
FORMS = {
    "dog.bvh": ("dog", lambda file: write_dog_bvh(file, "trot", 2.0), 1, 10**6, 100),
    "horse.csv": ("horse", lambda file: write_raw_recording(file, HORSE), 4, 3, 1000),
    "horse.txt": ("horse", lambda file: write_world_recording(file, HORSE), 2, 3, 1),
    "mpc.txt": ("mpc", lambda file: write_mpc_recording(file, "trot"), 2, 3, 1),
    "solo8.txt": ("solo8", write_solo8_recording, 2, 3, 1),
}


@pytest.mark.parametrize("offset", [0.2, -0.3, 25.0])
@pytest.mark.parametrize("form", FORMS)
def test_floor_of_any_recording_may_be_anywhere(cli, form, offset):
    """dog_floor_offset: in every form, in the unit of its file."""
    source, write, first, step, unit = FORMS[form]
    write(Path(form))
    separator = " " if form.endswith("bvh") else ","
    lines = Path(form).read_text().splitlines()
    for number, line in enumerate(lines):
        words = line.split(separator)
        if len(words) > 6 and re.fullmatch(r"[-\d.e]+", words[0]):
            heights = [float(word) + unit * offset for word in words[first::step]]
            words[first::step] = map(str, heights)
            lines[number] = separator.join(words)
    raised = f"raised{100 * offset:g}-{form}"
    Path(raised).write_text("\n".join(lines))
    row, motion, error = retarget(cli, form, source)
    assert error == ""
    other, moved, error = retarget(cli, raised, source)
    (told,) = re.findall(f"{raised}: ground: moved from z = (.*) m to 0", error)
    assert float(told) == pytest.approx(offset, abs=0.015)  # accuracy of markers
    assert other["scale"] == pytest.approx(row["scale"], rel=0.01)
    expected = pytest.approx(motion.base_position, rel=0.01, abs=0.01)
    assert moved.base_position == expected


def lying_dog(frames, when, offset=0.0):
    """A dog that walks for 3 s, and lies before, amid or after that; points (T, 3)."""
    parts = walking_animal(seconds=3.0)
    k = {"first": 0, "between": 90, "last": 179}[when]
    sink = np.linspace(0.0, 1.0, 40)[:, None] * (0.0, 0.0, -0.34)
    down = np.repeat(sink[-1:], frames, axis=0)
    way = {
        "first": (down, sink[::-1]),
        "between": (sink, down, sink[::-1]),
        "last": (sink, down),
    }[when]
    path = np.concatenate(way)

    def points(walk, path):
        lies = walk[k] + path.reshape(-1, *(1,) * (walk.ndim - 2), 3)
        whole = [walk[:k], lies, walk[k:]] if when != "last" else [walk, lies]
        return np.concatenate(whole) + np.array([0.0, 0.0, offset])

    withers, hip, toes = parts
    return points(withers, path), points(hip, path), points(toes, 0 * path)


@pytest.mark.parametrize("offset", [0.0, 1.0])
@pytest.mark.parametrize("when", ["first", "between", "last"])
@pytest.mark.parametrize("seconds", [1, 10, 30])
def test_dog_that_lies_is_scaled_as_it_stands(cli, when, seconds, offset):
    """dog_lies_most_of_the_time: whenever, however long, wherever the floor is."""
    save_dog(Path("walks.txt"), *walking_animal(seconds=3.0))
    file = f"lies-{when}-{seconds}-{offset:g}.txt"
    save_dog(Path(file), *lying_dog(60 * seconds, when, offset))
    row, motion, _ = retarget(cli, "walks.txt")
    other, lies, error = retarget(cli, file)
    assert "frames on its feet" in error
    assert other["scale"] == pytest.approx(row["scale"], rel=0.01)
    assert lies.base_position[:, 2].max() < motion.base_position[:, 2].max() + 0.02


# Half length, half width of the trunk, and the order of the nine points, feet first.
ROBOTS = {
    "mpc": (0.1505, 0.044, range(9), 100.0),
    "solo8": (0.19, 0.104, (4, 5, 6, 7, 8, 0, 1, 2, 3), 50.0),
}


@pytest.mark.parametrize("source", ROBOTS)
@pytest.mark.parametrize("how", ["right first", "mirrored", "rear first"])
def test_legs_of_a_robot_may_come_in_another_order(cli, source, how):
    """right_legs_first: mended or refused, be it the order or the sign of y."""
    half, side, places, fps = ROBOTS[source]
    parts = walking_animal(0.2, half, 0.1, 0.8, 0.35, 0.2 / 0.35, fps=fps)
    points = mpc_points(*parts, side)
    orders = {
        "right first": [1, 0, 3, 2, 4, 6, 5, 8, 7],
        "rear first": [2, 3, 0, 1, 4, 7, 8, 5, 6],
    }
    odd = points[:, orders[how]] if how in orders else points * (1.0, -1.0, 1.0)
    save_rows(Path("usual.txt"), points[:, places])
    # Each mended file is told of once.
    file = f"{source}-{how.replace(' ', '-')}.txt"
    save_rows(Path(file), odd[:, places])
    _, motion, error = retarget(cli, "usual.txt", source)
    assert error == ""
    status, figures, error = cli(f"retarget --source {source} --gait trot", file)
    if status == 2:
        assert_refused((status, figures, error))
        return
    assert error != ""
    (row,) = figures.values()
    found = load_motion(Path(row["path"]))
    if how == "mirrored":
        motion = motion.mirrored()
    assert found.joint_positions == pytest.approx(motion.joint_positions, abs=0.02)
    assert found.base_velocity == pytest.approx(motion.base_velocity, abs=0.02)


def test_bvh_in_milliseconds_is_refused(cli):
    """bvh_frame_time_in_ms: .06 frames/s are no rate; nor is what --fps may say."""
    write_dog_bvh(Path("s.bvh"), "trot", 1.0)
    text = Path("s.bvh").read_text()
    Path("ms.bvh").write_text(text.replace("0.0166667", "16.6667"))
    line = "retarget --source dog --gait trot"
    assert_refused(cli(line, "ms.bvh"), "frames/s")
    save_dog(Path("dog.txt"), *walking_animal())
    for fps in ("1e9", "0.01", "0", "nan", "-60"):
        assert_refused(cli(line, "dog.txt", "--fps", fps))
    for value in ("1e-9", "0", "-0.0166667", "nan", "1.66667e-05"):
        Path("odd.bvh").write_text(text.replace("0.0166667", value))
        assert_refused(cli(line, "odd.bvh"))


def _joints(lines, k):
    """Returns a BVH tree: name line, opening lines, subtrees; and where it ends."""
    head, children = [lines[k], lines[k + 1]], []
    k += 2
    while not lines[k].strip().startswith("}"):
        if lines[k].split()[0] in ("JOINT", "End"):
            child, k = _joints(lines, k)
            children.append(child)
        else:
            head.append(lines[k])
            k += 1
    return (head, children, lines[k]), k + 1


def _written(tree):
    head, children, end = tree
    return [*head, *(line for child in children for line in _written(child)), end]


def _sorted(tree, key):
    head, children, end = tree
    return head, sorted((_sorted(child, key) for child in children), key=key), end


@pytest.mark.parametrize("turned", [False, True])
def test_bvh_joints_are_found_by_name_whatever_their_order(cli, turned):
    """bvh_sibling_order: siblings sorted by name, or by name backwards."""
    write_dog_bvh(Path("usual.bvh"), "trot", 1.5)
    lines = Path("usual.bvh").read_text().splitlines()
    start = lines.index("MOTION")
    tree, _ = _joints(lines, 1)

    def name(node):
        word = node[0][0].split()[-1]
        return [-ord(c) for c in word] if turned else word

    other = _written(_sorted(tree, name))
    # Channels: six of each joint, in the order of the file.
    before, after = (
        [row.split()[-1] for row in rows if "JOINT" in row or "ROOT" in row]
        for rows in (lines[1:start], other)
    )
    assert before != after
    places = [6 * before.index(joint) + c for joint in after for c in range(6)]
    rows = [row.split() for row in lines[start + 3 :]]
    moved = [" ".join(row[k] for k in places) for row in rows]
    whole = [lines[0], *other, *lines[start : start + 3], *moved]
    Path("other.bvh").write_text("\n".join(whole) + "\n")
    usual = cli("data inspect --source dog", "usual.bvh")
    assert usual[0] == 0
    assert cli("data inspect --source dog", "other.bvh") == usual


def test_byte_order_mark_is_read_over(cli):
    """byte_order_mark: recordings and segments.csv as spreadsheets write them."""
    mark = b"\xef\xbb\xbf"
    write_world_recording(Path("horse.csv"), make_horse("trot", 60.0, 3.0))
    save_dog(Path("dog.txt"), *walking_animal())
    write_dog_bvh(Path("dog.bvh"), "trot", 1.0)
    for file, source in (
        ("horse.csv", "horse"),
        ("dog.txt", "dog"),
        ("dog.bvh", "dog"),
    ):
        clean = cli(f"data inspect --source {source}", file)
        assert clean[0] == 0
        data = Path(file).read_bytes().replace(b"\r", b"").replace(b"\n", b"\r\n")
        Path(file).write_bytes(mark + data)
        assert cli(f"data inspect --source {source}", file) == clean
    folder = Path("data/dog_mann")
    save_dog(folder / "a.txt", *walking_animal())
    table = b"dataset,file,gait,start_frame,end_frame,fps\r\n"
    table += b"dog_mann,a.txt,trot,0,240,60\r\n"
    Path("data/segments.csv").write_bytes(mark + table)
    status, figures, error = cli("data list --data-dir data")
    assert (status, figures["dog"]["clips"], error) == (0, 1, "")


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_recording_of_a_frame_or_few_is_refused(cli, frames):
    """one_frame: by both commands, in every form."""
    save_dog(Path("row.txt"), *(part[:frames] for part in walking_animal()))
    write_dog_bvh(Path("pose.bvh"), "trot", frames / 60)
    points = mpc_points(*walking_animal(0.2, 0.15, 0.1))[:frames]
    save_rows(Path("mpc.txt"), points)
    save_rows(Path("solo8.txt"), points[:, [4, 5, 6, 7, 8, 0, 1, 2, 3]])
    write_world_recording(Path("horse.csv"), make_horse("trot", 60.0, frames / 60))
    for file, source in (
        ("row.txt", "dog"),
        ("pose.bvh", "dog"),
        ("mpc.txt", "mpc"),
        ("solo8.txt", "solo8"),
        ("horse.csv", "horse"),
    ):
        inspected = cli(f"data inspect --source {source}", file)
        assert_refused(inspected)
        assert_refused(cli(f"retarget --source {source} --gait trot", file))
        assert "array too small" not in inspected[2]
    assert not list(Path().glob("*.png"))


# A data folder, a new animal, other robots


@pytest.mark.parametrize(
    ("gait", "word"), [("walk", "dog-walk"), ("Trot", "dog-Trot"), ("canter", "canter")]
)
def test_nothing_to_retarget_is_said(cli, gait, word):
    """nothing_retargeted: the reason, and what there is."""
    save_dog(Path("data/dog_mann/a.txt"), *walking_animal())
    head = "dataset,file,gait,start_frame,end_frame,fps\n"
    Path("data/segments.csv").write_text(f"{head}dog_mann,a.txt,{gait},0,240,60\n")
    assert_refused(cli("retarget --data-dir data"), word)
    assert not Path("motions").exists()
    Path("data/segments.csv").write_text(head)
    assert_refused(cli("retarget --data-dir data"))


def test_space_behind_a_comma_is_no_part_of_a_gait(cli):
    """nothing_retargeted: read, or refused; not passed over."""
    save_dog(Path("data/dog_mann/a.txt"), *walking_animal())
    head = "dataset,file,gait,start_frame,end_frame,fps\n"
    Path("data/segments.csv").write_text(f"{head}dog_mann, a.txt, trot, 0, 240, 60\n")
    status, figures, error = cli("retarget --data-dir data")
    if status == 2:
        assert_refused((status, figures, error), "trot")
    else:
        assert status == 0
        assert list(figures) == ["dog-trot-a-0-240"]


def test_another_animal_as_documented(cli, monkeypatch):
    """another_animal: a reader and a YAML file; shipped weights stay usable."""
    from loco_drake.datasets import registry
    from loco_drake.datasets.recording import Recording
    from loco_drake.datasets.registry import Dataset, register_dataset

    def read(path, start, end, fps):
        points = np.loadtxt(path, delimiter=",").reshape(-1, 6, 3)
        return Recording(points, fps=fps or 60.0)

    monkeypatch.setattr(registry, "DATASETS", dict(registry.DATASETS))
    register_dataset(
        Dataset(
            source="elephant",
            folder="elephants",
            licence="none",
            attribution="nobody",
            read=read,
        )
    )
    withers, hip, toes = walking_animal(2.2, 0.9, 0.35, 1.2, 1.6, 0.6, seconds=8.0)
    points = np.concatenate((withers[:, None], hip[:, None], toes), axis=1)
    save_rows(Path("elephant.txt"), points)
    row, motion, _ = retarget(cli, "elephant.txt", "elephant", "walk")
    assert str(motion.label) == "elephant-walk"
    status, figures, error = cli(
        f"simulate --no-meshcat --duration 0.5 --reference {row['path']}"
    )
    assert (status, error) == (0, "")
    assert figures["gait"] == "elephant-walk"
    assert not figures["fell"]


@pytest.fixture
def robots(tmp_path, monkeypatch):
    """Robots that are one and the same, but for how their files are written."""
    monkeypatch.chdir(tmp_path)
    save_dog(Path("dog.txt"), *walking_animal(seconds=2.0))
    floating = (
        '<link name="world"/><joint name="free" type="floating">'
        '<parent link="world"/><child link="base"/></joint>'
    )
    forms = {
        "plain": ("", "base"),
        "floating": (floating, "base"),
        "fixed": (floating.replace("floating", "fixed"), "base"),
        "planar": (floating.replace('"floating"', '"planar"'), "base"),
        "sliding": (floating.replace('"floating"', '"prismatic"'), "base"),
        "above": (floating.replace('"world"', '"map"'), "base"),
    }
    for name, (first, base) in forms.items():
        Path(f"{name}.urdf").write_text(urdf(first, base))
        Path(f"{name}.yaml").write_text(robot_yaml(f"{name}.urdf"))
    return [name for name in forms if name != "plain"]


def test_what_is_above_the_trunk_changes_nothing(cli, robots):
    """robot_world_and_floating_base: world and joints to it, as vendors write them."""
    _, plain, _ = retarget(cli, "dog.txt", "dog", "trot", "--robot", "plain.yaml")
    for name in robots:
        robot = f"{name}.yaml"
        _, motion, _ = retarget(cli, "dog.txt", "dog", "trot", "--robot", robot)
        assert np.array_equal(motion.joint_positions, plain.joint_positions)
        assert np.array_equal(motion.base_position, plain.base_position)


@pytest.mark.parametrize(
    "legs",
    [
        ("FR", "FL", "RR", "RL"),
        ("RL", "RR", "FL", "FR"),
        ("RR", "RL", "FR", "FL"),
        ("FL", "RL", "FR", "RR"),
        ("FL", "FL", "RL", "RR"),
    ],
)
def test_legs_that_are_elsewhere_than_named_are_refused(cli, robots, legs):
    """left_is_right and front_is_rear, and others."""
    Path("odd.yaml").write_text(robot_yaml("plain.urdf", legs))
    line = "retarget --source dog --gait trot --robot odd.yaml dog.txt"
    assert_refused(cli(line), "odd.yaml")


@pytest.mark.parametrize("turn", ["3.14159 0 0", "0 1.5708 0", "0 0 1.5708"])
def test_trunk_frame_that_is_turned_is_refused(cli, robots, turn):
    """Up, forward and left are where the legs are, not where the frame says."""
    Path("turned.urdf").write_text(urdf(turn=turn))
    Path("turned.yaml").write_text(robot_yaml("turned.urdf"))
    line = "retarget --source dog --gait trot --robot turned.yaml dog.txt"
    assert_refused(cli(line), "turned.yaml")


# Motion files


@pytest.fixture
def motion(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save_motion(synthetic_motion("dog-trot", 1.0), Path("usual.npz"))
    return load_motion(Path("usual.npz"))


def simulate(cli, file):
    return cli(f"simulate --no-meshcat --duration 0.1 --reference {file}")


@pytest.mark.parametrize(
    "legs", [(1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0), (0, 2, 1, 3)]
)
def test_joints_are_taken_by_their_names(cli, motion, legs):
    """motion_joints_in_another_order: put in order, which is said."""
    order = [3 * leg + k for leg in legs for k in range(3)]
    save_motion(_reordered(motion, order), Path("other.npz"))
    status, figures, error = simulate(cli, "usual.npz")
    assert (status, error) == (0, "")
    other = simulate(cli, "other.npz")
    assert other[0] == 0
    assert "order" in other[2]
    same = {key for key in figures if key != "real_time_factor"}
    assert {key: other[1][key] for key in same} == {key: figures[key] for key in same}


def _reordered(motion, order):
    return replace(
        motion,
        joint_names=tuple(np.array(motion.joint_names)[order]),
        joint_positions=motion.joint_positions[:, order],
        joint_velocities=motion.joint_velocities[:, order],
    )


def test_every_command_takes_joints_by_their_names(cli, motion):
    """motion_joints_in_another_order: what learns from two files learns the same."""
    order = [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]
    for label in ("dog-trot", "dog-pace"):
        made = synthetic_motion(label, 2.0)
        save_motion(made, Path(f"usual/{label}.npz"))
        save_motion(_reordered(made, order), Path(f"other/{label}.npz"))
    found = []
    for folder in ("usual", "other"):
        status, _, error = cli(
            f"train tokenizer --steps 1 --motions {folder} --out run-{folder}"
        )
        assert status == 0, error
        found.append(Path(f"run-{folder}/tokenizer.safetensors").read_bytes())
    assert found[0] == found[1]


def _thinned(motion):
    """What a file at half the rate has, but for the rate."""
    return {
        name: getattr(motion, name)[::2]
        for name in (
            "base_position",
            "base_quaternion",
            "joint_positions",
            "base_velocity",
            "base_angular_velocity",
            "joint_velocities",
            "contacts",
        )
    }


@pytest.mark.parametrize(
    "change",
    [
        lambda m: {
            "joint_positions": np.degrees(m.joint_positions),
            "joint_velocities": np.degrees(m.joint_velocities),
        },
        lambda m: {"joint_positions": np.degrees(m.joint_positions)},
        lambda m: {"joint_velocities": np.degrees(m.joint_velocities)},
        lambda m: {"base_quaternion": m.base_quaternion[:, [1, 2, 3, 0]]},
        lambda m: {"base_position": 1000 * m.base_position},
        lambda m: {"base_position": m.base_position[:, [0, 2, 1]]},
        lambda m: {"base_position": m.base_position + np.array([0.0, 0.0, 0.5])},
        lambda m: {"base_velocity": m.base_velocity[:, [1, 0, 2]]},
        lambda m: {"base_velocity": 0 * m.base_velocity},
        lambda m: {"base_velocity": m.base_velocity[::-1]},
        lambda m: {"base_velocity": np.roll(m.base_velocity, 7, axis=0)},
        lambda m: {"base_angular_velocity": m.base_angular_velocity + 1.0},
        lambda m: {"fps": 100.0},
        lambda m: _thinned(m),
        lambda m: {"joint_names": m.joint_names[::-1]},
        lambda m: {"joint_names": tuple(f"{n}_x" for n in m.joint_names)},
        lambda m: {"joint_names": (m.joint_names[0],) * 12},
        lambda m: {"joint_positions": -m.joint_positions},
    ],
    ids=[
        "degrees",
        "degrees, positions only",
        "degrees, velocities only",
        "x y z w",
        "mm",
        "y up",
        "in the air",
        "axes of velocities",
        "no velocities",
        "velocities in reverse",
        "late velocities",
        "angular velocities",
        "rate",
        "every second frame",
        "names turned round",
        "other names",
        "one name",
        "other signs",
    ],
)
def test_motion_that_contradicts_itself_is_refused(cli, motion, change):
    """motion_joints_in_degrees: units, axes, rates and names are measured."""
    save_motion(replace(motion, **change(motion)), Path("odd.npz"))
    assert_refused(simulate(cli, "odd.npz"), "odd.npz")


@pytest.mark.parametrize("frames", [1, 2])
def test_motion_of_one_frame_is_refused(cli, motion, frames):
    """motion_one_frame: and of two, which have no velocity of their own."""
    save_motion(motion.slice(0, frames), Path("one.npz"))
    assert_refused(simulate(cli, "one.npz"))


def _edited(header=None, members=None):
    """Returns the usual file with its header, as JSON, or its members edited."""

    def make(data):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            found = {name: archive.read(name) for name in archive.namelist()}
        if header is not None:
            text = str(np.load(io.BytesIO(found["header.npy"])))
            found["header.npy"] = _npy(np.array(header(text)))
        if members is not None:
            found |= members(found)
        return _zip(found)

    return make


def _npy(array):
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def _zip(members, method=zipfile.ZIP_DEFLATED):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name), data, method)
    return file.getvalue()


def _in_records(offset, value):
    """Returns an edit of the two bytes at ``offset`` of each local record."""

    def make(data):
        new = bytearray(data)
        for mark, place in ((b"PK\x03\x04", offset), (b"PK\x01\x02", offset + 2)):
            at = new.find(mark)
            while at >= 0:
                struct.pack_into("<H", new, at + place, value)
                at = new.find(mark, at + 4)
        return bytes(new)

    return make


def _one(name, change):
    """Returns an edit of one array."""

    def members(found):
        array = np.load(io.BytesIO(found[f"{name}.npy"]))
        return {f"{name}.npy": _npy(change(array))}

    return _edited(members=members)


def _with_npy_header(text):
    head = text.encode() + b"\n"
    whole = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head
    return _edited(members=lambda found: {"base_position.npy": whole})


def _lzma(data):
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        found = {name: archive.read(name) for name in archive.namelist()}
    packed = bytearray(_zip(found, zipfile.ZIP_LZMA))
    packed[400:420] = bytes(20)
    return bytes(packed)


def _flipped(byte):
    return lambda data: data[:byte] + bytes([data[byte] ^ 4]) + data[byte + 1 :]


def _fps(value):
    def change(text):
        header = json.loads(text)
        return json.dumps({**header, "fps": value, "content_sha256": None})

    return _edited(header=change)


DAMAGED = {
    "base position huge": _one("base_position", lambda a: a + 1e300),
    "longdouble": _one("base_velocity", lambda a: a.astype(np.longdouble)),
    "fps huge": _fps(1e300),
    "fps text": _fps("fifty"),
    "one frame": _one("joint_positions", lambda a: a[:1]),
    "deep header": _edited(header=lambda text: "[" * 100_000),
    "huge shape": _with_npy_header(
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1099511627776, 3)}"
    ),
    "no literal": _with_npy_header("{'descr': f(), 'shape': (1, 3)}"),
    "surrogate": _edited(header=lambda text: text.replace('"go2"', '"\\ud800"')),
    "infinite schema": _edited(
        header=lambda text: text.replace(
            '"schema_version": 1', '"schema_version": 1e999'
        )
    ),
    "encrypted": _in_records(6, 1),
    "damaged lzma": _lzma,
    "method 1": _in_records(8, 1),
    "method 9": _in_records(8, 9),
    "flipped at 100": _flipped(100),
    "flipped at 1000": _flipped(1000),
    "flipped at the end": _flipped(-30),
    "cut": lambda data: data[:-100],
    "objects": _with_npy_header(
        "{'descr': '|O', 'fortran_order': False, 'shape': (51, 3)}"
    ),
    "line breaks": _edited(header=lambda text: text.replace('"go2"', '"go\\n2"')),
    "many letters": _edited(header=lambda text: text.replace("go2", "x" * 10_000)),
}


@pytest.mark.parametrize("how", DAMAGED)
def test_damaged_motion_is_refused_in_one_sentence(cli, motion, how):
    """damaged_motions: each sample, and others of its kind."""
    Path("damaged.npz").write_bytes(DAMAGED[how](Path("usual.npz").read_bytes()))
    assert_refused(simulate(cli, "damaged.npz"), "damaged.npz")


# Long runs


def test_quaternion_of_the_base_stays_of_norm_one(cli):
    """quaternion-norm: after 6 s of a gallop, whose norm grew fastest."""
    from loco_drake.evaluation.tracking import Recorder
    from loco_drake.systems.scenario import GeneratedReference, Scenario

    reference = GeneratedReference(gait="dog-gallop", duration=6.0)
    recorder = Recorder(Scenario(reference=reference))
    recorder.start()
    rollout, _ = recorder.run(6.0)
    norms = np.linalg.norm(rollout.state[:, :4], axis=1)
    assert norms == pytest.approx(1.0, abs=1e-6)


def test_an_evaluation_builds_one_diagram(cli, monkeypatch):
    """diagrams_never_freed: however many labels and episodes; the docs say why."""
    from loco_drake.evaluation import tracking

    built = []
    make = tracking.AddLocomotion
    monkeypatch.setattr(
        tracking,
        "AddLocomotion",
        lambda *a, **k: built.append(1) or make(*a, **k),
    )
    status, figures, _ = cli(
        "evaluate tracking --labels dog-trot dog-pace --seeds 2 --duration 0.1"
    )
    assert status == 0
    assert len(figures["labels"]) == 2
    assert len(built) == 1
    docs = (Path(__file__).parents[1] / "docs" / "architecture.md").read_text()
    assert "22515" in docs  # RobotLocomotion/drake#22515


def test_warnings_of_pycollada_fail_no_test(cli, monkeypatch):
    """tests_on_numpy25: numpy 2.5 warns of what pycollada does, and it is let pass.

    The suite turns warnings into errors: without leave the meshes would be missing.
    """
    trimesh = pytest.importorskip("trimesh")
    load, warned = trimesh.load_scene, []

    def load_scene(source):
        warned.append(source)
        warnings.warn(
            "Setting the shape on a NumPy array has been deprecated in NumPy 2.5.",
            DeprecationWarning,
            stacklevel=2,
        )
        return load(source)

    monkeypatch.setattr(trimesh, "load_scene", load_scene)
    monkeypatch.setenv("LOCO_DRAKE_CACHE", str(Path("cache").resolve()))
    save_motion(synthetic_motion("dog-trot", 1.0), Path("usual.npz"))
    status, _, error = cli(
        "simulate --no-meshcat --duration 0.02 --reference usual.npz --html page.html"
    )
    assert (status, error) == (0, "")
    assert warned
    assert Path("page.html").stat().st_size > 1e6
