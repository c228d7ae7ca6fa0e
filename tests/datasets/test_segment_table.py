import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets import segments
from loco_drake.datasets.segments import add_shipped_rows, read_rows, write_rows


def row(file, gait="trot", start=0, **more):
    name, _, path = file.partition("/")
    cells = {"dataset": name, "file": path, "gait": gait, "start_frame": str(start)}
    return {**cells, "end_frame": str(start + 60), "fps": "60", **more}


SHIPPED = [row("d/a"), row("d/b"), row("d/a", "pace", 90), row("e/c")]


@pytest.fixture
def shipped(tmp_path, monkeypatch):
    table = tmp_path / "shipped.csv"
    write_rows(table, SHIPPED)
    monkeypatch.setattr(segments, "SHIPPED", table)


def test_rows_survive_writing_with_the_columns_of_all(tmp_path):
    table = tmp_path / "segments.csv"
    write_rows(table, [row("d/a", notes='"x", y'), row("d/b", mine="1")])
    first, second = read_rows(table)
    assert first == row("d/a", notes='"x", y', mine="")
    assert second == row("d/b", notes="", mine="1")


@pytest.mark.usefixtures("shipped")
def test_only_stretches_of_the_named_files_are_added():
    assert add_shipped_rows([], ["d/a", "d/none"]) == [SHIPPED[0], SHIPPED[2]]


@pytest.mark.usefixtures("shipped")
def test_order_is_the_same_whatever_was_fetched_first():
    at_once = add_shipped_rows([], ["d/a", "d/b", "e/c"])
    in_turn = add_shipped_rows(add_shipped_rows([], ["e/c"]), ["d/b"])
    assert add_shipped_rows(in_turn, ["d/a"]) == at_once


@pytest.mark.usefixtures("shipped")
def test_rows_of_one_s_own_stay():
    """Another cut of a shipped file, and a file that is not shipped."""
    cut, own = row("d/b", "walk", 7), row("mine/z")
    merged = add_shipped_rows([own, cut], ["d/b", "e/c"])
    assert merged == [cut, SHIPPED[3], own]


def test_row_with_more_cells_than_the_header_is_refused(tmp_path):
    table = tmp_path / "segments.csv"
    write_rows(table, [row("d/a")])
    table.write_text(table.read_text().rstrip("\n") + ",1,2\n")
    with pytest.raises(InputError, match="line 2 has more cells than the header"):
        read_rows(table)
