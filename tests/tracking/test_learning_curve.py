"""Learning curves from logs written by hand."""

import json
import re

import pytest

from loco_drake.common.errors import InputError
from loco_drake.tracking.learning_curve import learning_curve, trim_log


def write(path, rows):
    lines = [
        json.dumps({"steps": steps, "seconds": seconds, "train/std": 0.5, **returns})
        for steps, seconds, returns in rows
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_seconds_of_resumed_runs_add_up_and_new_labels_start_late(tmp_path):
    log = write(
        tmp_path / "progress.jsonl",
        [
            (100, 10.0, {"return/dog-trot": 5.0, "return/episode_steps": 33.0}),
            (200, 20.0, {"return/dog-trot": 7.126}),
            (300, 4.0, {"return/dog-trot": 9.0, "return/mpc-trot": 1.0}),
            (400, 8.0, {"return/dog-trot": 11.0, "return/mpc-trot": 2.0}),
        ],
    )
    assert learning_curve(log) == {
        "steps": [100, 200, 300, 400],
        "seconds": [10.0, 20.0, 24.0, 28.0],
        "return": {
            "dog-trot": [5.0, 7.13, 9.0, 11.0],
            "mpc-trot": [None, None, 1.0, 2.0],
        },
    }


def test_a_long_log_is_thinned_but_keeps_its_ends(tmp_path):
    rows = [(n, float(n), {"return/dog-trot": n / 10}) for n in range(1, 1001)]
    curve = learning_curve(write(tmp_path / "progress.jsonl", rows), points=11)
    assert len(curve["steps"]) == 11
    assert (curve["steps"][0], curve["steps"][-1]) == (1, 1000)
    assert curve["return"]["dog-trot"] == [n / 10 for n in curve["steps"]]


def test_an_empty_log_has_an_empty_curve(tmp_path):
    (tmp_path / "progress.jsonl").write_text("")
    empty = {"steps": [], "seconds": [], "return": {}}
    assert learning_curve(tmp_path / "progress.jsonl") == empty


def test_damaged_lines_are_passed_over(tmp_path):
    """Half a line, what is no JSON, no object, or holds something but numbers."""
    path = tmp_path / "progress.jsonl"
    log = write(path, [(n, float(n), {"return/dog-trot": 1.0}) for n in (1, 2)])
    sound = learning_curve(log)
    wrong = ['{"steps": 3, "sec', "[1]", '{"steps": 3}', "\x00", "[" * 100_000]
    wrong += ['{"steps": 3, "seconds": []}', '{"steps": 3, "seconds": NaN}']
    wrong += [f'{{"steps": {10**400}, "seconds": 3.0}}']
    wrong += ['{"steps": 3, "seconds": "4"}', '{"steps": 3.5, "seconds": 4}']
    wrong += ['{"steps": 3, "seconds": 4, "train/std": true}']
    path.write_text("\n".join([wrong[0], *log.read_text().splitlines(), *wrong]))
    assert learning_curve(log) == sound


def test_lines_of_a_lost_run_are_removed_without_a_word(tmp_path, capsys):
    """Those after the checkpoint; and a run that ended wrote none for its end."""
    rows = [(n, float(n), {}) for n in (32, 64, 96)]
    log = write(tmp_path / "progress.jsonl", rows)
    for steps, left in ((96, 3), (64, 2), (96, 2)):
        trim_log(log, steps, 32)
        assert len(log.read_text().splitlines()) == left
    trim_log(tmp_path / "none.jsonl", 32, 32)
    assert capsys.readouterr().err == ""
    assert not (tmp_path / "none.jsonl").exists()


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda t: "garbage\n" + t, "1 damaged lines were removed"),
        (lambda t: t + t, "3 damaged lines were removed"),
        (lambda t: t[:90], "1 damaged .*; it ends at step 32, but .* at step 96"),
        (lambda t: "", "it ends at step 0, but the checkpoint at step 96"),
    ],
)
def test_what_is_lost_of_a_log_is_reported(tmp_path, capsys, damage, said):
    log = write(tmp_path / "a.jsonl", [(n, float(n), {}) for n in (32, 64, 96)])
    log.write_text(damage(log.read_text()))
    trim_log(log, 96, 32)
    heard = capsys.readouterr().err
    assert re.fullmatch(rf"{re.escape(str(log))}: {said}\.\n", heard)
    kept = [json.loads(line)["steps"] for line in log.read_text().splitlines()]
    assert kept == [32, 64, 96][: len(kept)]


def test_what_is_no_log_is_refused(tmp_path):
    (tmp_path / "zero").symlink_to("/dev/zero")
    with (tmp_path / "huge").open("wb") as file:
        file.truncate(10**12)
    for name, reason in (("zero", "is not a file"), ("huge", "larger than 256 MB")):
        with pytest.raises(InputError, match=reason):
            trim_log(tmp_path / name, 32, 32)
    with pytest.raises(InputError, match="is not a file"):
        trim_log(tmp_path, 32, 32)
