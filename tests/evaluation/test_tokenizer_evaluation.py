from dataclasses import replace

import numpy as np
import pytest
import torch

from loco_drake.evaluation.recorded import by_split
from loco_drake.evaluation.tokenizer import evaluate_tokenizer
from loco_drake.generation.tokenizer_score import (
    clip_tensor,
    code_counts,
    codebook_use,
    score_tokenizer,
)
from loco_drake.generation.training_motions import motion_clip
from tests.tiny_model import make_tiny_model
from tests.varied_motion import varied_motions


@pytest.fixture(scope="module")
def tokenizer():
    return make_tiny_model().tokenizer


@pytest.fixture(scope="module")
def recorded():
    return by_split(
        [
            *varied_motions("dog-pace", 3),
            *varied_motions("dog-trot", 3),
            *varied_motions("mpc-trot", 1),
            *varied_motions("dog-pace", 2, split="validation"),
            *varied_motions("dog-trot", 1, split="validation"),
        ]
    )


def test_labels_weigh_the_same_and_missing_ones_say_why(tokenizer, recorded):
    figures, counts = evaluate_tokenizer(tokenizer, recorded)
    held_out = [motion_clip(motion) for motion in recorded.validation]
    pace, trot = (
        score_tokenizer(tokenizer, held_out[:2]),
        score_tokenizer(tokenizer, held_out[2:]),
    )
    expected = np.sqrt((pace.joint_rmse_rad**2 + trot.joint_rmse_rad**2) / 2)
    assert figures["all"]["joint_rmse_rad"] == pytest.approx(expected)
    toes = figures["labels"]["dog-trot"]["toe_error_rmse_m"]
    assert toes == pytest.approx(trot.toe_error_rmse_m)
    assert figures["labels"]["mpc-trot"]["joint_rmse_rad"] is None
    assert "held out" in figures["labels"]["mpc-trot"]["reason"]
    assert set(figures["train"]["labels"]) == {"dog-pace", "dog-trot", "mpc-trot"}
    # 101 frames hold 25 tokens; ten motions and their mirror images.
    np.testing.assert_array_equal(counts.sum(axis=1), [20 * 25] * 2)
    used = (counts > 0).mean()
    assert figures["codebook_use"] == pytest.approx(used)
    assert figures["books"] == pytest.approx((counts > 0).mean(axis=1).tolist())


def test_use_of_codes_by_hand(tokenizer, recorded):
    """A clip of one token uses one code of each codebook: 1/16."""
    clip = motion_clip(recorded.train[0].slice(0, 4))
    assert codebook_use(tokenizer, [clip]) == pytest.approx(1 / 16)
    codes = tokenizer.encode(clip_tensor(tokenizer, clip), torch.tensor([0]))[0, 0]
    counts = code_counts(tokenizer, [clip, clip])
    for codebook, code in enumerate(codes):
        assert counts[codebook, code] == counts[codebook].sum() == 2


def test_error_of_joints_by_hand(tokenizer, recorded):
    """Against what decoding gives, computed here."""
    clip = motion_clip(recorded.train[0])
    target = clip_tensor(tokenizer, clip)
    robot = torch.tensor([0])
    with torch.inference_mode():
        output = tokenizer.decode(tokenizer.encode(target, robot), robot)
    error = (output - target)[0, :, 6:18].numpy()
    found = score_tokenizer(tokenizer, [clip]).joint_rmse_rad
    assert found == pytest.approx(np.sqrt((error**2).mean()), rel=1e-5)


def test_fewer_books_are_another_score(tokenizer, recorded):
    all_books, _ = evaluate_tokenizer(tokenizer, recorded)
    one_book, _ = evaluate_tokenizer(tokenizer, recorded, codebooks=1)
    assert one_book["all"] != all_books["all"]
    assert one_book["codebook_use"] == all_books["codebook_use"]


def test_nothing_held_out(tokenizer, recorded):
    figures, _ = evaluate_tokenizer(tokenizer, replace(recorded, validation=()))
    assert figures["all"]["joint_rmse_rad"] is None
    assert figures["all"]["reason"] == "No recording is held out."
