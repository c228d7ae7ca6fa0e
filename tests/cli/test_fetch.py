"""``data fetch``, with a manifest of made recordings and a server of its own."""

import csv
import hashlib
import json
import re
import shutil
import signal
import subprocess
import sys

import pytest

from loco_drake.cli.fetch import describe_licence
from loco_drake.cli.main import main
from loco_drake.datasets import download, segments
from loco_drake.datasets.registry import DATASETS
from tests.mirror_server import serve
from tests.process import HEAR_CTRL_C, LIMIT
from tests.synthetic import write_data_folder

GAITS = ("pace", "trot", "gallop")
FILES = [f"dog_mann/keypoints/made_{gait}.txt" for gait in GAITS]


@pytest.fixture
def mirror(tmp_path, monkeypatch):
    """A folder to fetch from; its manifest and its segments are the shipped ones.

    It holds a reference that no reader knows. Cache and working folder are empty.
    """
    folder = write_data_folder(tmp_path / "mirror", GAITS, seconds=2.0)
    (folder / "else").mkdir()
    shutil.copy(folder / FILES[0], folder / "else" / "x.txt")
    rows = [["file", "repository", "commit", "path", "bytes", "sha256"]]
    for name in [*FILES, "else/x.txt"]:
        content = (folder / name).read_bytes()
        checksum = hashlib.sha256(content).hexdigest()
        rows.append([name, "owner/name", "0" * 40, name, len(content), checksum])
    with (tmp_path / "manifest.csv").open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    monkeypatch.setattr(download, "MANIFEST", tmp_path / "manifest.csv")
    monkeypatch.setattr(segments, "SHIPPED", folder / "segments.csv")
    monkeypatch.setenv("LOCO_DRAKE_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("LOCO_DRAKE_DATA", raising=False)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    return folder


def names_in(folder):
    paths = [path for path in folder.rglob("*") if path.is_file()]
    return sorted(path.relative_to(folder).as_posix() for path in paths)


def test_fetched_recordings_are_found_by_other_commands(mirror, tmp_path, capsys):
    """Without any option: they lie in the user's cache folder."""
    with serve(mirror) as server:
        assert main(["data", "fetch", "--from", server.url]) == 0
        assert server.asked == FILES
        printed = capsys.readouterr().out
        assert "CC BY-NC 4.0: name the authors, no commercial use." in printed
        assert "Zhang, Starke, Komura, Saito 2018" in printed
        assert "3 files in" in printed
        assert "3 fetched, 0 already there" in printed

        assert main(["data", "fetch", "--from", server.url]) == 0
        assert server.asked == FILES
        assert "0 fetched, 3 already there" in capsys.readouterr().out
    data = tmp_path / "cache" / "data"
    assert names_in(data) == [*sorted(FILES), "segments.csv"]
    assert main(["data", "list", "--json", str(tmp_path / "a.json")]) == 0
    dog = json.loads((tmp_path / "a.json").read_text())["dog"]
    assert (dog["clips"], dog["seconds"]) == (3, 6.0)


def test_a_failed_file_is_status_1_and_a_second_run_completes(mirror, tmp_path, capsys):
    data = tmp_path / "data"
    options = ["--data-dir", str(data), "--source", "dog"]
    options += ["--json", str(tmp_path / "a.json")]
    with serve(mirror) as server:
        server.cut.add(FILES[1])
        options += ["--from", server.url]
        assert main(["data", "fetch", *options]) == 1
        error = capsys.readouterr().err
        assert f"Failed: {FILES[1]} was cut" in error
        assert "The same command again fetches only what is missing." in error
        dog = json.loads((tmp_path / "a.json").read_text())["dog"]
        assert (dog["files"], dog["fetched"], dog["already_there"]) == (3, 2, 0)
        assert list(dog["failed"]) == [FILES[1]]
        assert dog["bytes"] == sum((mirror / name).stat().st_size for name in FILES)
        assert dog["licence"] == "CC BY-NC 4.0"
        # No stretch of a file that is not there.
        assert "made_trot" not in (data / "segments.csv").read_text()

        server.cut.clear()
        server.asked.clear()
        assert main(["data", "fetch", *options]) == 0
        assert server.asked == [FILES[1]]
    dog = json.loads((tmp_path / "a.json").read_text())["dog"]
    assert (dog["fetched"], dog["already_there"], dog["failed"]) == (1, 2, {})
    assert (data / "segments.csv").read_text() == (
        (mirror / "segments.csv").read_text()
    )


def test_own_segments_stay_and_the_folder_of_the_variable_is_used(
    mirror, tmp_path, monkeypatch
):
    own = "dataset,file,gait,start_frame,end_frame,fps\ndog_mann,mine.txt,walk,0,9,60\n"
    data = tmp_path / "mine"
    data.mkdir()
    (data / "segments.csv").write_text(own)
    monkeypatch.setenv("LOCO_DRAKE_DATA", str(data))
    assert main(["data", "fetch", "--from", str(mirror)]) == 0
    rows = segments.read_rows(data / "segments.csv")
    assert [row["file"] for row in rows] == [
        *(name.removeprefix("dog_mann/") for name in FILES),
        "mine.txt",
    ]


def test_a_damaged_table_in_the_way_is_refused_before_the_download(
    mirror, tmp_path, capsys
):
    data = tmp_path / "data"
    data.mkdir()
    (data / "segments.csv").write_text("a,b\n1,2\n")
    assert main(["data", "fetch", "--from", str(mirror), "--data-dir", str(data)]) == 2
    assert "line 1 lacks dataset" in capsys.readouterr().err
    assert names_in(data) == ["segments.csv"]


def test_many_failures_are_counted_not_all_listed(mirror, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    header, row, *_ = download.MANIFEST.read_text().splitlines()
    rows = [row.replace("made_pace", f"made_{i}", 1) for i in range(14)]
    download.MANIFEST.write_text("\n".join([header, *rows]) + "\n")
    assert main(["data", "fetch", "--from", str(tmp_path / "empty")]) == 1
    printed = capsys.readouterr()
    assert printed.err.count("cannot be read from the mirror: No such file") == 10
    assert "Failed: 4 more files" in printed.err
    assert "0 files in" in printed.out
    assert names_in(tmp_path / "cache") == []


INTERRUPTED = """
import sys
from pathlib import Path

from loco_drake.cli.main import main
from loco_drake.datasets import download

download.MANIFEST = Path(sys.argv[1])
raise SystemExit(main(["data", "fetch", "--from", sys.argv[2]]))
"""


@pytest.mark.slow
def test_ctrl_c_leaves_whole_files_only(mirror, tmp_path):
    with serve(mirror) as server:
        server.stalled.add(FILES[1])
        arguments = [str(download.MANIFEST), server.url]
        with subprocess.Popen(
            [sys.executable, "-c", HEAR_CTRL_C + INTERRUPTED, *arguments],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        ) as process:
            assert server.halfway.wait(LIMIT)
            process.send_signal(signal.SIGINT)
            _, error = process.communicate(timeout=LIMIT)
    assert process.returncode == 1
    assert error.splitlines()[-1] == "loco-drake: interrupted"
    assert "Traceback" not in error
    data = tmp_path / "cache" / "data"
    assert names_in(data) == FILES[:1]
    assert (data / FILES[0]).read_bytes() == (mirror / FILES[0]).read_bytes()


def test_real_recordings_are_all_there_and_nothing_is_fetched(real_data, tmp_path):
    """The mirror is an empty folder."""
    sources = [s for s, d in DATASETS.items() if (real_data / d.folder).is_dir()]
    (tmp_path / "empty").mkdir()
    path = tmp_path / "a.json"
    options = ["--data-dir", str(real_data), "--from", str(tmp_path / "empty")]
    options += ["--source", *sources]
    assert main(["data", "fetch", *options, "--json", str(path)]) == 0
    for source in json.loads(path.read_text()).values():
        assert source["files"] == source["already_there"] > 0
        assert source["fetched"] == 0


@pytest.mark.parametrize(
    ("licence", "said"),
    [
        ("CC BY-NC 4.0", "name the authors, no commercial use"),
        ("CC BY-SA 4.0", "name the authors, share .* same licence"),
        ("BSD-3-Clause", ""),
        ("none stated", ""),
    ],
)
def test_conditions_of_creative_commons_licences_are_said(licence, said):
    assert re.fullmatch(said, describe_licence(licence))
