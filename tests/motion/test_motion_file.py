"""Motion files that are damaged in every way that was thought of: none gets through."""

import io
import json
import struct
import zipfile

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.motion import UNITS
from loco_drake.motion.motion_file import load_motion, save_motion
from tests.synthetic_motion import synthetic_motion


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A short Motion file."""
    path = tmp_path_factory.mktemp("whole") / "a.npz"
    save_motion(synthetic_motion(seconds=0.2), path)
    return path


def members_of(path):
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def pack(path, members, method=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(name, data)


def npy(array):
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.asanyarray(array), allow_pickle=True)
    return stream.getvalue()


def npy_header(text):
    data = text.encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(data)) + data


def header_of(members):
    text = str(np.load(io.BytesIO(members["header.npy"])).item())
    return {k: v for k, v in json.loads(text).items() if k != "content_sha256"}


def with_header(members, text):
    return {**members, "header.npy": npy(np.array(text))}


def test_every_flipped_bit_is_refused_or_changes_nothing(whole, tmp_path):
    data, original = whole.read_bytes(), load_motion(whole)
    random, refused = np.random.default_rng(0), 0
    for bit in random.choice(8 * len(data), size=400, replace=False):
        damaged = bytearray(data)
        damaged[bit // 8] ^= 1 << bit % 8
        path = tmp_path / "a.npz"
        path.write_bytes(damaged)
        try:
            loaded = load_motion(path)
        except InputError:
            refused += 1
            continue
        for name in UNITS:
            np.testing.assert_array_equal(
                getattr(loaded, name), getattr(original, name)
            )
        for name in ("label", "robot", "fps", "joint_names", "provenance"):
            assert getattr(loaded, name) == getattr(original, name)
    # The others hit dates and attributes of the archive.
    assert refused > 350


def test_a_number_changed_by_hand_is_refused_by_the_hash(whole, tmp_path):
    """The archive is sound, and so is the motion; it is just not what was written."""
    members = members_of(whole)
    q = np.load(io.BytesIO(members["joint_positions.npy"]))
    q[3, 2] += 1e-9
    pack(tmp_path / "a.npz", {**members, "joint_positions.npy": npy(q)})
    with pytest.raises(
        InputError, match=r"a.npz: It is damaged: .*does not match its hash"
    ):
        load_motion(tmp_path / "a.npz")


def test_files_of_earlier_versions_have_no_hash_and_are_read(whole, tmp_path):
    members = members_of(whole)
    pack(tmp_path / "a.npz", without_hash(members))
    again = load_motion(tmp_path / "a.npz")
    np.testing.assert_array_equal(
        again.joint_positions, load_motion(whole).joint_positions
    )


def without_hash(members):
    return with_header(members, json.dumps(header_of(members)))


@pytest.mark.parametrize(
    ("name", "frame"), [("base_velocity", 4), ("joint_velocities", 0)]
)
def test_a_velocity_that_is_no_derivative_is_reported(
    whole, tmp_path, capsys, name, frame
):
    """A hundredth of the highest is rounding; 5 % more are said, with the number."""
    members = without_hash(members_of(whole))
    original = np.load(io.BytesIO(members[f"{name}.npy"]))
    highest = np.abs(original).max()
    for off, said in ((0.0, ""), (0.005, ""), (0.06, f"{name} by 6% of the highest.")):
        values = original.copy()
        values[frame, 0] += off * highest
        pack(tmp_path / "a.npz", {**members, f"{name}.npy": npy(values)})
        again = load_motion(tmp_path / "a.npz")
        np.testing.assert_array_equal(getattr(again, name), values)
        heard = capsys.readouterr().err
        assert heard.endswith(f"positions: {said}\n") if said else heard == ""


@pytest.mark.parametrize("name", [name for name in UNITS if name != "contacts"])
def test_numbers_that_overflow_are_refused_without_a_warning(whole, tmp_path, name):
    members = without_hash(members_of(whole))
    values = np.load(io.BytesIO(members[f"{name}.npy"]))
    values[3] = 1e300
    pack(tmp_path / "a.npz", {**members, f"{name}.npy": npy(values)})
    with pytest.raises(InputError, match=r"a\.npz: "):
        load_motion(tmp_path / "a.npz")


@pytest.mark.parametrize("dtype", [">f8", "<f4", ">f4"])
def test_other_byte_orders_and_32_bits_are_read(whole, tmp_path, dtype):
    members = members_of(whole)
    members = without_hash(members)
    for name in set(UNITS) - {"contacts"}:
        values = np.load(io.BytesIO(members[f"{name}.npy"]))
        members[f"{name}.npy"] = npy(np.asfortranarray(values).astype(dtype))
    pack(tmp_path / "a.npz", members)
    again, original = load_motion(tmp_path / "a.npz"), load_motion(whole)
    assert again.joint_positions.dtype == np.float64
    for name in UNITS:
        np.testing.assert_allclose(
            getattr(again, name), getattr(original, name), rtol=1e-6, atol=1e-6
        )


HEADERS = {
    "deep": lambda h: "[" * 100_000,
    "deep provenance": lambda h: '{"provenance": ' + '{"a":' * 50_000,
    "a list": lambda h: "[1]",
    "schema inf": lambda h: h.replace('"schema_version": 1', '"schema_version": 1e999'),
    "schema text": lambda h: h.replace('"schema_version": 1', '"schema_version": "1"'),
    "schema 1.5": lambda h: h.replace('"schema_version": 1', '"schema_version": 1.5'),
    "schema true": lambda h: h.replace('"schema_version": 1', '"schema_version": true'),
    "schema none": lambda h: h.replace("schema_version", "schema"),
    "fps huge": lambda h: h.replace('"fps": 50.0', '"fps": 1e300'),
    "fps tiny": lambda h: h.replace('"fps": 50.0', '"fps": 1e-300'),
    "fps in ms": lambda h: h.replace('"fps": 50.0', '"fps": 0.02'),
    "fps NaN": lambda h: h.replace('"fps": 50.0', '"fps": NaN'),
    "fps many digits": lambda h: h.replace('"fps": 50.0', '"fps": ' + "5" * 5000),
    "fps as long": lambda h: h.replace('"fps": 50.0', '"fps": ' + "5" * 4000),
    "fps true": lambda h: h.replace('"fps": 50.0', '"fps": true'),
    "fps list": lambda h: h.replace('"fps": 50.0', '"fps": [50]'),
    "half a character": lambda h: h.replace('"robot": "go2"', '"robot": "\\ud800"'),
    "robot with lines": lambda h: h.replace('"robot": "go2"', '"robot": "a\\nb"'),
    "robot with path": lambda h: h.replace('"robot": "go2"', '"robot": "../../x"'),
    "robot endless": lambda h: h.replace('"robot": "go2"', f'"robot": "{"x" * 5000}"'),
    "robot null": lambda h: h.replace('"robot": "go2"', '"robot": null'),
    "source escape": lambda h: h.replace('"source": "dog"', '"source": "\\u001b[2J"'),
    "gait empty": lambda h: h.replace('"gait": "trot"', '"gait": ""'),
    "joints twice": lambda h: h.replace("FR_hip", "FL_hip"),
    "joints foreign": lambda h: h.replace("FR_hip", "nose"),
    "joints numbers": lambda h: h.replace('"FR_hip_joint"', "4"),
    "joints a dict": lambda h: h.replace(
        '"joint_names": [', '"joint_names": {}, "x": ['
    ),
    "provenance a list": lambda h: h.replace(
        '"provenance": {', '"provenance": [], "x": {'
    ),
    "degrees": lambda h: h.replace(
        '"joint_positions": "rad"', '"joint_positions": "deg"'
    ),
    "gaits falling": lambda h: (
        h[:-1] + ', "gait_changes": [[0, "dog", "trot"], [0, "dog", "pace"]]}'
    ),
    "gaits late": lambda h: h[:-1] + ', "gait_changes": [[3, "dog", "trot"]]}',
    "gaits a number": lambda h: h[:-1] + ', "gait_changes": 7}',
    "gaits huge": lambda h: h[:-1] + ', "gait_changes": [[1e300, "dog", "trot"]]}',
}


@pytest.mark.parametrize("how", HEADERS)
def test_damaged_headers_are_refused_in_a_printable_sentence(whole, tmp_path, how):
    members = members_of(whole)
    header = json.dumps(header_of(members))
    damaged = HEADERS[how](header)
    assert damaged != header
    path = tmp_path / "a.npz"
    pack(path, with_header(members, damaged))
    with pytest.raises(InputError) as error:
        load_motion(path)
    assert str(error.value).isprintable()
    assert len(str(error.value)) < len(str(path)) + 250


def longdouble(members):
    values = np.load(io.BytesIO(members["base_velocity.npy"]))
    return npy(values.astype(np.longdouble))


ARRAYS = {
    "empty": lambda m: b"",
    "no npy": lambda m: b"hello" * 100,
    "cut": lambda m: m["base_velocity.npy"][:-8],
    "more": lambda m: m["base_velocity.npy"] + b"\0",
    "huge shape": lambda m: npy_header(
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000, 3)}"
    ),
    "negative shape": lambda m: npy_header(
        "{'descr': '<f8', 'fortran_order': False, 'shape': (-1, 0)}"
    ),
    "no literal": lambda m: npy_header("__import__('os').abort()"),
    "deep literal": lambda m: npy_header("(" * 9000),
    "objects": lambda m: npy(np.array([{}, 1], dtype=object)),
    "records": lambda m: npy(np.zeros((11, 3), dtype=[("a", "<f8")])),
    "complex": lambda m: npy(np.zeros((11, 3), dtype=complex)),
    "long double": longdouble,
    "16 bits": lambda m: npy(np.zeros((11, 3), dtype=np.float16)),
    "integers": lambda m: npy(np.zeros((11, 3), dtype=int)),
    "text": lambda m: npy(np.full((11, 3), "1")),
    "other frames": lambda m: npy(np.zeros((10, 3))),
    "flat": lambda m: npy(np.zeros(33)),
    "NaN": lambda m: npy(np.full((11, 3), np.nan)),
    "huge": lambda m: npy(np.full((11, 3), 1e308)),
}


@pytest.mark.parametrize("how", ARRAYS)
def test_damaged_arrays_are_refused(whole, tmp_path, how):
    members = members_of(whole)
    members = with_header(members, json.dumps(header_of(members)))
    path = tmp_path / "a.npz"
    pack(path, {**members, "base_velocity.npy": ARRAYS[how](members)})
    with pytest.raises(InputError, match=r"a\.npz"):
        load_motion(path)


def test_contacts_are_true_or_false(whole, tmp_path):
    members = members_of(whole)
    members = with_header(members, json.dumps(header_of(members)))
    contacts = bytearray(members["contacts.npy"])
    contacts[-1] = 7
    pack(tmp_path / "a.npz", {**members, "contacts.npy": bytes(contacts)})
    with pytest.raises(InputError, match="not a Motion file"):
        load_motion(tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("offset", "value"),
    [(6, 1), (8, 1), (8, 9), (8, 12), (8, 14), (8, 93), (8, 99)],
    ids=str,
)
def test_archives_packed_in_other_ways_are_refused(whole, tmp_path, offset, value):
    """Flag 1 says encrypted; the methods are shrink, deflate64, bzip2, lzma, ..."""
    data = bytearray(whole.read_bytes())
    for sign, shift in ((b"PK\x03\x04", 0), (b"PK\x01\x02", 2)):
        start = data.find(sign)
        while start >= 0:
            struct.pack_into("<H", data, start + offset + shift, value)
            start = data.find(sign, start + 1)
    (tmp_path / "a.npz").write_bytes(data)
    with pytest.raises(InputError, match="is not a Motion file"):
        load_motion(tmp_path / "a.npz")


def test_a_bomb_is_not_unpacked(whole, tmp_path, monkeypatch):
    """It is refused by the sizes that it declares, before anything is read."""
    members = members_of(whole)
    members["joint_positions.npy"] = npy(np.zeros((100_000, 12)))
    path = tmp_path / "a.npz"
    pack(path, members)
    assert path.stat().st_size < 50_000
    monkeypatch.setattr("loco_drake.motion.motion_file.MAX_BYTES", 2**20)

    def read(*args):
        raise AssertionError("something was unpacked")

    monkeypatch.setattr(zipfile.ZipFile, "open", read)
    with pytest.raises(InputError, match="arrays are larger than 1 MB"):
        load_motion(path)


def test_an_archive_that_declares_less_than_it_holds_is_refused(whole, tmp_path):
    data = bytearray(whole.read_bytes())
    start = data.rfind(b"PK\x01\x02")
    struct.pack_into("<I", data, start + 24, 130)
    (tmp_path / "a.npz").write_bytes(data)
    with pytest.raises(InputError, match=r"a\.npz"):
        load_motion(tmp_path / "a.npz")


def test_a_folder_and_a_pipe_are_no_motion_files(tmp_path):
    import os

    os.mkfifo(tmp_path / "pipe.npz")
    for path in (tmp_path, tmp_path / "pipe.npz"):
        with pytest.raises(InputError, match="There is no Motion file"):
            load_motion(path)


def test_a_motion_keeps_where_its_gait_changes(tmp_path):
    from dataclasses import replace

    changes = ((0, GaitLabel("dog", "trot")), (5, GaitLabel("elephant", "walk")))
    motion = replace(synthetic_motion(seconds=0.4), gait_changes=changes)
    save_motion(motion, tmp_path / "a.npz")
    again = load_motion(tmp_path / "a.npz")
    assert again.gait_changes == changes
    assert again.slice(3, 8).gait_changes == ((0, changes[0][1]), (2, changes[1][1]))
    assert again.slice(6, 8).gait_changes == ((0, changes[1][1]),)
    assert again.mirrored().gait_changes == changes
    rows = [label.index for _, label in changes]
    assert again.label_indices.tolist() == [rows[0]] * 5 + [rows[1]] * 16
