"""From recordings to figures by the commands, with networks made in a moment."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from loco_drake.cli.evaluate_generation import EvaluateGeneration
from loco_drake.cli.evaluate_tokenizer import EvaluateTokenizer
from loco_drake.cli.train_classifier import TrainClassifier
from loco_drake.common.errors import InputError
from loco_drake.common.weights import save_network
from loco_drake.evaluation.classifier import load_classifier
from loco_drake.evaluation.recorded import retarget_recordings
from loco_drake.generation.tokenizer import Tokenizer, TokenizerConfig
from loco_drake.models.robots import get_robot
from loco_drake.motion.motion_file import save_motion
from tests.robot_files import OWN
from tests.synthetic import write_dog_recording
from tests.synthetic_motion import synthetic_motion
from tests.tiny_model import make_tiny_model
from tests.varied_motion import as_generated, shaken

pytestmark = pytest.mark.slow

GO2 = get_robot("go2")
CHEAP = {"count": 4, "generator_seeds": 2, "minutes": 0, "seeds": 1, "steps": 10}
LABEL_KEYS = {
    "stance_slip_median_mps",
    "penetration_max_m",
    "jerk_ratio",
    "speed_error_mps",
}
KEYS = {
    "classifiers",
    "two_sample_accuracy",
    "fid",
    "fid_real_real",
    "nearest_training_rad",
    "drift_60s",
    "transfer_joint_rmse_rad",
    "labels",
    "all",
    "other",
    "real_time_factor",
}
ROWS = {"real_to_real", "real_to_generated", "generated_to_real"}


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Four recordings of a pace and four of a trot, no two alike, 2.5 s each."""
    folder = tmp_path_factory.mktemp("recordings")
    rows = ["dataset,file,gait,start_frame,end_frame,fps"]
    for gait in ("pace", "trot"):
        for number in range(4):
            file = f"keypoints/{gait}{number}.txt"
            path = folder / "dog_mann" / file
            write_dog_recording(path, gait, 3.0, heading=0.3 * number)
            start = 5 * number
            rows.append(f"dog_mann,{file},{gait},{start},{start + 150},60")
    (folder / "segments.csv").write_text("\n".join(rows) + "\n")
    return folder


@pytest.fixture(scope="module")
def recorded(recordings):
    return retarget_recordings(recordings, GO2)


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    return save_weights(tmp_path_factory.mktemp("weights"), make_tiny_model())


def save_weights(folder, model):
    """Returns options that name untrained networks of a tokenizer and a generator."""
    paths = {
        name: folder / f"{name}.safetensors" for name in ("tokenizer", "generator")
    }
    save_network(paths["tokenizer"], "tokenizer", model.tokenizer, half=True)
    save_network(paths["generator"], "generator", model.generator, half=True)
    return paths


def evaluate(tmp_path, **options):
    file = tmp_path / "figures.json"
    assert EvaluateGeneration(**{**CHEAP, "json": file, **options}).run() == 0
    return json.loads(file.read_text())


def test_a_bad_model_gets_bad_figures(recordings, weights, tmp_path, capsys):
    result = evaluate(
        tmp_path, data_dir=recordings, figures=tmp_path, seeds=2, **weights
    )
    assert set(result) >= KEYS
    for rows in result["classifiers"].values():
        assert set(rows) >= ROWS
        for row in ROWS:
            assert set(rows[row]) == {"all", "dog"}
            for estimate in rows[row].values():
                assert 0 <= estimate["low"] <= estimate["mean"] <= estimate["high"] <= 1
    # Networks that were never trained write wild motion.
    assert result["two_sample_accuracy"]["mean"] > 0.95
    assert result["fid"] > 0
    assert (
        result["nearest_training_rad"] > 2 * result["nearest_training_rad_validation"]
    )
    assert result["real_time_factor"] > 0
    assert result["validation_trained_on"] == {"tokenizer": None, "generator": None}
    assert result["drift_60s"] is None
    assert set(result["labels"]) == set(result["confusion"]["labels"]) | {
        name for name, figures in result["labels"].items() if "reason" in figures
    }
    assert len(result["labels"]) == 15
    for label in ("dog-pace", "dog-trot"):
        assert set(result["labels"][label]) >= LABEL_KEYS
        assert result["labels"][label]["jerk_ratio"] > 2
    missing = result["labels"]["horse-walk"]
    assert missing["jerk_ratio"] is None
    assert "not trained" in missing["reason"]
    assert result["transfer_joint_rmse_rad"] is None
    assert "only go2" in result["reason"]["transfer_joint_rmse_rad"]
    pictures = {path.name for path in tmp_path.glob("*.png")}
    assert pictures == {
        "go2-confusion-transformer.png",
        "go2-confusion-linear.png",
        "go2-motion.png",
    }
    printed = capsys.readouterr().out
    assert "Linear classifier on summaries" in printed
    assert "horse-walk" in printed


