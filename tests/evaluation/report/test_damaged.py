"""Whatever is wrong in a file of results is said in one sentence."""

import json

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.evaluation.report.page import drawings, tables
from loco_drake.evaluation.report.results import load_results, results_dir
from loco_drake.evaluation.report.scoreboard import scoreboard

SHIPPED = sorted(path.name for path in results_dir().glob("*.json"))
WRONG = ("a word", [], {}, 3, None, True, float("nan"), [[1.0]])


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


def check(folder, name, content, make):
    """Makes ``make`` of the content; returns whether that was refused."""
    (folder / name).write_text(json.dumps(content))
    said = None
    try:
        results = load_results(folder)
        scoreboard(results)
        make(results)
    except InputError as error:
        said = str(error)
    assert said is None or (name in said and "\n" not in said)
    return said is not None


@pytest.mark.parametrize("name", SHIPPED)
def test_any_value_that_is_wrong(name, tmp_path):
    """Each of 40 values is replaced by all wrong ones, or is missing."""
    content = json.loads((results_dir() / name).read_text())
    random = np.random.default_rng(0)
    found = list(places(content))
    refused = 0
    for index in random.choice(len(found), 40, replace=False):
        parent, key = found[index]
        kept = parent[key]
        for wrong in WRONG:
            parent[key] = wrong
            refused += check(tmp_path, name, content, tables)
        parent[key] = kept
    for key in list(content):
        without = {k: v for k, v in content.items() if k != key}
        refused += check(tmp_path, name, without, tables)
    assert refused > 0
    assert not check(tmp_path, name, content, tables)


@pytest.mark.parametrize(
    ("name", "path"),
    [
        ("learning-go2.json", ("learning", "return", "dog-trot")),
        ("learning-go2.json", ("learning", "steps")),
        ("learning-go2.json", ("learning", "return")),
        ("tracking-go2-generated.json", ("labels", "dog-trot")),
        ("generation.json", ("robots", "go2", "confusion", "labels")),
        ("generation.json", ("robots", "go2", "confusion", "transformer")),
        (
            "generation.json",
            ("robots", "go2", "confusion", "transformer", "real_to_real"),
        ),
    ],
)
@pytest.mark.parametrize("wrong", ["a word", [1.0, "x"], {"a": []}])
def test_what_pictures_are_made_of(name, path, wrong, tmp_path):
    content = json.loads((results_dir() / name).read_text())
    parent = content
    for key in path[:-1]:
        parent = parent[key]
    parent[path[-1]] = wrong
    assert check(tmp_path, name, content, drawings)
