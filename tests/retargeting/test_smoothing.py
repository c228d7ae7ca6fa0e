import numpy as np
import pytest

from loco_drake.retargeting.correction import smooth


@pytest.mark.parametrize(("frequency", "gain"), [(1.0, 1.0), (5.0, 0.5), (20.0, 0.0)])
def test_cutoff_frequency_is_halved_without_phase(frequency, gain):
    """Gain 1 far below the cut-off, 1/2 at it, 0 far above; crests stay in place."""
    time = np.arange(1000) / 50
    wave = np.sin(2 * np.pi * frequency * time)
    middle = slice(200, 800)
    smoothed = smooth(wave, 5.0, 50.0)[middle]
    np.testing.assert_allclose(smoothed, gain * wave[middle], atol=2e-3)


def test_quadratics_pass_unchanged_to_the_very_ends():
    time = np.arange(40)[:, None, None] / 50
    path = np.array([[1.0, -2.0], [3.0, 0.5]]) * time + 4 * time**2 + 1
    np.testing.assert_allclose(smooth(path, 2.0, 50.0), path, atol=1e-8)


def test_cutoff_above_half_the_rate_smooths_nothing():
    noise = np.random.default_rng(0).normal(size=(50, 3))
    np.testing.assert_allclose(smooth(noise, 25.0, 50.0), noise, atol=1e-12)


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_clip_too_short_for_a_third_difference_is_left_alone(frames):
    values = np.arange(frames, dtype=float)
    np.testing.assert_allclose(smooth(values, 5.0, 50.0), values)