def test_recordings_scored_as_if_generated_get_good_figures(
    recordings, recorded, tmp_path
):
    """Those of training are no news, and like themselves."""
    folder = tmp_path / "motions" / "deep"
    for number, motion in enumerate(recorded.train):
        save_motion(as_generated(motion), folder / f"{number}.npz")
    options = {"data_dir": recordings}
    result = evaluate(tmp_path, motions=tmp_path / "motions", **options)
    linear = result["classifiers"]["linear"]
    for row in ROWS:
        assert linear[row]["all"]["mean"] == pytest.approx(1.0)
    assert linear["diversity_over_real"] == pytest.approx(1.0)
    assert result["fid"] == pytest.approx(0.0, abs=1e-3)
    assert result["nearest_training_rad"] == pytest.approx(0.0, abs=1e-5)
    assert result["nearest_training_rad_leave_one_out"] > 1e-5
    assert result["two_sample_accuracy"]["mean"] < 0.7
    for figures in (*result["labels"].values(), result["all"]):
        assert figures["jerk_ratio"] == pytest.approx(1.0, abs=0.1)
        assert figures["speed_error_mps"] < 0.02
    for name in ("real_time_factor", "transfer_joint_rmse_rad", "drift_60s"):
        assert result[name] is None
        assert result["reason"][name]
    # A degree of noise shows.
    for number, motion in enumerate(recorded.train):
        save_motion(as_generated(shaken(motion, 0.017)), folder / f"{number}.npz")
    noisy = evaluate(tmp_path, motions=tmp_path / "motions", **options)
    assert noisy["two_sample_accuracy"]["mean"] > 0.9
    assert noisy["all"]["jerk_ratio"] > 2
    assert noisy["nearest_training_rad"] == pytest.approx(0.017, rel=0.2)


def test_other_labels_and_motions_of_a_minute(recordings, recorded, tmp_path, capsys):
    """Labels beyond the fifteen are scored apart; long motions tell the drift."""
    motions = [as_generated(motion) for motion in recorded.train]
    motions += [replace(motions[0], gait=gait) for gait in ("turn_left", "jump")]
    motions += [synthetic_motion("dog-pace", 60.0, speed) for speed in (0.8, 0.82)]
    for number, motion in enumerate(motions):
        save_motion(motion, tmp_path / "motions" / f"{number}.npz")
    result = evaluate(
        tmp_path, motions=tmp_path / "motions", data_dir=recordings, steps=1
    )
    assert set(result["labels"]) == {"dog-pace", "dog-trot"}
    assert set(result["other"]) == {"dog-turn_left", "dog-jump"}
    (line,) = [k for k in capsys.readouterr().err.splitlines() if "left out" in k]
    assert line.startswith("go2: Motions of dog-jump, dog-turn_left are left out")
    assert result["other"]["dog-turn_left"]["jerk_ratio"] is None
    assert set(result["drift"]["labels"]) == {"dog-pace"}
    assert result["drift_60s"] == result["drift"]["worst"]["drift"] < 1


def test_the_same_seed_gives_the_same_figures(recordings, tmp_path):
    """Of a tokenizer that knows both robots, so that it can be asked to translate."""
    weights = save_weights(tmp_path, make_tiny_model(("go2", "a1")))
    options = {"data_dir": recordings, "generator_seeds": 1, "seed": 3, **weights}
    first, second = (evaluate(tmp_path, **options) for _ in range(2))
    for result in (first, second):
        del result["real_time_factor"]
    assert first == second
    assert first["transfer_joint_rmse_rad"] > 0.05


