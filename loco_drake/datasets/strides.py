"""Frames per second of a horse from its strides, where no file or name tells them."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

Array = NDArray[np.float64]

GRAVITY = 9.81

# The stride period over sqrt(withers height / g): in 96 recordings of eleven Haflingers
# whose rate is known it is 2.38 to 3.25 in a walk and 1.69 to 1.93 in a trot.
TYPICAL_PERIOD = {"walk": 2.8, "trot": 1.8}
# Diagonal hooves of a trot swing together: correlation of their fore-aft motion. In a
# walk it is near 0.
DIAGONAL = 0.6
# The two rates differ twofold, so the better one must be off by less than sqrt(2).
MAX_RATIO = 1.35


def infer_rate(
    fore_aft: Array, withers_height: float, rates: tuple[float, ...]
) -> float | None:
    """Returns the one of ``rates`` at which the strides last as those of a horse.

    Animals of one build move alike when times are scaled by sqrt(height / g) (Alexander
    and Jayes 1983), and walk and trot are told apart without a clock.

    Args:
        fore_aft: of the hooves relative to the trunk in m, FL, FR, RL, RR, (T, 4).
        withers_height: m.
        rates: frames per second that are possible.

    Returns:
        None if there are too few strides, or none of the rates fits.
    """
    frames = stride_frames(fore_aft)
    if frames is None or withers_height <= 0:
        return None
    correlation = np.asarray(np.corrcoef(fore_aft.T))
    trots = (correlation[0, 3] + correlation[1, 2]) / 2 > DIAGONAL
    typical = TYPICAL_PERIOD["trot" if trots else "walk"]
    seconds = typical * np.sqrt(withers_height / GRAVITY)
    ratios = {rate: abs(np.log(frames / rate / seconds)) for rate in rates}
    best = min(rates, key=lambda rate: ratios[rate])
    return best if ratios[best] < np.log(MAX_RATIO) else None


def stride_frames(fore_aft: Array) -> float | None:
    """Returns the stride period in frames, by autocorrelation over all hooves.

    Args:
        fore_aft: of the hooves relative to the trunk in m, shape (T, 4).

    Returns:
        None if the clip does not hold two strides.
    """
    frames = len(fore_aft)
    centred = fore_aft - fore_aft.mean(axis=0)
    power = float((centred**2).mean())
    if frames < 8 or power < 1e-6:
        return None
    lags = np.arange(frames // 2 + 1)
    correlation = np.array(
        [(centred[: frames - lag] * centred[lag:]).mean() for lag in lags]
    )
    peaks, _ = find_peaks(correlation / power, height=0.5)
    if not len(peaks):
        return None
    # Sub-frame: the parabola through the peak and its neighbours.
    k = int(peaks[0])
    before, at, after = correlation[k - 1 : k + 2]
    return float(k + (before - after) / (2 * (before - 2 * at + after)))
