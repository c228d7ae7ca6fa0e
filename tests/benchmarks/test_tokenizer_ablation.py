"""The variants of the tokenizer are what their rows say."""

import runpy
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from loco_drake.generation.features import SIZE
from loco_drake.generation.tokenizer import TokenizerConfig

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "tokenizer_ablation.py"
SMALL = TokenizerConfig(width=16, depth=1, frame_width=8, book_size=8, books=4)
ROBOT = torch.zeros(1, dtype=torch.long)


@pytest.fixture(scope="module")
def script():
    return runpy.run_path(str(SCRIPT))


def moved_frames(tokenizer):
    """Returns which frames change when frames 32 to 35 of 64 do, encoder to decoder."""
    with torch.random.fork_rng(devices=[]), torch.no_grad():
        torch.manual_seed(1)
        before = torch.randn(1, 64, SIZE)
        after = before.clone()
        after[:, 32:36] += 1.0
        outputs = [
            tokenizer.decode_embedded(tokenizer.embed(frames, ROBOT), ROBOT)
            for frames in (before, after)
        ]
    changed = (outputs[0] - outputs[1]).abs().amax(dim=(0, 2)) > 1e-7
    return torch.nonzero(changed)[:, 0]


def test_one_variant_looks_ahead_as_far_as_back_the_others_never(script):
    variants = script["VARIANTS"]
    causal = moved_frames(variants["as shipped"].build(SMALL).tokenizer)
    assert causal.min() == 32
    centred = moved_frames(variants["looks ahead"].build(SMALL).tokenizer)
    assert abs((32 - centred.min()) - (centred.max() - 35)) <= 1
    assert (32 - centred.min()) * 2 == pytest.approx(causal.max() - 35, abs=2)


def test_product_books_decode_what_was_quantized(script):
    """Each in channels of its own; the sum of their vectors is the whole."""
    learning = script["VARIANTS"]["product books"].build(SMALL)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(2)
        frames = torch.randn(16, 64, SIZE)
        robot = torch.zeros(16, dtype=torch.long)
        learning.train()
        learning(frames, robot)
    learning.eval()
    tokenizer = learning.finish()
    own = (tokenizer.codebooks.abs().amax(dim=1) > 0).sum(dim=0)
    assert (own == 1).all()
    with torch.inference_mode():
        quantized, _, _ = learning.quantizer(tokenizer.embed(frames, robot))
        decoded = tokenizer.lookup(tokenizer.encode(frames, robot))
    torch.testing.assert_close(decoded, quantized, atol=1e-5, rtol=1e-4)


def test_bits_by_hand(script):
    """8 books of 128 codes, 12.5 tokens a second: 8 * 7 * 12.5."""
    eight = replace(TokenizerConfig(), books=8)
    assert script["bits_per_second"](eight) == 700.0
    few = replace(TokenizerConfig(), books=2, frames_per_token=8)
    assert script["bits_per_second"](few) == 87.5
