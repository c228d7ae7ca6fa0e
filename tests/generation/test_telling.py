from dataclasses import replace

import numpy as np
import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.common.weights import save_network
from loco_drake.generation.features import SIZE, VELOCITY, YAW_RATE
from loco_drake.generation.generate import generate_motions
from loco_drake.generation.generator import Generator
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.generation.speed_rank import BINS
from loco_drake.generation.telling import Telling, token_velocities, told_bounds
from loco_drake.generation.train_telling import as_commands, train_telling
from loco_drake.generation.training_motions import Library, motion_clip
from loco_drake.motion.gaits import LABELS, parse_label
from tests.synthetic_motion import synthetic_motion
from tests.tiny_model import make_tiny_model, taught

PACE, TROT = parse_label("dog-pace"), parse_label("dog-trot")
NAN = np.full(3, np.nan)


@pytest.fixture(scope="module")
def plain():
    return make_tiny_model()


@pytest.fixture(scope="module")
def model():
    return make_tiny_model(told=True)


def extended(model, velocity, chunks=2, seeds=(1, 2)):
    """Returns q of chunks that are told one velocity after the other."""
    stream, parts = model.start(np.array(seeds), 10.0), []
    for k in range(chunks):
        told = velocity(k) if callable(velocity) else velocity
        stream, frames = model.extend(
            stream, np.full(len(seeds), TROT.index), velocity=told
        )
        parts.append(frames.q)
    return np.concatenate(parts, axis=1)


def test_velocities_are_those_of_the_base_without_its_swaying():
    """A sway of the stride's period of .5 s, and a turn at 2 rad/s from 4 s on."""
    features = np.zeros((400, SIZE))
    time = np.arange(400) / 50
    features[:, VELOCITY] = [2.0, -0.5]
    features[:, VELOCITY.start] += np.sin(2 * np.pi * time / 0.5)
    features[200:, YAW_RATE] = 2.0
    found = token_velocities(features, 4)
    assert found.shape == (100, 3)
    inner = found[8:-8]
    np.testing.assert_allclose(inner[:, 0], 2.0, atol=0.02)
    np.testing.assert_allclose(inner[:, 1], -0.5, atol=1e-12)
    # Half of it at the change; all of it half a second before and after.
    np.testing.assert_allclose(found[[30, 43, 56, 70], 2], [0, 0, 2, 2], atol=0.01)
    np.testing.assert_allclose(found[49:51, 2].mean(), 1.0, atol=0.05)


def test_bounds_leave_out_a_hundredth_at_each_end():
    """Of 0 to 100, 1 and 99; the other labels cannot be told anything but 0."""
    ramp = np.linspace([0, -100, 0], [100, 0, 10], 101)
    low, high = told_bounds([(TROT.index, ramp[:40]), (TROT.index, ramp[40:])])
    np.testing.assert_allclose(low[TROT.index], [1, -99, 0.1])
    np.testing.assert_allclose(high[TROT.index], [99, -1, 9.9])
    assert not np.delete(low, TROT.index, axis=0).any()
    assert low.shape == (len(LABELS), 3)


def test_without_being_told_it_is_the_plain_generator_to_the_last_bit(plain, model):
    want = extended(plain, None)
    np.testing.assert_array_equal(extended(model, None), want)
    np.testing.assert_array_equal(extended(model, np.tile(NAN, (2, 1))), want)


def test_of_a_batch_only_what_is_told_differs(model, plain):
    told = np.stack((NAN, [0.5, 0.0, 0.4]))
    found, want = extended(model, told), extended(plain, None)
    np.testing.assert_array_equal(found[0], want[0])
    assert np.abs(found[1] - want[1]).max() > 1e-3


def test_before_it_learns_telling_adds_nothing():
    telling = Telling(width=8, layers=2, dropout=0.1).eval()
    x, velocities = torch.randn(1, 5, 8), torch.randn(1, 5, 3)
    for index in range(3):
        assert torch.equal(telling.adapt(index, x, *telling.embed(velocities)), x)


