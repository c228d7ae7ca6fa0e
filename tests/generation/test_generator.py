import numpy as np
import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.common.weights import save_network
from loco_drake.generation.generator import (
    DURATION_BINS,
    Generator,
    GeneratorConfig,
    draw,
    duration_bin,
    load_generator,
    turn_channels,
)
from loco_drake.generation.speed_rank import BINS

TINY = GeneratorConfig(
    tokenizer="0" * 16,
    codebooks=3,
    codebook_size=8,
    frames_per_token=4,
    labels=("dog-pace", "dog-trot"),
    window=6,
    width=16,
    layers=2,
    heads=2,
)


@pytest.fixture
def generator():
    torch.manual_seed(0)
    net = Generator(TINY).eval()
    with torch.no_grad():
        for parameter in net.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    return net


def inputs(steps=10, batch=2):
    torch.manual_seed(1)
    before = torch.randint(8, (batch, steps, 3))
    labels = torch.randint(2, (batch, steps))
    speed_bins = torch.randint(BINS, (batch, 1))
    duration = torch.randint(DURATION_BINS, (batch,))
    codes = torch.randint(8, (batch, steps, 3))
    return before, labels, speed_bins, duration, codes


def test_changing_a_later_token_leaves_earlier_logits_alone(generator):
    before, labels, speed_bins, duration, codes = inputs()
    other = before.clone()
    other[:, 6] = (other[:, 6] + 1) % 8
    with torch.no_grad():
        a = generator(before, labels, speed_bins, duration, codes)
        b = generator(other, labels, speed_bins, duration, codes)
    torch.testing.assert_close(a[:, :6], b[:, :6], atol=1e-6, rtol=0)
    assert (a[:, 6:] - b[:, 6:]).abs().amax(dim=(0, 2, 3)).min() > 1e-3


def test_changing_a_later_label_leaves_earlier_logits_alone(generator):
    before, labels, speed_bins, duration, codes = inputs()
    other = labels.clone()
    other[:, 6] = 1 - other[:, 6]
    with torch.no_grad():
        a = generator(before, labels, speed_bins, duration, codes)
        b = generator(before, other, speed_bins, duration, codes)
    torch.testing.assert_close(a[:, :6], b[:, :6], atol=1e-6, rtol=0)
    assert (a[:, 6:] - b[:, 6:]).abs().amax(dim=(0, 2, 3)).min() > 1e-3


def test_a_book_sees_the_earlier_books_of_its_token_only(generator):
    before, labels, speed_bins, duration, codes = inputs()
    other = codes.clone()
    other[:, 4, 1] = (other[:, 4, 1] + 1) % 8
    with torch.no_grad():
        a = generator(before, labels, speed_bins, duration, codes)
        b = generator(before, labels, speed_bins, duration, other)
    changed = (a - b).abs().amax(dim=(0, 3)) > 1e-6  # (steps, codebooks)
    expected = torch.zeros(10, 3, dtype=torch.bool)
    expected[4, 2] = True
    assert torch.equal(changed, expected)


def test_the_condition_counts(generator):
    before, labels, speed_bins, duration, codes = inputs()
    with torch.no_grad():
        a = generator(before, labels, speed_bins, duration, codes)
        b = generator(before, labels, speed_bins, (duration + 5) % DURATION_BINS, codes)
        c = generator(before, labels, (speed_bins + 5) % BINS, duration, codes)
    assert (a - b).abs().amin(dim=(1, 2)).max() > 1e-3
    assert (a - c).abs().amin(dim=(1, 2)).max() > 1e-3


def test_sampling_with_a_cache_is_the_plain_network(generator):
    """Temperature 0 against the likeliest code of the whole forward pass."""
    history, labels, speed_bins, duration, _ = inputs(steps=5)
    labels = torch.randint(2, (2, 5 - 1 + 4))
    dice = torch.rand(2, 4, 3, dtype=torch.float64)
    drawn = generator.sample(history, labels, speed_bins, duration, dice, 0.0, 1.0)
    sequence = history
    for step in range(4):
        token = torch.zeros(2, 1, 3, dtype=torch.long)
        for codebook in range(3):
            guess = torch.cat((sequence[:, 1:], token), dim=1)
            with torch.no_grad():
                logits = generator(
                    sequence, labels[:, : 5 + step], speed_bins, duration, guess
                )
            token[:, 0, codebook] = logits[:, -1, codebook].argmax(dim=-1)
        assert torch.equal(drawn[:, step], token[:, 0])
        sequence = torch.cat((sequence, token), dim=1)


