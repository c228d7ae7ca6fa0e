import json

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.common.files import content_sha256
from loco_drake.control.drive_file import load_drive, save_drive, states_sha256
from loco_drake.control.driving import OrderTable

HEADER = {
    "robot": "go2",
    "gait": "dog-trot",
    "seed": 3,
    "scenario": "robot: go2\n",
    "policy_sha256": "0" * 64,
    "steps": 100,
    "states_sha256": "1" * 64,
}
TABLE = OrderTable(
    np.array([0.0, 0.1 + 0.2, 1.7, 2.0]),
    np.array(
        [
            [0.1, 0, 0, 1, 0, 0],
            [1 / 3, -0.2, 1e-17, 4, 0, 0],
            [0, 0, 0, 4, 6, 1],
            [0, 0, 0, -1, 0, 0],  # any gait
        ]
    ),
)


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "a.drive"
    save_drive(path, TABLE, **HEADER)
    return path


def test_what_is_read_is_what_was_written_to_the_last_bit(path):
    drive = load_drive(path)
    assert {name: drive.header[name] for name in HEADER} == HEADER
    np.testing.assert_array_equal(drive.table.times, TABLE.times)
    np.testing.assert_array_equal(drive.table.rows, TABLE.rows)


def test_every_cut_and_every_change_is_refused(path):
    content = path.read_bytes()
    for end in range(0, len(content) - 1, 7):
        path.write_bytes(content[:end])
        with pytest.raises(InputError, match=r"is damaged|is not a drive"):
            load_drive(path)
    for place in range(0, len(content) - 1, 11):
        changed = bytearray(content)
        changed[place] ^= 1
        path.write_bytes(bytes(changed))
        with pytest.raises(InputError):
            load_drive(path)


def write(path, header, rows):
    """Writes a file whose hash is right."""
    content = "\n".join(rows)
    header = {**header, "content_sha256": None}
    del header["content_sha256"]
    header["content_sha256"] = content_sha256(header, {"rows": content.encode()})
    path.write_text(f"{json.dumps(header)}\n{content}\n")


def header_of(path):
    header = json.loads(path.read_text().split("\n")[0])
    del header["content_sha256"]
    return header


@pytest.mark.parametrize(
    "row",
    [
        "",
        "null",
        "[" * 100_000,
        "[0, 1, 2]",
        '[0, 1, 0, 0, "fly", 0, 0]',
        '[0, NaN, 0, 0, "dog-trot", 0, 0]',
        '[0, "1", 0, 0, "dog-trot", 0, 0]',
        '[0, 1, 0, 0, "dog-trot", 0, 0.5]',
        '[0, 99, 0, 0, "dog-trot", 0, 0]',
        '[null, 1, 0, 0, "dog-trot", 0, 0]',
        '[[0], 1, 0, 0, "dog-trot", 0, 0]',
    ],
)
def test_rows_that_are_amiss_are_refused_even_if_the_hash_is_right(path, row):
    write(path, header_of(path), [row])
    with pytest.raises(InputError, match="is not a sound drive"):
        load_drive(path)


@pytest.mark.parametrize("name", HEADER)
def test_a_header_must_be_complete(path, name):
    row = '[0, 1, 0, 0, "dog-trot", 0, 0]'
    for value in (None, [1]):
        write(path, {**header_of(path), name: value}, [row])
        with pytest.raises(InputError, match=f"its header lacks {name}"):
            load_drive(path)
        save_drive(path, TABLE, **HEADER)


@pytest.mark.parametrize("change", [lambda names: names[::-1], lambda names: None])
def test_other_columns_are_refused(path, change):
    """Speeds in another order would be driven as they stand."""
    header = header_of(path)
    row = '[0, 1, 0, 0, "dog-trot", 0, 0]'
    write(path, {**header, "columns": change(header["columns"])}, [row])
    with pytest.raises(InputError, match="its columns must be time, forward, sideways"):
        load_drive(path)


def test_foreign_and_newer_files_are_refused(path):
    write(path, {**header_of(path), "schema_version": 2}, ["[]"])
    with pytest.raises(InputError, match=r"has the schema '2'; this .* reads 1"):
        load_drive(path)
    for text in ("", "time,forward\n0,1\n", '{"robot": "go2"}\n', "[1]\n"):
        path.write_text(text)
        with pytest.raises(InputError, match="is not a drive"):
            load_drive(path)


def test_the_hash_of_states_tells_the_last_bit():
    states = np.arange(12.0).reshape(3, 4)
    other = states.copy()
    other[2, 3] = np.nextafter(other[2, 3], 0)
    assert states_sha256(states) == states_sha256(states.copy())
    assert states_sha256(states) != states_sha256(other)
    assert states_sha256(states) != states_sha256(states.reshape(4, 3))
