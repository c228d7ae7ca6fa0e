"""Tables: numbers as text, columns, and why an entry is missing."""

from pathlib import Path

import pytest

from loco_drake.common.errors import InputError
from loco_drake.evaluation.report.content import Column
from loco_drake.evaluation.report.figures import Figures
from loco_drake.evaluation.report.sections import (
    generation_table,
    steering_range_table,
    steering_table,
)
from loco_drake.evaluation.report.tables import label_table, number
from tests.report_results import steering


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.98765, 3, "0.988"),
        (0.0, 3, "0"),
        (4e-15, 2, "< 0.01"),
        (1059.4, 0, "1059"),
        (12345.6, 0, "12,346"),
        (-0.5, 1, "-0.5"),
    ],
)
def test_numbers(value, digits, text):
    assert number(value, digits) == text


def test_labels_in_order_and_all_last_with_reasons():
    figures = {
        "labels": {
            "solo8-wave": {"slip": 0.0034, "reason": "unused"},
            "dog-trot": {"slip": None, "reason": "no toe ever stands"},
            "dog-spin": {"slip": 1.0},
        },
        "all": {"slip": 0.0056},
    }
    columns = [Column("slip, mm/s", "slip", 1000, 1)]
    table = label_table("title", columns, Figures(figures, Path("f.json")))
    assert [row.title for row in table.rows] == ["dog-trot", "solo8-wave", "all"]
    assert [row.cells[0].text for row in table.rows] == ["–", "3.4", "5.6"]
    assert table.reasons == ["dog-trot: no toe ever stands"]


def test_an_entry_of_a_list_is_a_column():
    columns = [Column("from", "range.x[0]", 1, 2), Column("to", "range.x[1]", 1, 2)]
    figures = {"labels": {"dog-trot": {"range": {"x": [-0.5, 2.25]}}}, "all": {}}
    table = label_table("title", columns, Figures(figures, Path("f.json")))
    assert [[c.text for c in row.cells] for row in table.rows] == [
        ["-0.50", "2.25"],
        ["–", "–"],
    ]
    figures["labels"]["dog-trot"]["range"]["x"] = [1.0]
    with pytest.raises(InputError, match="damaged: x has no entry 1"):
        label_table("title", columns, Figures(figures, Path("f.json")))


def test_ranges_and_drives_of_steering():
    """Of results made by hand: two gaits, two drives each."""
    figures = Figures(steering(), Path("f.json"))
    ranges = steering_range_table("go2", figures)
    assert [cell.text for cell in ranges.rows[0].cells[:6]] == [
        "-0.50", "2.00", "-0.30", "0.30", "-1.00", "0.90"
    ]  # fmt: skip
    table = steering_table("go2", figures)
    assert table.note == "Drives of each gait: 2."
    cells = dict(zip(table.columns, table.rows[1].cells, strict=True))
    assert table.rows[1].title == "mpc-trot"
    assert cells["velocity, m/s RMS"].text == "0.100"
    assert cells["falls in drives, %"].text == "3"
    assert (cells["steps"].text, cells["covered"].text) == ("8", "7")


def test_what_drifts_most_is_named_without_its_unit():
    drifts = {"turn_rate_radps": {"drift": 1.5}, "stance_slip_median_mps": {"drift": 1}}
    figures = {
        "labels": {"dog-trot": {}, "dog-pace": {}},
        "all": {},
        "drift_60s": 1.5,
        "drift": {"labels": {"dog-trot": drifts}},
    }
    table = generation_table("go2", Figures(figures, Path("f.json")))
    cells = {row.title: row.cells[-1] for row in table.rows}
    assert (cells["dog-trot"].text, cells["dog-trot"].note) == ("1.50", "turn rate")
    assert (cells["all"].text, cells["all"].note) == ("1.50", "")
    assert cells["dog-pace"].text == "–"
