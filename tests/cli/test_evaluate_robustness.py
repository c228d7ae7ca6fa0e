import json

import pytest

from loco_drake.cli.main import main


def test_json_has_the_agreed_shape_and_the_curves_are_drawn(tmp_path, capsys):
    path = tmp_path / "figures.json"
    line = "evaluate robustness --labels horse-walk --kinds friction --seeds 1"
    assert main([*line.split(), "--json", str(path), "--figures", str(tmp_path)]) == 0
    figures = json.loads(path.read_text())
    assert figures["robot"] == "go2"
    for row in (figures["labels"]["horse-walk"], figures["all"]):
        assert row["impulse_80_percent_ns"] is row["recovery_s"] is None
        assert row["curves"]["friction"]["levels"] == [0.8, 0.5, 0.3, 0.2]
        assert len(row["curves"]["friction"]["success"]) == 4
        assert row["success"]["undisturbed"] == 1.0
        assert row["episodes"] == 4
    assert (tmp_path / "go2-robustness.png").stat().st_size > 5000
    printed = capsys.readouterr().out
    assert "horse-walk" in printed
    assert "0.8: 100" in printed


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--kinds wind", "choices are push, slope, step, friction, payload, latency"),
        ("--robot spot", "choices are go2, a1, all"),
        ("--labels dog-hop", "Unknown gait 'dog-hop'"),
        ("--seeds 0", "--seeds must be 1 or more"),
        ("--policy nowhere.safetensors", "nowhere.safetensors"),
        ("--workers 0", "--workers must be 1 or more"),
    ],
)
def test_bad_options_are_one_sentence(options, message, capsys):
    assert main(["evaluate", "robustness", *options.split()]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert len(error.splitlines()) == 1
