"""The download against a real web server on the loopback interface."""

import hashlib
import socket

import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.download import RemoteFile, download_files, parse_mirror
from tests.mirror_server import serve

NAMES = (
    "dog_mann/a.txt",
    "dog_mann/keypoints/b.txt",
    "horse_vhdc/c.txt",
    "mpc/d e.txt",
)
# Larger than one chunk of the download, and of different sizes.
CONTENTS = {name: f"{name},".encode() * (9000 + i) for i, name in enumerate(NAMES)}


@pytest.fixture
def mirror(tmp_path, monkeypatch):
    """A folder with the files, and no proxy between the test and its server."""
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    folder = tmp_path / "mirror"
    for name, content in CONTENTS.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


@pytest.fixture
def files():
    return [
        RemoteFile(
            name=name,
            url=f"http://origin.invalid/{name}",
            size=len(content),
            sha256=hashlib.sha256(content).hexdigest(),
        )
        for name, content in CONTENTS.items()
    ]


def fetch(files, folder, mirror, report=lambda done: None):
    """What went wrong with each file that failed."""
    outcomes = list(download_files(files, folder, mirror, report))
    assert [file for file, _ in outcomes] == files
    return {file.name: error for file, error in outcomes if error is not None}


def content_of(folder):
    """All files below a folder, hidden ones too."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def test_all_files_arrive_with_one_request_each(mirror, files, tmp_path):
    folder = tmp_path / "new" / "data"
    with serve(mirror) as server:
        assert fetch(files, folder, parse_mirror(f"{server.url}/")) == {}
        assert server.asked == list(NAMES)
    assert content_of(folder) == CONTENTS
    assert all(file.is_present(folder) for file in files)


def test_files_arrive_from_a_folder(mirror, files, tmp_path):
    assert fetch(files, tmp_path / "data", parse_mirror(str(mirror))) == {}
    assert content_of(tmp_path / "data") == CONTENTS


def test_a_cut_connection_leaves_nothing_and_the_next_run_completes(
    mirror, files, tmp_path
):
    folder = tmp_path / "data"
    with serve(mirror) as server:
        server.cut.add(NAMES[1])
        errors = fetch(files, folder, server.url)
        assert errors == {NAMES[1]: "was cut: the connection closed too early"}
        assert content_of(folder) == {n: CONTENTS[n] for n in NAMES if n != NAMES[1]}

        server.cut.clear()
        server.asked.clear()
        missing = [file for file in files if not file.is_present(folder)]
        assert fetch(missing, folder, server.url) == {}
        assert server.asked == [NAMES[1]]
    assert content_of(folder) == CONTENTS


@pytest.mark.parametrize("over_http", [True, False])
def test_missing_and_wrong_files_do_not_stop_the_others(
    over_http, mirror, files, tmp_path
):
    """What lay in the way of a wrong file is still there."""
    (mirror / NAMES[0]).unlink()
    (mirror / NAMES[2]).write_bytes(CONTENTS[NAMES[2]][:-1] + b"x")
    folder = tmp_path / "data"
    (folder / "horse_vhdc").mkdir(parents=True)
    (folder / NAMES[2]).write_text("older")
    with serve(mirror) as server:
        errors = fetch(files, folder, server.url if over_http else mirror)
    assert list(errors) == [NAMES[0], NAMES[2]]
    assert ("404" if over_http else "No such file") in errors[NAMES[0]]
    assert "another SHA-256" in errors[NAMES[2]]
    others = {name: CONTENTS[name] for name in (NAMES[1], NAMES[3])}
    assert content_of(folder) == {**others, NAMES[2]: b"older"}


def test_a_wrong_file_in_the_way_is_replaced(mirror, files, tmp_path):
    """Also one of the right length."""
    path = tmp_path / NAMES[0]
    path.parent.mkdir()
    path.write_bytes(CONTENTS[NAMES[0]][::-1])
    assert not files[0].is_present(tmp_path)
    assert fetch(files[:1], tmp_path, mirror) == {}
    assert path.read_bytes() == CONTENTS[NAMES[0]]


@pytest.mark.parametrize("over_http", [True, False])
def test_progress_never_goes_back_and_ends_at_all_bytes(
    over_http, mirror, files, tmp_path
):
    """A file that fails counts as done, so that the bar reaches its end."""
    (mirror / NAMES[1]).unlink()
    reported = []
    with serve(mirror) as server:
        origin = server.url if over_http else mirror
        fetch(files, tmp_path / "data", origin, reported.append)
    assert reported == sorted(reported)
    assert reported[-1] == sum(file.size for file in files)
    if over_http:  # in between, too: the first file is larger than a chunk
        assert 0 < reported[0] < files[0].size


def test_without_a_connection_three_files_are_tried(mirror, files, tmp_path):
    """A port that was just free refuses connections."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{free.getsockname()[1]}"
        errors = fetch(files, tmp_path / "data", url)
    no_connection = "found no connection to the server"
    assert list(errors.values())[:3] == [no_connection] * 3
    assert errors[NAMES[3]] == "was not tried, for want of a connection"
    assert content_of(tmp_path / "data") == {}


def test_a_folder_that_cannot_be_written_to_ends_the_download(mirror, files, tmp_path):
    (tmp_path / "data").write_text("a file")
    with pytest.raises(OSError, match="data"):
        fetch(files, tmp_path / "data", mirror)


@pytest.mark.parametrize("over_http", [True, False])
def test_link_that_leads_out_of_the_data_folder_is_not_followed(
    over_http, mirror, files, tmp_path
):
    """Whether it is a file's or a folder's; nothing appears behind it."""
    outside, folder = tmp_path / "outside", tmp_path / "data"
    outside.mkdir()
    (folder / "dog_mann").mkdir(parents=True)
    (folder / NAMES[0]).symlink_to(outside / "a.txt")
    (folder / "horse_vhdc").symlink_to(outside)
    with serve(mirror) as server:
        errors = fetch(files, folder, server.url if over_http else mirror)
    assert list(errors) == [NAMES[0], NAMES[2]]
    assert set(errors.values()) == {"is led out of the data folder by a link"}
    assert not list(outside.iterdir())


@pytest.mark.parametrize("over_http", [True, False])
def test_longer_file_than_the_manifest_says_is_refused_on_the_way(
    over_http, mirror, files, tmp_path
):
    (mirror / NAMES[0]).write_bytes(CONTENTS[NAMES[0]] + bytes(10**7))
    with serve(mirror) as server:
        errors = fetch(
            files[:1], tmp_path / "data", server.url if over_http else mirror
        )
    assert "than the manifest says" in errors[NAMES[0]]
    assert content_of(tmp_path / "data") == {}


@pytest.mark.parametrize("text", ["nowhere", "ftp://host/data"])
def test_a_mirror_is_a_folder_or_an_address(text):
    with pytest.raises(InputError, match=f"'{text}': --from takes a folder, or"):
        parse_mirror(text)
    assert parse_mirror(None) is None