def test_a_velocity_counts_from_its_token_on(model):
    generator, steps = model.generator, 10
    torch.manual_seed(0)
    codes = torch.randint(16, (1, steps, 2))
    labels = torch.full((1, steps), TROT.index)
    bins, duration = torch.zeros(1, 1, dtype=torch.long), torch.tensor([3])
    velocities = torch.full((1, steps, 3), torch.nan)
    later = velocities.clone()
    later[:, 6:] = torch.tensor([1.0, 0.2, -0.5])
    with torch.no_grad():
        a, b = (
            generator(codes, labels, bins, duration, codes, v)
            for v in (velocities, later)
        )
    assert torch.equal(a[:, :6], b[:, :6])
    assert (a[:, 6:] - b[:, 6:]).abs().amax(dim=(0, 2, 3)).min() > 1e-3


def test_sampling_with_a_cache_is_the_plain_network(model):
    """Temperature 0 against the likeliest code of the whole forward pass."""
    generator = model.generator
    torch.manual_seed(1)
    history = torch.randint(16, (1, 4, 2))
    labels = torch.full((1, 6), TROT.index)
    velocities = torch.randn(1, 6, 3)
    velocities[:, :2] = torch.nan
    bins, duration = torch.zeros(1, 1, dtype=torch.long), torch.tensor([3])
    dice = torch.rand(1, 3, 2, dtype=torch.float64)
    drawn = generator.sample(
        history, labels, bins, duration, dice, 0.0, 1.0, velocities
    )
    sequence = history
    for step in range(3):
        token = torch.zeros(1, 1, 2, dtype=torch.long)
        now = slice(0, 4 + step)
        for book in range(2):
            guess = torch.cat((sequence[:, 1:], token), dim=1)
            with torch.no_grad():
                logits = generator(
                    sequence, labels[:, now], bins, duration, guess, velocities[:, now]
                )
            token[:, 0, book] = logits[:, -1, book].argmax(dim=-1)
        assert torch.equal(drawn[:, step], token[:, 0])
        sequence = torch.cat((sequence, token), dim=1)


def test_a_velocity_replaces_the_speed_rank(plain):
    """The rank is that of the velocity among the label's speeds."""
    generator = taught(plain.generator)
    generator.telling.adapters = torch.nn.ModuleList(
        torch.nn.Sequential(torch.nn.Linear(16, 16)) for _ in range(3)
    )
    for parameter in generator.telling.adapters.parameters():
        torch.nn.init.zeros_(parameter)
    generator.speed_edges[TROT.index] = torch.arange(1.0, BINS) / 4
    torch.nn.init.normal_(generator.pace_in.weight)
    codes = torch.randint(16, (1, 4, 2))
    labels, duration = torch.full((1, 4), TROT.index), torch.tensor([3])
    velocities = torch.tensor([0.6, 0.0, 0.0]).expand(1, 4, 3)
    with torch.no_grad():
        # .6 lies between the second edge, .5, and the third, .75.
        want = generator(codes, labels, torch.tensor([[2]]), duration, codes)
        told = generator(
            codes, labels, torch.tensor([[9]]), duration, codes, velocities
        )
    torch.testing.assert_close(told, want)


def test_what_was_not_recorded_is_told_as_the_nearest_that_was(model):
    """The tiny model's bound is 5 stand heights/s, and 5 rad/s."""
    height = model.robot.stand_height
    bound, beyond = [5 * height, 0.0, -5.0], [9 * height, 0.0, -8.0]
    a, b = (extended(model, np.tile(v, (2, 1)), 1) for v in (bound, beyond))
    np.testing.assert_array_equal(a, b)


def test_streams_remember_what_was_told(model):
    """It is context of the tokens after it, and told once for all is told to each."""
    told = np.tile([0.4, 0.0, 0.5], (2, 1))
    once = extended(model, lambda k: told if k == 0 else None)
    whole = extended(model, np.repeat(told[:, None], model.chunk_tokens, axis=1))
    np.testing.assert_array_equal(whole, extended(model, told))
    frames = model.chunk_frames
    np.testing.assert_array_equal(once[:, :frames], whole[:, :frames])
    assert (once[:, frames:] != whole[:, frames:]).any()


