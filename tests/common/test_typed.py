"""JSON and YAML become values of their fields' types, or the field is named."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import pytest

from loco_drake.common.typed import FieldError, convert


@dataclass
class Part:
    size: int
    share: float = 0.5


@dataclass
class Whole:
    NAME: ClassVar[str] = "whole"

    part: Part = field(default_factory=lambda: Part(1))
    parts: dict[str, Part] = field(default_factory=dict)
    path: Path | None = None
    folders: tuple[Path, ...] = ()
    bounds: tuple[float, float] | None = None
    names: list[str] = field(default_factory=list)
    on: bool = False
    anything: Any = None


def test_every_type_is_converted():
    value = {
        "part": {"size": 3, "share": 1},
        "parts": {"left": {"size": 4}},
        "path": "a/b",
        "folders": ["c", "d"],
        "bounds": [1, 2.5],
        "names": ["x"],
        "on": True,
        "anything": [{"y": None}],
    }
    assert convert(value, Whole) == Whole(
        part=Part(3, 1.0),
        parts={"left": Part(4, 0.5)},
        path=Path("a/b"),
        folders=(Path("c"), Path("d")),
        bounds=(1.0, 2.5),
        names=["x"],
        on=True,
        anything=[{"y": None}],
    )
    assert convert({"path": None, "bounds": None}, Whole) == Whole()


@pytest.mark.parametrize(
    ("value", "named", "message"),
    [
        ([], "it", "it must be a mapping of anything, bounds, folders, names, on, pa"),
        ({"NAME": "x"}, "NAME", "it has the unknown field 'NAME'; there are anything"),
        ({"part": {}}, "part.size", "part lacks size"),
        ({"part": {"size": 1.0}}, "part.size", "part.size must be a whole number, not"),
        ({"part": {"size": True}}, "part.size", "must be a whole number, not True"),
        (
            {"part": {"size": 1, "share": "1"}},
            "part.share",
            "must be a number, not '1'",
        ),
        (
            {"part": {"size": 1, "share": 10**400}},
            "part.share",
            "must be a number, not",
        ),
        ({"parts": {"left": 1}}, "parts.left", "parts.left must be a mapping of share"),
        ({"path": 1}, "path", "path must be text, not 1"),
        ({"folders": "c"}, "folders", "folders must be a list, not 'c'"),
        ({"bounds": [1]}, "bounds", r"bounds must be a list of 2, not \[1\]"),
        ({"names": [1]}, "an item of names", "an item of names must be text, not 1"),
        ({"on": 1}, "on", "on must be true or false, not 1"),
    ],
    ids=str,
)
def test_a_wrong_field_is_named(value, named, message):
    with pytest.raises(FieldError, match=message) as error:
        convert(value, Whole)
    assert error.value.field == named


def test_numbers_may_be_text_on_request():
    """PyYAML reads 1e-3 as text."""
    assert convert("1e-3", float, numeric_text=True) == 0.001
    with pytest.raises(FieldError, match="it must be a number, not 'x'"):
        convert("x", float, numeric_text=True)
