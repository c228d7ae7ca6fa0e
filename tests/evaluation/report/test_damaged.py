"""Whatever is wrong in a file of results is said in one sentence."""

import json
import re

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.common.files import TIMES, figures_sha256
from loco_drake.evaluation.report import pictures
from loco_drake.evaluation.report.page import of_results
from loco_drake.evaluation.report.results import load_results, results_dir
from tests.report_results import learning, robustness, steering, tokenizer, tracking

SHIPPED = sorted(path.name for path in results_dir().glob("*.json"))
# What the hash leaves out, in bytes: a number or a list of numbers, or the hash.
TIMED = rf'"({"|".join(TIMES)})":\s*(\[[^]]*\]|"?[0-9a-f.+-]+"?)'.encode()
PICTURES = ("confusion", "returns", "learning", "grid", "curves", "library")
WRONG = ("a word", [], {}, 3, None, True, float("nan"), 1e300, 10**400, [[1.0]], "$x_{")


def places(content):
    """Every object or list, and key or index, that a value lies at."""
    if isinstance(content, dict):
        keys = list(content)
    elif isinstance(content, list):
        keys = list(range(len(content)))
    else:
        return
    for key in keys:
        yield content, key
        yield from places(content[key])


def said_of(folder, name, written):
    """Reads a folder with one file; returns what is said of it, if it is refused."""
    (folder / name).write_bytes(written)
    said = None
    try:
        of_results(load_results(folder))
    except InputError as error:
        said = str(error)
    assert said is None or (name in said and "\n" not in said)
    return said


def refused(folder, name, content):
    content = {**content}
    content.pop("sha256", None)  # which would tell them all
    return said_of(folder, name, json.dumps(content).encode()) is not None


@pytest.fixture(autouse=True)
def quick_pictures(monkeypatch):
    """Pictures are drawn but not written, which takes most of the time."""
    monkeypatch.setattr(
        "matplotlib.figure.Figure.savefig", lambda self, out, **_: out.write("<svg ")
    )


@pytest.mark.parametrize("name", SHIPPED)
def test_any_value_that_is_wrong(name, tmp_path, monkeypatch):
    """Of what tables and goals are made of: each of 12 values, by each wrong one."""
    for picture in PICTURES:
        monkeypatch.setattr(pictures, f"{picture}_picture", lambda *_: "")
    content = json.loads((results_dir() / name).read_text())
    random = np.random.default_rng(0)
    found = list(places(content))
    count = 0
    for index in random.choice(len(found), 12, replace=False):
        parent, key = found[index]
        kept = parent[key]
        for wrong in WRONG:
            parent[key] = wrong
            count += refused(tmp_path, name, content)
        parent[key] = kept
    for key in list(content):
        without = {k: v for k, v in content.items() if k != key}
        count += refused(tmp_path, name, without)
    assert count > 0
    assert not refused(tmp_path, name, content)


@pytest.mark.parametrize(
    ("name", "path"),
    [
        ("learning-go2.json", ("learning", "return", "dog-trot")),
        ("learning-go2.json", ("learning", "steps")),
        ("learning-go2.json", ("learning", "return")),
        ("tracking-go2-generated.json", ("labels", "dog-trot")),
        ("tracking-go2-generated.json", ("contact",)),
        ("generation.json", ("robots", "go2", "confusion", "labels")),
        ("generation.json", ("robots", "go2", "confusion", "transformer")),
        (
            "generation.json",
            ("robots", "go2", "confusion", "transformer", "real_to_real"),
        ),
    ],
)
@pytest.mark.parametrize("wrong", [3, [1.0, "x"], {"a": []}])
def test_values_of_another_kind_are_refused(name, path, wrong, tmp_path):
    content = json.loads((results_dir() / name).read_text())
    parent = content
    for key in path[:-1]:
        parent = parent[key]
    parent[path[-1]] = wrong
    assert refused(tmp_path, name, content)


@pytest.mark.parametrize(
    "path",
    [
        ("labels", "dog-trot", "range"),
        ("labels", "dog-trot", "range", "forward_mps"),
        ("labels", "dog-trot", "points"),
        ("labels", "dog-trot", "points", 0, "command"),
        ("labels", "dog-trot", "points", 0, "velocity"),
        ("labels", "dog-trot", "points", 0, "fell"),
        ("labels", "mpc-trot", "drives"),
        ("all", "latency_robot_s"),
    ],
)
@pytest.mark.parametrize("wrong", ["x", [1.0, "x"], {"a": []}])
def test_damage_of_steering_is_refused(path, wrong, tmp_path):
    content = steering()
    parent = content
    for key in path[:-1]:
        parent = parent[key]
    parent[path[-1]] = wrong
    assert refused(tmp_path, "steering-go2.json", content)
    parent[path[-1]] = steering_at(path)
    assert not refused(tmp_path, "steering-go2.json", content)


