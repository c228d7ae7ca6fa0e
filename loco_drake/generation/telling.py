"""Telling: the velocity of each token, which a generator can be asked for.

A velocity is forward, sideways, yaw rate in the heading frame H of
:mod:`loco_drake.generation.features`, in stand heights/s and rad/s. It is averaged over
about two strides, since swaying is no command. NaN means that nothing is told.

Adapters (Houlsby et al. 2019) beside the transformer's blocks act on tokens that are
told a velocity, and on no other. Only they learn it, so a generator that is told
nothing stays the one that was taught, to the last bit.
"""

from collections import defaultdict
from collections.abc import Iterable

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import convolve1d
from torch import Tensor, nn

from loco_drake.common.arrays import Array
from loco_drake.generation.features import VELOCITY, YAW_RATE
from loco_drake.motion.gaits import LABELS

AXES = YAW_RATE.stop  # of a velocity
_WINDOW = np.hanning(53)[1:-1]  # 1 s
_HIDDEN = 128  # channels of an adapter
# Shares of a label's motion that are slower, and faster, than what it can be told.
_TAIL = 0.01


def token_velocities(features: Array, frames_per_token: int) -> Array:
    """Returns the mean velocity around each token, shape (T / f, AXES).

    Features are (T, SIZE).
    """
    frames = len(features) // frames_per_token * frames_per_token
    velocity = features[:frames, VELOCITY.start : YAW_RATE.stop]
    total, count = (
        convolve1d(a, _WINDOW, axis=0, mode="constant")
        for a in (velocity, np.ones_like(velocity))
    )
    mean = total / count
    return np.asarray(mean.reshape(-1, frames_per_token, AXES).mean(axis=1))


def told_bounds(velocities: Iterable[tuple[int, Array]]) -> tuple[Array, Array]:
    """Returns the least and the greatest velocity of each label, (labels, AXES) each.

    Takes label and :func:`token_velocities` of all clips. Labels without any have 0.
    """
    by_label: dict[int, list[Array]] = defaultdict(list)
    for label, of_clip in velocities:
        by_label[label].append(of_clip)
    low, high = np.zeros((2, len(LABELS), AXES))
    for label, clips in by_label.items():
        shares = (_TAIL, 1 - _TAIL)
        low[label], high[label] = np.quantile(np.concatenate(clips), shares, axis=0)
    return low, high


class Telling(nn.Module):
    """Adapters through which a velocity reaches the transformer.

    Adapter i acts before block i, the last one after all blocks. They add nothing at
    first.
    """

    def __init__(self, width: int, layers: int, dropout: float) -> None:
        super().__init__()
        # What can be told of each label; velocities beyond are told as the nearest.
        self.register_buffer("low", torch.zeros(len(LABELS), AXES))
        self.register_buffer("high", torch.zeros(len(LABELS), AXES))
        self.low: Tensor
        self.high: Tensor
        self.velocity_in = nn.Sequential(
            nn.Linear(AXES, width), nn.GELU(), nn.Linear(width, width)
        )
        self.adapters = nn.ModuleList(
            _adapter(width, dropout) for _ in range(layers + 1)
        )

    def bounded(self, velocities: Tensor, labels: Tensor) -> Tensor:
        """Returns the velocities (B, T, AXES) within the bounds of labels (B, T)."""
        return velocities.clamp(self.low[labels], self.high[labels])

    def embed(self, velocities: Tensor) -> tuple[Tensor, Tensor]:
        """Returns embedded velocities, (B, T, width), and which are told, (B, T, 1)."""
        told = velocities.isfinite().all(dim=-1, keepdim=True)
        embedded: Tensor = self.velocity_in(velocities.nan_to_num())
        return embedded, told

    def adapt(self, index: int, x: Tensor, embedded: Tensor, told: Tensor) -> Tensor:
        """Returns x (B, T, width) as adapter ``index`` changes it where it is told."""
        return torch.where(told, x + self.adapters[index](x + embedded), x)


def _adapter(width: int, dropout: float) -> nn.Sequential:
    """Returns an adapter that is zero at first."""
    last = nn.Linear(_HIDDEN, width)
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    return nn.Sequential(
        nn.LayerNorm(width),
        nn.Linear(width, _HIDDEN),
        nn.GELU(),
        nn.Dropout(dropout),
        last,
    )


def is_told(velocities: NDArray[np.float64]) -> bool:
    """Returns whether any velocity of (..., AXES) is told."""
    return bool(np.isfinite(velocities).any())