def test_a_robot_without_weights_says_so(recordings, weights, tmp_path):
    options = {"data_dir": recordings, "steps": 1, **weights}
    result = evaluate(tmp_path, robot="all", **options)
    assert set(result["robots"]) == {"go2", "a1"}
    assert set(result["robots"]["go2"]) >= KEYS
    assert "not for the robot 'a1'" in result["robots"]["a1"]["reason"]
    assert result["robots"]["a1"]["classifiers"] is None
    with pytest.raises(InputError, match="not for the robot 'a1'"):
        evaluate(tmp_path, robot="a1", **options)
    file = tmp_path / "tokenizer.json"
    tokenizer = EvaluateTokenizer(
        robot="all",
        data_dir=recordings,
        tokenizer=weights["tokenizer"],
        figures=tmp_path,
        json=file,
    )
    assert tokenizer.run() == 0
    robots = json.loads(file.read_text())["robots"]
    assert "for go2" in robots["a1"]["reason"]
    figures = robots["go2"]
    assert 0 < figures["codebook_use"] <= 1
    for scores in (*figures["labels"].values(), figures["all"]):
        assert scores["joint_rmse_rad"] > 0.01
        assert scores["toe_error_rmse_m"] > 0.001
    assert (tmp_path / "go2-codes.png").is_file()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"robot": "spot"}, "Unknown robot 'spot'; the choices are go2, a1, all"),
        ({"labels": ("dog-fly",)}, "Unknown gait 'dog-fly'"),
        ({"labels": ("dog-trot",)}, "two labels at least"),
        ({"seeds": 0}, "--seeds must be 1 or more, not 0"),
        ({"generator_seeds": 0}, "--generator-seeds"),
        ({"minutes": -1}, "--minutes must be 0 or more"),
        ({"seed": -1}, "--seed"),
    ],
)
def test_bad_options_are_refused(options, message, recordings, weights, tmp_path):
    command = EvaluateGeneration(
        **{"data_dir": recordings, "json": tmp_path / "a.json", **weights, **options}
    )
    with pytest.raises(InputError, match=message):
        command.run()
    assert not (tmp_path / "a.json").exists()


def test_motions_that_cannot_be_scored(recordings, recorded, tmp_path):
    options = {"data_dir": recordings, "motions": tmp_path / "motions"}
    with pytest.raises(InputError, match="no folder of Motion files"):
        EvaluateGeneration(**options).run()
    path = tmp_path / "motions" / "a.npz"
    motion = recorded.train[0]
    names = ("base_velocity", "base_angular_velocity", "joint_velocities")
    faster = {name: 1.2 * getattr(motion, name) for name in names}
    save_motion(replace(motion, fps=60.0, **faster), path)
    with pytest.raises(InputError, match="must be at 50 frames/s"):
        EvaluateGeneration(**options).run()
    save_motion(recorded.train[0].slice(0, 60), path)
    with pytest.raises(InputError, match="2 s long"):
        EvaluateGeneration(**options).run()


def test_training_a_classifier(recorded, tmp_path):
    for number, motion in enumerate((*recorded.train, *recorded.validation)):
        save_motion(motion, tmp_path / "motions" / f"{number}.npz")
    command = TrainClassifier(
        motions=tmp_path / "motions",
        out=tmp_path / "run",
        steps=40,
        json=tmp_path / "a.json",
    )
    assert command.run() == 0
    figures = json.loads((tmp_path / "a.json").read_text())
    assert figures["steps"] == 40
    assert figures["wall_clock_s"] > 0
    assert figures["validation_accuracy"]["mean"] == 1.0
    path = tmp_path / "run" / "classifier.safetensors"
    assert load_classifier(path).config.labels == ("dog-pace", "dog-trot")
    # A finished run has nothing left to do, and gives the same network.
    before = path.read_bytes()
    command.resume = True
    assert command.run() == 0
    assert path.read_bytes() == before
    command.steps = 0
    with pytest.raises(InputError, match="--steps"):
        command.run()
    command.steps, command.motions = 1, tmp_path / "none"
    with pytest.raises(InputError, match="Motion files"):
        command.run()


def test_books_of_the_tokenizer_evaluation(recordings, weights):
    command = EvaluateTokenizer(
        data_dir=recordings, tokenizer=weights["tokenizer"], books=3
    )
    with pytest.raises(InputError, match="--books must be from 1 to 2"):
        command.run()


def test_a_robot_that_was_added_is_told_how_the_go2s_tokens_fit(
    recordings, tmp_path, capsys
):
    """Go2's tokens are decoded for it, and compared with its own motion."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        config = TokenizerConfig(robots=("go2", "b1"), added=("b1",), bodies=("b1",))
        tokenizer = Tokenizer(config)
    path, file = tmp_path / "tokenizer.safetensors", tmp_path / "a.json"
    save_network(path, "tokenizer", tokenizer)
    options = {"data_dir": recordings, "tokenizer": path, "json": file}
    assert EvaluateTokenizer(robot=str(OWN["b1"]), **options).run() == 0
    figures = json.loads(file.read_text())
    assert figures["transfer_joint_rmse_rad"] > 0.1
    assert "The Go2's tokens, decoded for b1" in capsys.readouterr().out
    assert EvaluateTokenizer(robot="go2", **options).run() == 0
    assert "transfer_joint_rmse_rad" not in json.loads(file.read_text())


def test_both_sides_of_the_split_are_there(recorded):
    assert recorded.labels == ("dog-pace", "dog-trot")
    subjects = [
        {motion.provenance["recording"] for motion in side}
        for side in (recorded.train, recorded.validation)
    ]
    assert not subjects[0] & subjects[1]
    assert np.isclose(len(subjects[1]) / 8, 0.3, atol=0.1)
