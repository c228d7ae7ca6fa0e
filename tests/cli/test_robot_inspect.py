import json
import re

import numpy as np
import pytest
from PIL import Image

from loco_drake.cli.main import main
from tests.robot_files import OWN, SOLO8
from tests.viewing.pictures import needs_renderer


def test_every_number_is_listed_with_its_source_and_it_stands(tmp_path, capsys):
    path = tmp_path / "figures.json"
    assert main(["robot", "inspect", str(OWN["anymal"]), "--json", str(path)]) == 0
    figures = json.loads(path.read_text())
    assert (figures["robot"], figures["stands"]) == ("anymal", True)
    assert figures["settings"]["effort"] == ["80, 80, 80 N m", "URDF"]
    assert abs(figures["sunk_m"]) < 0.02
    printed = capsys.readouterr().out
    for name in figures["settings"]:
        assert name in printed
    assert "It stands" in printed


@needs_renderer
def test_the_picture_shows_the_robot(tmp_path):
    """Its left legs are yellow and its right ones blue, as those of sticks."""
    path = tmp_path / "b1.png"
    assert main(["robot", "inspect", str(OWN["b1"]), "--picture", str(path)]) == 0
    red, green, blue = np.asarray(Image.open(path)).astype(int)[..., :3].T
    yellow = (red - blue > 60) & (green > 60)
    assert 200 < yellow.sum() < yellow.size / 4
    assert ((blue - red > 30) & (blue > 100)).sum() > 200


def test_motors_that_cannot_hold_the_stance_are_status_1(tmp_path, capsys):
    """Gains of a toy for a robot of 56 kg."""
    text = OWN["b1"].read_text()
    gains = "kp: [15, 15, 15]\n  kd: [1, 1, 1]\n  trunk_size"
    (tmp_path / "weak.yaml").write_text(text.replace("trunk_size", gains))
    assert main(["robot", "inspect", str(tmp_path / "weak.yaml")]) == 1
    assert "It does not stand" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["go2"], "named [*].yaml or [*].yml, not 'go2'"),
        (["no.yaml"], "There is no file '.*no.yaml'; it should be"),
        ([str(SOLO8)], "three joints in each leg"),
        ([str(OWN["b1"]), "--picture", "b1.gif"], "must end in .png"),
    ],
)
def test_wrong_input_is_one_sentence_and_status_2(
    arguments, message, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    assert main(["robot", "inspect", *arguments]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert re.search(message, printed.err)
    assert list(tmp_path.iterdir()) == []