def test_generated_motions_say_what_they_were_told(model):
    (motion,) = generate_motions(model, TROT, 1.0, [3], velocity=[0.5, 0.0, 0.25])
    assert motion.provenance["told"] == "0.5, 0, 0.25"
    profile = np.tile([[[0.5, 0.0, 0.25]]], (1, 20, 1))
    (same,) = generate_motions(model, TROT, 1.0, [3], velocity=profile)
    np.testing.assert_array_equal(same.joint_positions, motion.joint_positions)
    (other,) = generate_motions(model, TROT, 1.0, [3])
    assert "told" not in other.provenance


def test_bad_velocities_are_refused(plain, model):
    with pytest.raises(InputError, match=r"three finite numbers.*0\.5, nan, 0"):
        generate_motions(model, TROT, 1.0, [3], velocity=[0.5, np.nan, 0.0])
    with pytest.raises(InputError, match="not taught velocities"):
        generate_motions(plain, TROT, 1.0, [3], velocity=[0.5, 0.0, 0.0])


def test_commands_begin_and_hold():
    """Some later, with at least eight tokens told; some their mean."""
    velocities = torch.randn(200, 28, 3)
    told = as_commands(velocities, np.random.default_rng(0))
    known = told.isfinite().all(dim=-1)
    assert (known.sum(dim=1) >= 8).all()
    assert 0.3 < known[:, 0].float().mean() < 0.7
    # Once told, told to the end.
    assert not (known[:, :-1] & ~known[:, 1:]).any()
    held = 0
    for row, mask, original in zip(told, known, velocities, strict=True):
        if torch.equal(row[mask], original[mask]):
            continue
        held += 1
        mean = original[mask].mean(dim=0)
        torch.testing.assert_close(row[mask], mean.expand(int(mask.sum()), 3))
    assert 60 < held < 140


def straight_and_turning():
    """A trot that turns left or right, as it is told."""
    motions = [
        synthetic_motion("dog-trot", 5.0, 0.7, turn, phase=0.1 * i, recording=f"r{i}")
        for i, turn in enumerate((-0.8, 0.8, 0.0))
    ]
    return Library(tuple(motion_clip(m) for m in motions), ())


def test_training_learns_from_what_it_is_told_and_leaves_the_rest(plain, tmp_path):
    path = tmp_path / "plain.safetensors"
    save_network(path, "generator", plain.generator, {"robots": ["go2"]})
    settings = LoopSettings(tmp_path / "run", 60, 1e-2)
    generator, result = train_telling(
        straight_and_turning(), plain.tokenizer, path, settings, stitched=2
    )
    assert not result.stopped
    before, after = plain.generator.state_dict(), generator.state_dict()
    assert all(torch.equal(after[name], value) for name, value in before.items())
    assert any(adapter[-1].weight.any() for adapter in generator.telling.adapters)
    high = generator.telling.high[TROT.index]
    assert high[2] == pytest.approx(0.8, abs=0.1)
    other = replace(generator.config, tokenizer="1" * 16)
    save_network(path, "generator", Generator(other))
    with pytest.raises(InputError, match="for the tokenizer 1111111111111111"):
        train_telling(straight_and_turning(), plain.tokenizer, path, settings)


def test_a_label_that_the_generator_does_not_know_is_refused(plain, tmp_path):
    path = tmp_path / "plain.safetensors"
    save_network(path, "generator", plain.generator)
    horse = Library((motion_clip(synthetic_motion("horse-trot", 3.0, 0.4)),), ())
    settings = LoopSettings(tmp_path, 1, 1e-3)
    with pytest.raises(InputError, match="knows dog-pace, dog-trot, not horse-trot"):
        train_telling(horse, plain.tokenizer, path, settings)
