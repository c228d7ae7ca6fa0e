import json
from pathlib import Path

import pytest

from loco_drake.cli.generate import Generate
from loco_drake.cli.train_generator import TrainGenerator
from loco_drake.cli.train_tokenizer import TrainTokenizer
from loco_drake.common.errors import InputError
from loco_drake.motion.motion_file import load_motion

pytestmark = pytest.mark.slow


def test_from_motions_to_new_motions_by_three_commands(motions, tmp_path):
    train = TrainTokenizer(
        motions=(motions,),
        out=tmp_path / "tokenizer",
        steps=3,
        json=tmp_path / "tokenizer.json",
    )
    assert train.run() == 0
    figures = json.loads((tmp_path / "tokenizer.json").read_text())
    assert figures["steps"] == 3
    assert figures["wall_clock_s"] > 0
    assert set(figures["held_out"]) == {"joint_rmse_rad", "toe_error_rmse_m"}
    assert 0 < figures["codebook_use"] <= 1
    tokenizer = tmp_path / "tokenizer" / "tokenizer.safetensors"
    learn = TrainGenerator(
        motions=(motions,),
        tokenizer=tokenizer,
        out=tmp_path / "generator",
        books=2,
        stitched=1,
        steps=2,
        json=tmp_path / "generator.json",
    )
    assert learn.run() == 0
    assert json.loads((tmp_path / "generator.json").read_text())["steps"] == 2
    learn.books, learn.out = 13, tmp_path / "another"
    with pytest.raises(InputError, match="--books must be from 1 to 12"):
        learn.run()
    generate = Generate(
        gait="dog-trot",
        duration=1.0,
        out=tmp_path / "new",
        tokenizer=tokenizer,
        generator=tmp_path / "generator" / "generator.safetensors",
    )
    assert generate.run() == 0
    assert len(load_motion(tmp_path / "new" / "dog-trot-0.npz")) == 51
    # A tokenizer that was trained anew does not fit the generator of the old one.
    TrainTokenizer(motions=(motions,), out=tmp_path / "other", steps=1).run()
    generate.tokenizer = tmp_path / "other" / "tokenizer.safetensors"
    with pytest.raises(InputError, match="train the generator again"):
        generate.run()
    # One whose decoder was fine-tuned does.
    tuned = tmp_path / "tuned"
    TrainTokenizer(
        motions=(motions,), fine_tune=tokenizer, books=2, out=tuned, steps=1
    ).run()
    generate.tokenizer, generate.out = tuned / "tokenizer.safetensors", tmp_path / "fit"
    assert generate.run() == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"steps": 0}, "--steps"),
        ({"learning_rate": float("nan")}, "--learning-rate"),
        ({"resume": True}, "There is no run to resume"),
        ({"books": 8}, "--books is for --fine-tune"),
        ({"fine_tune": Path("shipped"), "books": 13}, "--books must be from 1 to 12"),
        (
            {"fine_tune": Path("shipped"), "add_to": Path("shipped")},
            "either --add-to or --fine-tune",
        ),
        ({"fine_tune": Path("none.safetensors")}, "none.safetensors"),
    ],
)
def test_bad_options_are_refused(options, message, motions, tmp_path):
    with pytest.raises(InputError, match=message):
        TrainTokenizer(motions=(motions,), out=tmp_path, **options).run()


def test_a_folder_without_motions_is_refused(tmp_path):
    with pytest.raises(InputError, match="no folder of Motion files"):
        TrainTokenizer(motions=(tmp_path / "none",), out=tmp_path).run()
    with pytest.raises(InputError, match="no folder of Motion files"):
        TrainGenerator(motions=(tmp_path / "none",), out=tmp_path).run()
