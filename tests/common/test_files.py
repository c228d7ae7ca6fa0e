"""Files that are whole or not there, and JSON from anywhere."""

import os
import stat
import subprocess
import sys
import threading

import pytest

from loco_drake.common.errors import InputError, check_choice, check_name, quoted
from loco_drake.common.files import (
    atomic_path,
    cache_dir,
    check_writable,
    parse_number,
    read_json,
)


def test_a_file_is_whole_or_as_it_was(tmp_path):
    path = tmp_path / "new" / "file.txt"
    with atomic_path(path) as temporary:
        temporary.write_text("one")
        assert temporary.suffix == ".txt"
    with pytest.raises(ZeroDivisionError), atomic_path(path) as temporary:
        temporary.write_text(f"two {1 / 0}")
    assert path.read_text() == "one"
    assert list(path.parent.iterdir()) == [path]


def test_the_cache_can_be_moved(monkeypatch, tmp_path):
    monkeypatch.setenv("LOCO_DRAKE_CACHE", str(tmp_path))
    assert cache_dir() == tmp_path
    monkeypatch.delenv("LOCO_DRAKE_CACHE")
    assert cache_dir().name == "loco_drake"


def write(path, text="new"):
    with atomic_path(path) as temporary:
        temporary.write_text(text)


def test_a_device_is_written_to_and_stays_a_device():
    write("/dev/null")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_a_pipe_is_written_to_and_stays_a_pipe(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    got = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_text()))
    reader.start()
    check_writable(pipe)
    write(pipe, "through")
    reader.join()
    assert got == ["through"]
    assert stat.S_ISFIFO(os.stat(pipe).st_mode)
    assert list(tmp_path.iterdir()) == [pipe]


@pytest.mark.parametrize("to_file", [False, True])
def test_what_goes_to_stdout_stands_where_it_was_written(tmp_path, to_file):
    """Between what is printed before and after, also where stdout is a file."""
    program = (
        "from pathlib import Path\n"
        "from loco_drake.common.files import atomic_path\n"
        "print('before', flush=True)\n"
        "with atomic_path(Path('/dev/stdout')) as path: path.write_text('figures\\n')\n"
        "print('after')\n"
    )
    command = [sys.executable, "-c", program]
    if to_file:
        with (tmp_path / "out").open("w") as out:
            subprocess.run(command, stdout=out, check=True)
        printed = (tmp_path / "out").read_text()
    else:
        printed = subprocess.run(command, capture_output=True, text=True).stdout
    assert printed == "before\nfigures\nafter\n"


def test_a_link_stays_and_what_it_names_is_replaced(tmp_path):
    (tmp_path / "real").mkdir()
    target, link = tmp_path / "real" / "file.txt", tmp_path / "link.txt"
    link.symlink_to(target)
    for text in ("one", "two"):  # first where nothing is yet
        write(link, text)
        assert link.is_symlink()
        assert target.read_text() == text
    assert list(target.parent.iterdir()) == [target]


def test_a_folder_is_no_file_to_be_written(tmp_path):
    for check in (write, check_writable):
        with pytest.raises(InputError, match="is a folder, not a file"):
            check(tmp_path)


@pytest.mark.parametrize("folder", [False, True])
def test_what_cannot_be_written_is_found_out_before(tmp_path, folder):
    """Without leaving anything behind."""
    (tmp_path / "file").write_text("kept")
    with pytest.raises(NotADirectoryError, match=r"Not a folder.*file"):
        check_writable(tmp_path / "file" / "a" / "b", folder=folder)
    with pytest.raises(OSError, match="too long"):
        check_writable(tmp_path / ("x" * 300), folder=folder)
    check_writable(tmp_path / "new" / "deep" / "a.json", folder=folder)
    check_writable(None, folder=folder)
    assert list(tmp_path.iterdir()) == [tmp_path / "file"]


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_permissions_are_found_out_before(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(PermissionError):
        check_writable(tmp_path / "a.json")
    tmp_path.chmod(0o700)


def test_a_name_of_any_length_can_be_written(tmp_path):
    path = tmp_path / ("x" * 250 + ".json")
    write(path)
    assert path.read_text() == "new"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "Expecting value"),
        (b"{", "Expecting property name"),
        (b"[1]", "not an object"),
        (b'{"a": NaN}', "nan is not finite|NaN is not finite"),
        (b'{"a": -Infinity}', "not finite"),
        (b'{"a": 1e999}', "1e999 is not finite"),
        (b'{"a": ' + b"1" * 5000 + b"}", "4300 digits"),
        (b'{"a": "\xff"}', "can't decode"),
        (b'{"a": "\\ud800"}', "surrogates not allowed"),
        (b'{"a":' * 100_000, "nested too deeply"),
    ],
    ids=lambda value: str(value)[:20],
)
def test_what_is_no_json_of_finite_numbers_is_refused(tmp_path, content, reason):
    path = tmp_path / "a.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=f"a.json is damaged: .*({reason})") as error:
        read_json(path)
    assert len(str(error.value).splitlines()) == 1


def test_json_is_read_with_and_without_a_byte_order_mark(tmp_path):
    for mark in (b"", b"\xef\xbb\xbf"):
        (tmp_path / "a.json").write_bytes(mark + b'{"a": [1, 2.5, null, "\xc3\xa9"]}')
        assert read_json(tmp_path / "a.json") == {"a": [1, 2.5, None, "\u00e9"]}
    with pytest.raises(InputError, match="There is no file"):
        read_json(tmp_path)


def test_a_file_that_is_too_large_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr("loco_drake.common.files._MAX_JSON_BYTES", 5)
    (tmp_path / "a.json").write_text('{"a": 1}')
    with pytest.raises(InputError, match="larger than"):
        read_json(tmp_path / "a.json")


def test_messages_are_one_line_whatever_they_quote():
    """No control characters, no thousand letters, no half of a character."""
    message = str(InputError(f"bad \x1b[31m\n\u202e\ud800 {'x' * 5000}."))
    assert message.isprintable()
    assert message.startswith(r"bad \x1b[31m\n\u202e\ud800 xxx")
    assert len(message) < 260
    assert quoted("a\nb") == r"'a\nb'"
    assert len(quoted("y " * 500)) <= 66
    with pytest.raises(InputError, match=r"Unknown gait 'a\\nb'; the choices are c, d"):
        check_choice("gait", "a\nb", ["c", "d"])


@pytest.mark.parametrize("name", ["", "x" * 65, "a\nb", "../x", "\ud800", "a\x00"])
def test_names_are_short_printable_and_no_paths(name):
    assert check_name("robot", "my robot-2") == "my robot-2"
    with pytest.raises(InputError, match="A robot must have 1 to 64 printable"):
        check_name("robot", name)


@pytest.mark.parametrize("text", ["1_0", "٣", "", "x", "1,5", "0x10"])
def test_what_is_no_number_in_a_table_is_refused(text):
    """Python's own function takes the first two, for 10 and for 3."""
    assert parse_number(" -1.5e1 ") == -15.0
    with pytest.raises(ValueError, match=r"number|to float"):
        parse_number(text)