@pytest.mark.parametrize(
    ("path", "wrong"),
    [
        (("labels", "dog-trot", "recovery_s"), "x"),
        (("all", "impulse_80_percent_interval_ns"), 3),
        (("all", "curves"), [1]),
        (("all", "curves", "push_left"), None),
        (("all", "curves", "friction", "levels"), [0.8, "x", 0.3]),
        (("all", "curves", "friction", "success"), [1.0, 0.5]),
        (("all", "curves", "friction", "success"), [1.0, 0.5, 7.0]),
        (("all", "curves", "friction", "success"), [1.0, None, 0.0]),
        (("all", "curves", "friction", "episodes"), [2, 4, 0]),
        (("all", "curves", "friction", "episodes"), []),
        (("seeds",), "x"),
    ],
)
def test_damage_of_robustness_is_refused(path, wrong, tmp_path):
    content = robustness()
    assert not refused(tmp_path, "robustness-go2.json", content)
    parent = content
    for key in path[:-1]:
        parent = parent[key]
    parent[path[-1]] = wrong
    assert refused(tmp_path, "robustness-go2.json", content)


def steering_at(path):
    value = steering()
    for key in path:
        value = value[key]
    return value


@pytest.mark.parametrize(
    "written",
    [
        b"",
        b"\0" * 100,
        b"\xff\xfe\x00{",
        b'{"robot": "go2", "labels": \xe9}',
        b"[" * 100_000,
        b'{"robots": ' * 100_000,
        b'{"robot": ' + b"9" * 5000 + b"}",
    ],
    ids=["empty", "zeros", "utf-16", "latin-1", "nested", "nested objects", "digits"],
)
def test_bytes_that_are_no_results_are_refused(written, tmp_path):
    assert said_of(tmp_path, "tokenizer.json", written)


def test_long_names_and_line_breaks_do_not_reach_the_message(tmp_path):
    name = "tokenizer.json"
    for wrong in ("x" * 10_000, "one\ntwo\r\x1b[31m"):
        content = {"robot": "go2", **tokenizer(joint_rmse_rad=wrong)}
        said = said_of(tmp_path, name, json.dumps(content).encode())
        assert len(said) < 400
        assert said.isprintable()
    (tmp_path / name).unlink()
    content = learning()
    content["learning"]["return"]["y\n" * 10_000] = []
    said = said_of(tmp_path, "learning-go2.json", json.dumps(content).encode())
    assert len(said) < 400
    assert said.isprintable()


def test_labels_of_results_need_not_be_those_of_the_package(tmp_path):
    """A label that is not one of the fifteen is left out of the tables, not refused."""
    content = tracking()
    content["labels"]["cat-sneak"] = content["labels"]["dog-trot"]
    assert not refused(tmp_path, "tracking-go2-generated.json", content)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_flipped_digit_is_noticed(name, tmp_path, monkeypatch):
    """One digit of each of ten figures, but for times, becomes another."""
    for picture in PICTURES:
        monkeypatch.setattr(pictures, f"{picture}_picture", lambda *_: "")
    written = (results_dir() / name).read_bytes()
    assert said_of(tmp_path, name, written) is None
    random = np.random.default_rng(0)
    times = [m.span() for m in re.finditer(TIMED, written)]
    digits = [
        m.start()
        for m in re.finditer(rb"(?<=[0-9.])[0-9]", written)
        if not any(first <= m.start() < last for first, last in times)
    ]
    for place in random.choice(digits, 10, replace=False):
        other = b"1" if written[place : place + 1] != b"1" else b"7"
        damaged = written[:place] + other + written[place + 1 :]
        if json.loads(damaged) == json.loads(written):
            continue  # the seventeenth digit of the same number
        said = said_of(tmp_path, name, damaged) or "nothing"
        assert "its figures are not those that were written" in said


def test_times_may_differ_between_runs_with_one_seed():
    """By hand: the hash of two files that differ in how fast the machine was."""
    fast = {"labels": {"dog-trot": {"fid": 1.5}}, "real_time_factor": 9.0}
    slow = {**fast, "real_time_factor": 4.0}
    assert figures_sha256(fast) == figures_sha256(slow)
    assert figures_sha256(fast) != figures_sha256({**fast, "fid": 2.0})
