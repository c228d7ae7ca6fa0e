import os
import signal
from dataclasses import replace

import numpy as np
import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.generation.clips import Clip
from loco_drake.generation.features import SIZE
from loco_drake.generation.generator import (
    GeneratorConfig,
    duration_bin,
    load_generator,
)
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.generation.motion_model import MotionModel
from loco_drake.generation.speed_rank import BINS, speed_edges
from loco_drake.generation.tokenizer import TokenizerConfig, load_tokenizer
from loco_drake.generation.tokenizer_score import score_tokenizer
from loco_drake.generation.train_generator import (
    CORRUPTION,
    encode_clips,
    make_batch,
    stitched_clips,
    train_generator,
)
from loco_drake.generation.train_tokenizer import (
    Scales,
    energy_error,
    train_tokenizer,
)
from loco_drake.generation.training_motions import load_library
from loco_drake.motion.gaits import parse_label

TINY = TokenizerConfig(width=24, depth=1, frame_width=8, codebooks=2, codebook_size=16)


@pytest.fixture(scope="module")
def library(motions):
    return load_library(motions)


@pytest.fixture(scope="module")
def tokenizer(library, tmp_path_factory):
    out = tmp_path_factory.mktemp("tokenizer")
    train_tokenizer(library, TINY, LoopSettings(out, 150, 5e-3))
    return load_tokenizer(out / "tokenizer.safetensors")


def generator_config(tokenizer):
    return GeneratorConfig(
        tokenizer=tokenizer.fingerprint,
        codebooks=2,
        codebook_size=16,
        frames_per_token=4,
        labels=("dog-pace", "dog-trot"),
        window=8,
        width=24,
        layers=1,
        heads=2,
    )


def same_weights(a, b):
    a, b = a.state_dict(), b.state_dict()
    return all(torch.equal(a[name], b[name]) for name in a)


def test_training_makes_the_tokenizer_better(library, tokenizer, tmp_path):
    untrained, _ = train_tokenizer(library, TINY, LoopSettings(tmp_path, 1, 3e-3))
    before = score_tokenizer(untrained, library.held_out)
    after = score_tokenizer(tokenizer, library.held_out)
    assert after.joint_rmse_rad < 0.75 * before.joint_rmse_rad
    assert after.toe_error_rmse_m < 0.75 * before.toe_error_rmse_m


def test_training_makes_the_generator_better(library, tokenizer, tmp_path):
    """From chance, ln 16 nats, to well below on data of two gaits."""
    _, result = train_generator(
        library,
        tokenizer,
        generator_config(tokenizer),
        LoopSettings(tmp_path, 80, 3e-3),
        stitched=4,
    )
    assert not result.stopped
    assert result.loss < 0.7 * np.log(16)
    loaded = load_generator(tmp_path / "generator.safetensors")
    MotionModel(tokenizer, loaded, "go2")  # belong together


def test_a_resumed_tokenizer_is_bit_for_bit_the_uninterrupted_one(
    library, tmp_path, monkeypatch
):
    settings = LoopSettings(tmp_path / "whole", 8, 3e-3)
    whole, _ = train_tokenizer(library, TINY, settings)
    halves = replace(settings, out=tmp_path / "halves")
    stop_after(monkeypatch, 5)
    _, result = train_tokenizer(library, TINY, halves)
    assert (result.steps, result.stopped) == (5, True)
    assert not (tmp_path / "halves" / "tokenizer.safetensors").exists()
    torch.manual_seed(1234)  # what torch drew elsewhere must not matter
    resumed, result = train_tokenizer(library, TINY, replace(halves, resume=True))
    assert (result.steps, result.stopped) == (8, False)
    assert same_weights(resumed, whole)


def test_a_resumed_generator_is_bit_for_bit_the_uninterrupted_one(
    library, tokenizer, tmp_path, monkeypatch
):
    config = generator_config(tokenizer)
    settings = LoopSettings(tmp_path / "whole", 8, 3e-3)
    whole, _ = train_generator(library, tokenizer, config, settings, stitched=2)
    halves = replace(settings, out=tmp_path / "halves")
    stop_after(monkeypatch, 5)
    _, result = train_generator(library, tokenizer, config, halves, stitched=2)
    assert (result.steps, result.stopped) == (5, True)
    resumed, _ = train_generator(
        library, tokenizer, config, replace(halves, resume=True), stitched=2
    )
    assert same_weights(resumed, whole)


def stop_after(monkeypatch, steps):
    """Presses Ctrl-C during the given optimizer step, once."""
    plain = torch.optim.AdamW.step
    taken = 0

    def step(self, *args, **kwargs):
        nonlocal taken
        taken += 1
        if taken == steps:
            os.kill(os.getpid(), signal.SIGINT)
        return plain(self, *args, **kwargs)

    monkeypatch.setattr(torch.optim.AdamW, "step", step)


