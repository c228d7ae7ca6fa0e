import json

import pytest

from loco_drake.cli.main import main

KEYS = {
    "normalized_return",
    "fall_rate",
    "joint_rmse_rad",
    "base_position_rmse_m",
    "base_orientation_rmse_rad",
    "stance_slip_median_mps",
    "stretch",
}


def test_json_has_the_agreed_shape(tmp_path, capsys):
    path = tmp_path / "figures.json"
    options = ["--labels", "dog-pace", "dog-trot", "--seeds", "2", "--duration", ".4"]
    assert main(["evaluate", "tracking", *options, "--json", str(path)]) == 0
    figures = json.loads(path.read_text())
    assert (figures["robot"], figures["contact"]) == ("go2", "similar")
    assert figures["reference"] == "generated"
    assert list(figures["labels"]) == ["dog-pace", "dog-trot"]
    for row in (*figures["labels"].values(), figures["all"]):
        assert set(row) >= KEYS
    assert figures["all"]["episodes"] == 4
    assert figures["real_time_factor"] > 0
    assert "all of these" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--robot spot", "choices are go2, a1, all"),
        ("--reference dog", "choices are generated, retargeted"),
        ("--labels dog-hop", "Unknown gait 'dog-hop'"),
        ("--seeds 0", "--seeds must be 1 or more"),
        ("--duration nan", "duration must be above 0"),
        ("--contact glue", "choices are similar, lagged, sap, cenic"),
        ("--time-step 0", "time_step must be above 0"),
        ("--workers 0", "--workers must be 1 or more"),
        ("--policy nowhere.safetensors", "nowhere.safetensors"),
        ("--reference retargeted --data-dir nowhere", "no data folder"),
    ],
)
def test_bad_options_are_one_sentence(options, message, capsys):
    assert main(["evaluate", "tracking", *options.split()]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert len(error.splitlines()) == 1
