import json

import pytest
import tyro

from loco_drake.cli.evaluate_retargeting import EvaluateRetargeting
from loco_drake.common.errors import InputError
from tests.robot_files import SOLO8
from tests.synthetic import write_dog_recording, write_lying_dog

KEYS = {
    "stance_slip_median_mps",
    "penetration_max_m",
    "joint_limit_violations",
    "joint_speed_ratio_max",
    "toe_error_rmse_m",
    "correction_rmse_m",
    "stride_period_error",
    "phase_lag_error",
    "duty_factor_error",
    "clips",
}


def command(*arguments):
    return tyro.cli(EvaluateRetargeting, args=[str(a) for a in arguments])


def test_both_robots_with_a_bad_clip(made_data, tmp_path, capsys):
    """A stretch beyond the end of its file fails; the others are counted."""
    table = (made_data / "segments.csv").read_text()
    (tmp_path / "dog_mann").symlink_to(made_data / "dog_mann")
    extra = "dog_mann,keypoints/made_pace.txt,pace,0,9999,60,1,\n"
    turn = "dog_mann,keypoints/made_pace.txt,turn_left,0,200,60,1,\n"
    (tmp_path / "segments.csv").write_text(table + extra + turn)
    options = ("--data-dir", tmp_path, "--robot", "all", "--seeds", 1)
    labels = ("--labels", "dog-pace", "dog-turn_left")
    file = tmp_path / "a.json"
    assert command(*options, *labels, "--json", file).run() == 1
    printed = capsys.readouterr()
    assert printed.err.count("Failed: dog-pace-made_pace-0-9999: ") == 2
    assert printed.err.count("recording of dog: frames 0 to 9999") == 2
    assert printed.out.count("dog-pace") == 2
    robots = json.loads(file.read_text())["robots"]
    assert set(robots) == {"go2", "a1"}
    for result in robots.values():
        assert set(result["labels"]) == {"dog-pace"}
        assert set(result["other"]) == {"dog-turn_left"}
        assert result["frames_per_second"] > 0
        assert "dog-pace-made_pace-0-9999" in result["failed"]
        for figures in (result["labels"]["dog-pace"], result["all"]):
            assert set(figures) >= KEYS
            assert figures["clips"] == 1
            assert all(isinstance(figures[key], int | float) for key in KEYS)


def test_rhythm_of_a_mirrored_motion_in_its_own_time_is_compared_with_its_clip(
    made_data, tmp_path
):
    """A gallop is not its own mirror image, and .6 times as long is 40 % off."""
    options = ("--data-dir", made_data, "--labels", "dog-gallop")
    both = ("--mirror", "--froude", "--json", tmp_path / "a.json")
    assert command(*options, *both).run() == 0
    result = json.loads((tmp_path / "a.json").read_text())
    assert (result["mirror"], result["froude"]) == (True, True)
    figures = result["robots"]["go2"]["labels"]["dog-gallop"]
    assert figures["stride_period_error"] < 0.01
    assert figures["phase_lag_error"] < 0.02


def test_robot_that_is_only_a_file(made_data, tmp_path):
    options = ("--data-dir", made_data, "--labels", "dog-trot", "--robot", SOLO8)
    assert command(*options, "--json", tmp_path / "a.json").run() == 0
    robots = json.loads((tmp_path / "a.json").read_text())["robots"]
    figures = robots["solo8"]["labels"]["dog-trot"]
    assert figures["joint_limit_violations"] == 0
    assert figures["stance_slip_median_mps"] < 0.03
    assert figures["stride_period_error"] < 0.01


def test_wrong_input_raises_one_sentence(made_data, tmp_path):
    data = ("--data-dir", made_data)
    wrong = {
        ("--robot", "spot", *data): "'spot'; the choices are go2, a1, all",
        ("--labels", "dog-fly", *data): "'dog-fly'; the choices are dog-pace, dog-trot",
        ("--seeds", 0, *data): "--seeds must be 1 or more",
        ("--workers", 0, *data): "--workers must be 1 or more",
        ("--data-dir", tmp_path / "no"): "There is no data folder",
    }
    for arguments, reason in wrong.items():
        with pytest.raises(InputError, match=reason):
            command(*arguments).run()


def test_clips_outside_their_bounds_are_marked_and_strict_fails(
    made_data, tmp_path, capsys
):
    """A dog that lies for a while, beside one that only paces."""
    folder = tmp_path / "dog_mann" / "keypoints"
    folder.mkdir(parents=True)
    write_dog_recording(folder / "good.txt", "pace")
    write_lying_dog(folder / "bad.txt", "pace")
    head = (made_data / "segments.csv").read_text().splitlines()[0]
    stretches = [
        f"dog_mann,keypoints/{name}.txt,pace,0,240,60,1," for name in ("good", "bad")
    ]
    (tmp_path / "segments.csv").write_text("\n".join([head, *stretches, ""]))
    options = ("--data-dir", tmp_path, "--json", tmp_path / "a.json")
    for strict, status in (((), 0), (("--strict",), 1)):
        assert command(*options, *strict).run() == status
        printed = capsys.readouterr()
        assert "dog-pace (!)" in printed.out
        bad = "dog-pace-bad-0-240"
        assert printed.err.count(f"Warning: {bad}: frames on its feet") == 1
        assert "good" not in printed.err
        result = json.loads((tmp_path / "a.json").read_text())["robots"]["go2"]
        assert list(result["warnings"]) == [bad]
        assert result["labels"]["dog-pace"]["clips_outside_bounds"] == 1


def test_figures_of_grounding_are_those_of_grounded_motion_only(made_data, tmp_path):
    options = ("--data-dir", made_data, "--labels", "dog-trot")
    assert command(*options, "--json", tmp_path / "a.json").run() == 0
    assert command(*options, "--ground", "--json", tmp_path / "b.json").run() == 0
    plain, grounded = (
        json.loads((tmp_path / name).read_text()) for name in ("a.json", "b.json")
    )
    assert (plain["ground"], grounded["ground"]) == (False, True)
    before = plain["robots"]["go2"]["labels"]["dog-trot"]
    after = grounded["robots"]["go2"]["labels"]["dog-trot"]
    assert "momentum_error" not in before
    assert after["momentum_error"] < 0.2 * after["momentum_error_before"]
    # Rhythm, slip and limits are those of the motion as it was.
    for key in ("stride_period_error", "phase_lag_error", "duty_factor_error"):
        assert after[key] == pytest.approx(before[key], abs=2e-3)
    assert after["stance_slip_median_mps"] < 1e-3
    assert after["joint_limit_violations"] == 0
    with pytest.raises(InputError, match="three joints in each leg"):
        command(*options, "--robot", SOLO8, "--ground").run()
