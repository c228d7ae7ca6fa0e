"""Folders of results: what is read, what is missing, what is refused."""

import pytest

from loco_drake.common.errors import InputError
from loco_drake.evaluation.report.goals import scoreboard
from loco_drake.evaluation.report.results import EXPECTED, RETARGETED, load_results
from tests.report_results import (
    learning,
    retargeting,
    tokenizer,
    tracking,
    write_results,
)


def test_files_of_one_robot_or_of_both_are_read(tmp_path):
    write_results(
        tmp_path,
        tokenizer={"robot": "a1", **tokenizer()},
        retargeting={"robots": {"go2": retargeting(), "a1": retargeting()}},
        tracking_a1_cenic=tracking("a1"),
    )
    results = load_results(tmp_path)
    assert results.of("tokenizer", "go2") is None
    assert results.of("tokenizer", "a1").number("codebook_use") == 0.93
    assert results.of("retargeting", "a1") is not None
    assert results.of("tracking-cenic", "a1") is not None
    assert results.of("tracking-cenic", "go2") is None
    assert list(results.absent) == [("tokenizer.json", "go2")]
    there = {"tokenizer.json", "retargeting.json", "tracking-a1-cenic.json"}
    every = {file.path for file in (*EXPECTED, RETARGETED)}
    assert {file.path for file in results.missing} == every - there


def test_a_robot_that_could_not_be_evaluated_is_absent_for_its_reason(tmp_path):
    nulls = {**dict.fromkeys(tokenizer()), "reason": "It has no weights."}
    robots = {"go2": tokenizer(), "a1": nulls}
    write_results(tmp_path, tokenizer={"robots": robots})
    results = load_results(tmp_path)
    assert results.absent == {("tokenizer.json", "a1"): "It has no weights."}
    assert results.of("tokenizer", "a1") is None


def test_results_of_another_robot_are_not_taken_for_those_of_the_file(tmp_path):
    write_results(tmp_path, tracking_a1_generated=tracking("go2"))
    results = load_results(tmp_path)
    assert results.of("tracking-generated", "a1") is None
    assert results.of("tracking-generated", "go2") is None
    assert ("tracking-a1-generated.json", "a1") in results.absent


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "it is not JSON"),
        ("[1, 2]", r"it is not JSON \(not an object\)"),
        ('{"robot": "spot"}', "it says of no robot; the choices are go2, a1"),
        ('{"robots": {"go2": 3}}', "it has no robots.go2|it has no go2"),
        ('{"robots": {"go2": {"labels": {}}}}', "it has no all"),
        (
            '{"robots": {"go2": {"labels": {}, "all": {"joint_rmse_rad": "low"}}}}',
            "joint_rmse_rad is 'low', not a number",
        ),
        (
            '{"robots": {"go2": {"labels": {}, "all": {"joint_rmse_rad": NaN}}}}',
            "it is not JSON",
        ),
        (
            '{"robots": {"go2": {"labels": {}, "all": {}}}}',
            "it has no joint_rmse_rad",
        ),
    ],
)
def test_a_damaged_file_is_named(tmp_path, content, message):
    (tmp_path / "tokenizer.json").write_text(content)
    with pytest.raises(InputError, match=f"tokenizer.json is damaged: ({message})"):
        scoreboard(load_results(tmp_path))


def test_a_list_with_something_else_in_it_is_damaged(tmp_path):
    content = learning()
    content["learning"]["seconds"][1] = "soon"
    write_results(tmp_path, learning_go2=content)
    with pytest.raises(InputError, match=r"learning-go2.json is damaged: 1 is 'soon'"):
        scoreboard(load_results(tmp_path))
