"""What is left of work that is interrupted, or whose output cannot be saved."""

import json
import shutil
import signal
from pathlib import Path
from types import SimpleNamespace

import pytest

from loco_drake.cli.main import main
from loco_drake.cli.output import check_output, do_all
from loco_drake.cli.simulation import Pace
from loco_drake.common.errors import InputError
from loco_drake.motion.motion_file import save_motion
from tests.synthetic_motion import synthetic_motion

# What is written to it meets a full disk.
FULL = "/dev/full"
needs_full = pytest.mark.skipif(not Path(FULL).exists(), reason="no /dev/full here")


def simulate(weights, *options):
    policy = str(weights / "calm.safetensors")
    return main(["simulate", "--no-meshcat", "--policy", policy, *map(str, options)])


def test_ctrl_c_saves_what_was_simulated(weights, tmp_path, monkeypatch, capsys):
    def keep(self, now):
        if now > 0.3:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Pace, "keep", keep)
    before = signal.getsignal(signal.SIGINT)
    outputs = ("--json", tmp_path / "a.json", "--html", tmp_path / "a.html")
    assert simulate(weights, *outputs) == 1
    printed = capsys.readouterr()
    assert "Stopped after 0.32 of 10 s; the figures are of these." in printed.err
    figures = json.loads((tmp_path / "a.json").read_text())
    assert figures["interrupted"]
    assert figures["simulated_s"] == pytest.approx(0.32)
    # Steps that were not asked for are not lost.
    assert figures["normalized_return"] > 50
    assert f"{figures['normalized_return']:.3f}   of 100" in printed.out
    assert (tmp_path / "a.html").read_text().startswith("<!DOCTYPE html>")
    assert signal.getsignal(signal.SIGINT) is before


@needs_full
def test_a_full_disk_keeps_neither_figures_nor_other_files(weights, tmp_path, capsys):
    page = tmp_path / "a.html"
    assert simulate(weights, "--duration", 0.2, "--json", FULL, "--html", page) == 1
    printed = capsys.readouterr()
    assert "normalized return" in printed.out
    assert printed.err == "loco-drake: No space left on device\n"
    assert page.stat().st_size > 1e5


@needs_full
@pytest.mark.parametrize(
    ("line", "printed"),
    [
        ("data list --data-dir DATA", "Sources of motion"),
        ("runs list FOLDER", ""),
        ("generate --duration 0.4 --out FOLDER/out", "times real time"),
        ("record --motions FOLDER --attempts 1 --out FOLDER/out", "Motion files in"),
    ],
)
def test_figures_are_printed_where_they_cannot_be_saved(
    line, printed, made_data, tmp_path, capsys
):
    save_motion(synthetic_motion("dog-trot", 1.0, 0.3), tmp_path / "a.npz")
    line = line.replace("FOLDER", str(tmp_path)).replace("DATA", str(made_data))
    assert main([*line.split(), "--json", FULL]) == 1
    told = capsys.readouterr()
    assert printed in told.out
    assert told.err.endswith("loco-drake: No space left on device\n")


def test_all_steps_are_done_and_the_first_error_is_told():
    done = []

    def fail(name):
        done.append(name)
        raise OSError(28, name)

    with pytest.raises(OSError, match="first"):
        do_all(
            lambda: fail("first"), lambda: fail("second"), lambda: done.append("last")
        )
    assert done == ["first", "second", "last"]
    with pytest.raises(ZeroDivisionError):
        do_all(lambda: 1 / 0, lambda: done.append("never"))
    assert "never" not in done


def test_a_full_disk_is_found_out_before_the_work(tmp_path, monkeypatch):
    usage = SimpleNamespace(free=1)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage)
    check_output(tmp_path / "a.json")
    usage.free = 0
    with pytest.raises(InputError, match=r"a.json' cannot be written: No space left"):
        check_output(tmp_path / "a.json")


def test_folders_that_no_option_names_are_checked_too(
    made_data, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "motions").write_text("kept")
    assert main(["retarget", "--data-dir", str(made_data)]) == 2
    assert "'motions/go2' cannot be written: Not a folder" in capsys.readouterr().err
    assert (tmp_path / "motions").read_text() == "kept"


def test_record_refuses_another_robot_before_it_works(tmp_path, capsys):
    save_motion(synthetic_motion(seconds=0.5), tmp_path / "a.npz")
    save_motion(synthetic_motion(seconds=0.5, name="a1"), tmp_path / "b.npz")
    line = ["record", "--motions", str(tmp_path), "--out", str(tmp_path / "out")]
    assert main(line) == 2
    assert "b.npz is of a1, not of go2" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
