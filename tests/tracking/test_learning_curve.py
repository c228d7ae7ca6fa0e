"""Learning curves from logs written by hand."""

import json

from loco_drake.tracking.learning_curve import learning_curve


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
    path.write_text("\n".join([wrong[0], *log.read_text().splitlines(), *wrong]))
    assert learning_curve(log) == sound
