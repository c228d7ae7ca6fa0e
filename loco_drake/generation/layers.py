"""Causal layers: what comes out at a time depends on nothing later.

Sequences are (batch, time, channels) throughout.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional


class CausalConv(nn.Module):
    """A 1-D convolution over this and earlier times.

    As one matrix product, which on a CPU is faster to train than nn.Conv1d.

    Args:
        inputs: input channels.
        outputs: output channels.
        kernel: taps.
    """

    def __init__(self, inputs: int, outputs: int, kernel: int) -> None:
        super().__init__()
        self.reach = kernel - 1  # times before the present that count
        self.linear = nn.Linear(inputs * kernel, outputs)

    def forward(self, x: Tensor) -> Tensor:
        """Maps (B, T, inputs) to (B, T, outputs)."""
        time = x.shape[1]
        x = functional.pad(x, (0, 0, self.reach, 0))
        taps = [x[:, i : i + time] for i in range(self.reach + 1)]
        out: Tensor = self.linear(torch.cat(taps, dim=-1))
        return out


class ConvBlock(nn.Module):
    """Residual block: norm, causal convolution, nonlinearity, pointwise layer.

    Args:
        width: channels.
        kernel: taps of the convolution.
    """

    def __init__(self, width: int, kernel: int = 3) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.conv = CausalConv(width, width, kernel)
        self.reach = self.conv.reach
        self.out = nn.Linear(width, width)

    def forward(self, x: Tensor) -> Tensor:
        """Maps (B, T, width) to the same shape."""
        hidden = functional.silu(self.conv(self.norm(x)))
        out: Tensor = x + self.out(hidden)
        return out


class RotaryAttention(nn.Module):
    """Causal self-attention that knows only relative times (Su et al. 2021, RoPE).

    Args:
        width: channels.
        heads: attention heads; ``width / heads`` must be even.
        dropout: probability of dropping an attention weight while training.
    """

    def __init__(self, width: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.heads = heads
        self.dropout = dropout
        self.qkv = nn.Linear(width, 3 * width, bias=False)
        self.out = nn.Linear(width, width, bias=False)
        size = width // heads
        rates = 1000.0 ** (-torch.arange(0, size, 2) / size)
        self.register_buffer("rates", rates, persistent=False)
        self.rates: Tensor

    def forward(
        self, x: Tensor, past: tuple[Tensor, Tensor] | None = None
    ) -> tuple[Tensor, tuple[Tensor, Tensor]]:
        """Attends from the times of ``x`` to them and to those in ``past``.

        Args:
            x: shape (B, T, width).
            past: keys and values of P earlier times, each (B, heads, P, size).

        Returns:
            Output of the shape of ``x``; keys and values of all P + T times.
        """
        batch, time, width = x.shape
        # (B, T, 3 * width) -> (3, B, heads, T, size)
        qkv = self.qkv(x).view(batch, time, 3, self.heads, -1).permute(2, 0, 3, 1, 4)
        start = 0 if past is None else past[0].shape[2]
        angles = torch.arange(start, start + time)[:, None] * self.rates
        q, k = turn_channels(qkv[:2], angles.cos(), angles.sin())
        v = qkv[2]
        if past is not None:
            if time > 1:
                raise ValueError("with a past, times come one by one")
            k, v = torch.cat((past[0], k), dim=2), torch.cat((past[1], v), dim=2)
        attended = functional.scaled_dot_product_attention(
            q,
            k,
            v,
            dropout_p=self.dropout if self.training else 0.0,
            is_causal=past is None and time > 1,
        )
        out: Tensor = self.out(attended.transpose(1, 2).reshape(batch, time, width))
        return out, (k, v)


def turn_channels(x: Tensor, cos: Tensor, sin: Tensor) -> Tensor:
    """Rotates pairs of channels of (..., T, size) by angles (T, size / 2)."""
    a, b = x.chunk(2, dim=-1)
    return torch.cat((a * cos - b * sin, a * sin + b * cos), dim=-1)