def test_ctrl_c_works_as_before_afterwards(library, tmp_path):
    handler = signal.getsignal(signal.SIGINT)
    train_tokenizer(library, TINY, LoopSettings(tmp_path, 1, 3e-3))
    assert signal.getsignal(signal.SIGINT) is handler


def test_a_checkpoint_of_another_run_is_refused(library, tmp_path):
    settings = LoopSettings(tmp_path, 2, 3e-3)
    train_tokenizer(library, TINY, settings)
    with pytest.raises(InputError, match="has --seed 0, not 1"):
        train_tokenizer(library, TINY, replace(settings, seed=1, resume=True))
    with pytest.raises(InputError, match=r"network\.width 24, not 32"):
        train_tokenizer(
            library, replace(TINY, width=32), replace(settings, resume=True)
        )
    with pytest.raises(InputError, match="There is no run to resume"):
        train_tokenizer(
            library, TINY, replace(settings, out=tmp_path / "none", resume=True)
        )


def test_a_damaged_checkpoint_is_refused(library, tmp_path):
    settings = LoopSettings(tmp_path, 1, 3e-3)
    train_tokenizer(library, TINY, settings)
    path = tmp_path / "checkpoint.safetensors"
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(InputError, match="damaged"):
        train_tokenizer(library, TINY, replace(settings, resume=True))


def test_windows_are_shifted_by_one_token(library, tokenizer):
    """Where the input was not corrupted, it is the target of the step before."""
    config = generator_config(tokenizer)
    encoded = encode_clips(tokenizer, stitched_clips(library.train, 16, 0), codebooks=2)
    random = np.random.default_rng(0)
    edges = speed_edges((e.label, e.speeds) for e in encoded)
    before, labels, speed_bins, duration, codes, velocities = make_batch(
        config, edges, encoded, random
    )
    agree = (before[:, 1:] == codes[:, :-1]).float().mean()
    assert 1 - CORRUPTION * 1.5 < agree < 1.0
    starts = (before[:, 0] == config.codebook_size).all(dim=-1)
    assert 0 < starts.sum() < len(encoded)
    for row, sequence in zip(labels, encoded, strict=True):
        assert set(row.tolist()) == {sequence.label}
    assert speed_bins.shape == labels.shape
    assert velocities.shape == (*labels.shape, 3)
    assert 0 <= speed_bins.min() < speed_bins.max() < BINS
    # No window is told a duration that is shorter than itself.
    assert duration.min() >= duration_bin(20 * 4 / 50)


def test_errors_are_measured_by_what_varies_within_a_label():
    """Waves of amplitude a: a / sqrt(2), the steps of which depend on the frequency.

    Two clips of a label on levels of their own also vary by these.
    """
    time = np.arange(400) / 50
    omega = 2 * np.pi * 2.0  # 2 Hz
    clips = []
    for label, level, amplitude in (
        ("dog-trot", 1.0, 0.2),
        ("dog-trot", 2.0, 0.2),
        ("dog-pace", 9.0, 0.1),
    ):
        features = np.zeros((400, SIZE))
        features[:, 0] = level + amplitude * np.sin(omega * time)
        clips.append(Clip("go2", parse_label(label), label, features))
    names = ("dog-trot", "dog-pace", "horse-walk")
    labels = torch.tensor([parse_label(name).index for name in names])
    deviation, change, jitter = Scales(clips)(labels)
    assert deviation.shape == (3, 1, 18)
    step = 2 * np.sin(omega / 100)  # of a unit wave, from one frame to the next
    both = (0.2**2 + 0.1**2) / 4
    for scale, factor, spread in (
        (deviation, 1.0, 0.5**2),
        (change, step, 0.0),
        (jitter, step**2, 0.0),
    ):
        variances = np.array([0.2**2 / 2 + spread, 0.1**2 / 2, both + spread / 2])
        own = scale[:, 0, 0].numpy() / factor
        np.testing.assert_allclose(own, np.sqrt(variances), rtol=0.01)


def test_a_tremor_counts_whatever_its_phase():
    """Of tremors out of phase squared errors are large; energies are the same.

    With none at all, log(QUIET^2) / 2 = -1.61 is left of log(1 + QUIET^2) / 2 = .02.
    """
    time = torch.arange(64)[None, :, None]
    omega = torch.tensor(2 * np.pi * 10 / 50)  # 10 Hz
    unit = torch.full((1, 1, 18), 2**-0.5) * (2 * torch.sin(omega / 2)) ** 2
    sine = torch.sin(omega * time).expand(1, 64, SIZE)
    cosine = torch.cos(omega * time).expand(1, 64, SIZE)
    assert energy_error(sine, cosine, unit) < 1e-4
    assert energy_error(torch.zeros_like(sine), sine, unit).item() == pytest.approx(
        (1.609 + 0.020) ** 2, abs=0.1
    )