def test_attention_knows_only_relative_times(generator):
    """Turned by their times, query and key agree as their distance in time says."""
    rates = generator.blocks[0].attention.rates
    q, k = torch.randn(2, 1, 1, 1, 8)

    def agreement(time_q, time_k):
        turned = [
            turn_channels(x, (time * rates).cos()[None], (time * rates).sin()[None])
            for x, time in ((q, time_q), (k, time_k))
        ]
        return float((turned[0] * turned[1]).sum())

    assert agreement(5.0, 3.0) == pytest.approx(agreement(25.0, 23.0), abs=1e-4)
    assert abs(agreement(5.0, 3.0) - agreement(5.0, 4.0)) > 1e-2


def test_drawing_follows_the_probabilities():
    """Of 1/2, 1/3, 1/6 in another order, at dice on both sides of each border."""
    logits = torch.tensor([1 / 3, 1 / 6, 1 / 2]).log().expand(6, 3)
    dice = torch.tensor([0.0, 0.499, 0.501, 0.832, 0.834, 0.999], dtype=torch.float64)
    drawn = draw(logits, dice, temperature=1.0, top_p=1.0)
    assert drawn.tolist() == [2, 2, 0, 0, 1, 1]


def test_nucleus_leaves_out_the_unlikely_tail():
    """At 0.8 the nucleus is {1/2, 1/3}: 3/5 and 2/5 of the dice."""
    logits = torch.tensor([1 / 3, 1 / 6, 1 / 2]).log().expand(4, 3)
    dice = torch.tensor([0.0, 0.599, 0.601, 0.999], dtype=torch.float64)
    assert draw(logits, dice, 1.0, 0.8).tolist() == [2, 2, 0, 0]
    assert draw(logits, dice, 1.0, 0.1).tolist() == [2, 2, 2, 2]


def test_temperature_sharpens():
    """Dividing log p by 1/2 squares p: 9/14, 4/14, 1/14."""
    logits = torch.tensor([3.0, 2.0, 1.0]).log().expand(4, 3)
    dice = torch.tensor([0.642, 0.644, 0.928, 0.930], dtype=torch.float64)
    assert draw(logits, dice, 0.5, 1.0).tolist() == [0, 1, 1, 2]


def test_durations_are_binned_on_a_log_scale_and_saturate():
    bins = duration_bin(np.array([0.01, 0.5, 0.7, 2.83, 15.9, 16.0, 600.0]))
    # 0.5 * 32^(k / 15): 2.83 s is half of the way up in octaves, k = 7.5.
    assert bins.tolist() == [0, 0, 1, 7, 14, 15, 15]


def test_saved_weights_come_back(generator, tmp_path):
    path = tmp_path / "g.safetensors"
    save_network(path, "generator", generator, half=True)
    loaded = load_generator(path)
    assert loaded.config == TINY
    before, labels, speed_bins, duration, codes = inputs()
    with torch.no_grad():
        a = generator(before, labels, speed_bins, duration, codes)
        b = loaded(before, labels, speed_bins, duration, codes)
    torch.testing.assert_close(a, b, atol=0.05, rtol=0.01)  # 16 bits


def test_weights_of_something_else_are_refused(generator, tmp_path):
    from loco_drake.common.weights import save_weights

    path = tmp_path / "g.safetensors"
    save_weights(path, "tokenizer", generator.state_dict(), {})
    with pytest.raises(InputError, match="holds tokenizer weights"):
        load_generator(path)
    save_weights(path, "generator", generator.state_dict(), {"network": {}})
    with pytest.raises(InputError, match="header"):
        load_generator(path)
