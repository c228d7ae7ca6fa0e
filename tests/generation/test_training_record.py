from dataclasses import replace

import pytest

from loco_drake.cli.evaluation import trained_on
from loco_drake.cli.train_generator import TrainGenerator
from loco_drake.cli.train_tokenizer import TrainTokenizer
from loco_drake.common.weights import save_network
from loco_drake.evaluation.recorded import by_split
from loco_drake.generation.generate import generate_motions
from loco_drake.generation.motion_model import load_motion_model
from loco_drake.generation.tokenizer import load_tokenizer
from loco_drake.generation.training_motions import (
    read_training_record,
    seen_in_training,
)
from loco_drake.motion.gaits import parse_label
from loco_drake.motion.motion_file import load_motion, save_motion
from tests.synthetic_motion import synthetic_motion

# Those for training of the folder `motions`: two stretches of 3 s, 151 frames, each.
TRAINED = {f"dog-dog-{gait}0": {"go2": 6.04} for gait in ("pace", "trot")}


@pytest.fixture(scope="module")
def weights(motions, tmp_path_factory):
    """The paths of a tokenizer and a generator of two steps each."""
    folder = tmp_path_factory.mktemp("weights")
    TrainTokenizer(motions=(motions,), out=folder, steps=2, seed=5).run()
    tokenizer = folder / "tokenizer.safetensors"
    out = folder / "generator"
    options = {"out": out, "tokenizer": tokenizer, "stitched": 1, "steps": 1}
    TrainGenerator(motions=(motions,), **options).run()
    return {"tokenizer": tokenizer, "generator": out / "generator.safetensors"}


def test_weights_say_what_they_were_trained_on(weights):
    record = read_training_record(weights["tokenizer"], "tokenizer")
    assert record["robots"] == ["go2"]
    assert record["recordings"] == TRAINED
    assert record["held_out"] == ["dog-dog-pace1", "dog-dog-trot1"]
    assert (record["steps"], record["seed"]) == (2, 5)
    assert record["grounded"] is False
    assert record["learning_rate"] == 2e-3
    assert not {"out", "resume"} & set(record)
    record = read_training_record(weights["generator"], "generator")
    assert record["recordings"] == TRAINED
    assert (record["steps"], record["stitched"]) == (1, 1)


def test_a_generator_of_grounded_motion_says_so(weights, motions, tmp_path):
    """If all motion to train on was made to obey physics; its own motion does, too."""
    for path in sorted(motions.glob("*.npz")):
        motion = load_motion(path)
        provenance = {**motion.provenance, "momentum_error": "0.01"}
        save_motion(replace(motion, provenance=provenance), tmp_path / path.name)
    out = tmp_path / "generator"
    options = {"out": out, "tokenizer": weights["tokenizer"], "stitched": 1, "steps": 1}
    TrainGenerator(motions=(tmp_path,), **options).run()
    path = out / "generator.safetensors"
    record = read_training_record(path, "generator")
    assert record["grounded"] is True
    for generator, grounded in ((path, True), (weights["generator"], False)):
        model = load_motion_model(weights["tokenizer"], generator, "go2")
        assert model.grounded is grounded
        (motion,) = generate_motions(model, parse_label("dog-trot"), 0.1, [0])
        assert motion.grounded is grounded


def test_recordings_seen_in_training_are_named(weights, motions):
    record = read_training_record(weights["tokenizer"], "tokenizer")
    loaded = [load_motion(path) for path in sorted(motions.glob("*.npz"))]
    assert seen_in_training(record, loaded) == sorted(TRAINED)
    held = [m for m in loaded if m.provenance["split"] == "validation"]
    assert seen_in_training(record, held) == []
    assert seen_in_training(None, loaded) is None


def test_weights_without_a_record_load_and_say_so(weights, tmp_path):
    old = tmp_path / "old.safetensors"
    save_network(
        old,
        "tokenizer",
        load_tokenizer(weights["tokenizer"]),
        {"labels": []},
        half=True,
    )
    assert load_tokenizer(old).config == load_tokenizer(weights["tokenizer"]).config
    assert read_training_record(old, "tokenizer") is None


@pytest.mark.parametrize(
    ("learned", "seen", "said"),
    [
        (["dog-a", "dog-b"], ["dog-b"], "on recordings of validation: dog-b."),
        (["dog-a"], [], ""),
        (None, None, "is not recorded in"),
    ],
)
def test_evaluations_warn_of_recordings_that_were_learned_from(
    learned, seen, said, weights, tmp_path, capsys
):
    recorded = by_split(
        [
            synthetic_motion("dog-trot", 1.0, recording=name, split=side)
            for name, side in (("a", "train"), ("b", "validation"))
        ]
    )
    info = {}
    if learned is not None:
        info = {"training": {"recordings": {name: {} for name in learned}}}
    path = tmp_path / "tokenizer.safetensors"
    save_network(
        path, "tokenizer", load_tokenizer(weights["tokenizer"]), info, half=True
    )
    assert trained_on({"tokenizer": path}, recorded, "go2") == {"tokenizer": seen}
    error = capsys.readouterr().err
    assert said in error
    assert bool(error) == bool(said)
