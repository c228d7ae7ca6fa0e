"""The generator: a GPT over motion tokens for a gait, a speed and a duration.

It can be taught to be told the velocity of each token too, see :mod:`.telling`.

The transformer takes one step per token. Small heads sample the codes of a token's
codebooks in order, each given the transformer's output and the codes sampled so far, as
residual codebooks refine one another.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from loco_drake.common.weights import load_network
from loco_drake.generation import speed_rank
from loco_drake.generation.telling import Telling
from loco_drake.motion.gaits import LABELS, ONE_HOT, ONE_HOT_SIZE

# Durations are binned on a log scale; the last bin is "long" and never ends.
DURATION_BINS = 16
SHORTEST, LONGEST = 0.5, 16.0  # s


@dataclass(frozen=True)
class GeneratorConfig:
    """Sizes of a :class:`Generator`."""

    BEFORE: ClassVar = {"books": "codebooks", "book_size": "codebook_size"}

    tokenizer: str  # fingerprint of the tokenizer
    codebooks: int  # number of its codebooks to predict, the coarsest first
    codebook_size: int  # codes in a codebook
    frames_per_token: int  # frames that a token stands for
    labels: tuple[str, ...]  # names of the gait labels it was trained on
    window: int = 16  # tokens of context at the start of a chunk
    width: int = 128  # channels
    layers: int = 3  # transformer blocks
    heads: int = 4  # attention heads
    dropout: float = 0.1  # probability, while training
    told: bool = False  # whether it can be told velocities
    grounded: bool = False  # whether all motion that it was trained on was grounded


# Keys and values of a layer for the P times so far, each (B, heads, P, size).
Past = tuple[Tensor, Tensor]
Cache = list[Past]  # of all layers


class RotaryAttention(nn.Module):
    """Causal self-attention that knows only relative times (Su et al. 2021, RoPE)."""

    def __init__(self, config: GeneratorConfig) -> None:
        super().__init__()
        width = config.width
        self.heads = config.heads
        self.dropout = config.dropout
        self.qkv = nn.Linear(width, 3 * width, bias=False)
        self.out = nn.Linear(width, width, bias=False)
        size = width // self.heads
        rates = 1000.0 ** (-torch.arange(0, size, 2) / size)
        self.register_buffer("rates", rates, persistent=False)
        self.rates: Tensor

    def forward(self, x: Tensor, past: Past | None) -> tuple[Tensor, Past]:
        """Attends from the T times of x (B, T, width) to them and to ``past``.

        With a past, T must be 1. Returns the output, shaped as x, and all P + T times.
        """
        batch, time, width = x.shape
        # (B, T, 3 * width) -> (3, B, heads, T, size)
        qkv = self.qkv(x).view(batch, time, 3, self.heads, -1).permute(2, 0, 3, 1, 4)
        start = 0 if past is None else past[0].shape[2]
        times = torch.arange(start, start + time, device=x.device)
        angles = times[:, None] * self.rates
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


class Block(nn.Module):
    """A transformer block: attention, then a feed-forward layer."""

    def __init__(self, config: GeneratorConfig) -> None:
        super().__init__()
        width = config.width
        self.norm_attention = nn.LayerNorm(width)
        self.attention = RotaryAttention(config)
        self.mlp = nn.Sequential(
            nn.LayerNorm(width),
            nn.Linear(width, 4 * width),
            nn.GELU(),
            nn.Linear(4 * width, width),
        )
        self.dropout = nn.Dropout(config.dropout)

    def forward(self, x: Tensor, past: Past | None) -> tuple[Tensor, Past]:
        """Maps (B, T, width) to the same; see :class:`RotaryAttention`."""
        attended, present = self.attention(self.norm_attention(x), past)
        x = x + self.dropout(attended)
        return x + self.dropout(self.mlp(x)), present


class Generator(nn.Module):
    """A GPT over tokens, conditioned at every step on label, speed and duration.

    Step t takes the codes of token t - 1 and the condition of token t, and predicts the
    codes of token t. The code ``codebook_size`` marks the start of a sequence.
    """

    def __init__(self, config: GeneratorConfig) -> None:
        super().__init__()
        self.config = config
        width, codebooks, size = config.width, config.codebooks, config.codebook_size
        self.register_buffer(
            "one_hot", torch.tensor(ONE_HOT, dtype=torch.float32), persistent=False
        )
        self.one_hot: Tensor
        # Tables of all codebooks lie in one; codebook j begins at row j * (size + 1).
        self.codes_in = nn.Embedding(codebooks * (size + 1), width)
        self.gait_in = nn.Linear(ONE_HOT_SIZE, width, bias=False)
        # pace_in and earlier_books are the names in the shipped weights.
        self.pace_in = nn.Embedding(speed_rank.BINS, width)
        # Stand heights per second, see speed_rank.speed_edges.
        self.register_buffer(
            "speed_edges", torch.zeros(len(LABELS), speed_rank.BINS - 1)
        )
        self.speed_edges: Tensor
        self.duration_in = nn.Embedding(DURATION_BINS, width)
        self.dropout = nn.Dropout(config.dropout)
        self.blocks = nn.ModuleList(Block(config) for _ in range(config.layers))
        self.norm = nn.LayerNorm(width)
        self.earlier_books = nn.Embedding(codebooks * (size + 1), width)
        self.head_in = nn.ModuleList(nn.Linear(width, width) for _ in range(codebooks))
        self.head_out = nn.ModuleList(
            nn.Sequential(nn.GELU(), nn.LayerNorm(width), nn.Linear(width, size))
            for _ in range(codebooks)
        )
        self.apply(_initialize)
        self.telling: Telling | None = None
        if config.told:
            self.telling = Telling(width, config.layers, config.dropout)

    def trunk(
        self,
        before: Tensor,
        labels: Tensor,
        speed_bins: Tensor,
        duration: Tensor,
        cache: Cache | None = None,
        velocities: Tensor | None = None,
    ) -> tuple[Tensor, Cache]:
        """Returns the input of the heads, shape (B, T, width), and a cache.

        Args:
            before: codes of the token before each step, shape (B, T, codebooks).
            labels: index into gaits.LABELS of each step's token, shape (B, T).
            speed_bins: see :mod:`.speed_rank`, shape (B, T) or (B, 1).
            duration: bin of the sequence's duration, shape (B,).
            cache: that of the steps before, then T must be 1.
            velocities: told of each step's token, NaN where nothing is, see
                :mod:`.telling`; shape (B, T, 3). They replace the speed.

        Raises:
            ValueError: if it was not taught to be told velocities.
        """
        books = torch.arange(self.config.codebooks, device=before.device)
        offset = books * (self.config.codebook_size + 1)
        x = self.codes_in(before + offset).sum(dim=-2)  # (B, T, width)
        if velocities is not None:
            if self.telling is None:
                raise ValueError("the generator was not taught velocities")
            velocities = self.telling.bounded(velocities, labels)
            embedded, told = self.telling.embed(velocities)
            own = (velocities[..., :1] > self.speed_edges[labels]).sum(dim=-1)
            speed_bins = torch.where(told[..., 0], own, speed_bins)
        x = x + self.gait_in(self.one_hot[labels]) + self.pace_in(speed_bins)
        x = x + self.duration_in(duration)[:, None]
        x = self.dropout(x)
        present: Cache = []
        for i, block in enumerate(self.blocks):
            if velocities is not None and self.telling is not None:
                x = self.telling.adapt(i, x, embedded, told)
            x, kv = block(x, None if cache is None else cache[i])
            present.append(kv)
        if velocities is not None and self.telling is not None:
            x = self.telling.adapt(len(self.blocks), x, embedded, told)
        return self.norm(x), present

    def heads(
        self, hidden: Tensor, choose: Callable[[int, Tensor], Tensor]
    ) -> tuple[Tensor, Tensor]:
        """Returns logits (..., codebooks, codebook_size) and codes (..., codebooks).

        Args:
            hidden: output of the trunk, shape (..., width).
            choose: returns the codes (...) of a codebook, given its index and logits;
                later heads see them.
        """
        earlier = torch.zeros_like(hidden)
        logits, codes = [], []
        for codebook in range(self.config.codebooks):
            seen = self.head_in[codebook](hidden) + earlier
            logits.append(self.head_out[codebook](seen))
            codes.append(choose(codebook, logits[-1]))
            first = codebook * (self.config.codebook_size + 1)
            earlier = earlier + self.earlier_books(codes[-1] + first)
        return torch.stack(logits, dim=-2), torch.stack(codes, dim=-1)

    def forward(
        self,
        before: Tensor,
        labels: Tensor,
        speed_bins: Tensor,
        duration: Tensor,
        codes: Tensor,
        velocities: Tensor | None = None,
    ) -> Tensor:
        """Returns logits (B, T, codebooks, codebook_size) of the tokens ``codes``.

        Logits of a codebook depend on ``before`` up to their step and, within the step,
        on ``codes`` of earlier codebooks. For the arguments see :meth:`trunk`.
        """
        hidden, _ = self.trunk(
            before, labels, speed_bins, duration, velocities=velocities
        )
        logits, _ = self.heads(hidden, lambda codebook, _: codes[..., codebook])
        return logits

    @torch.inference_mode()
    def sample(
        self,
        history: Tensor,
        labels: Tensor,
        speed_bins: Tensor,
        duration: Tensor,
        uniforms: Tensor,
        temperature: float,
        top_p: float,
        velocities: Tensor | None = None,
    ) -> Tensor:
        """Samples the codes (B, n, codebooks) of n tokens that continue ``history``.

        Args:
            history: codes of the H >= 0 tokens before, shape (B, H, codebooks).
            labels: of the tokens from one after the first in ``history`` to the last
                new one (without history: of the new ones), shape (B, H - 1 + n), or
                (B, n).
            speed_bins: of the sequence, shape (B, 1).
            duration: see :meth:`trunk`.
            uniforms: random numbers in [0, 1), shape (B, n, codebooks).
            temperature: divides the logits; 0 is greedy.
            top_p: sample from the likeliest codes that together reach it.
            velocities: of the tokens that ``labels`` are of, see :meth:`trunk`.
        """
        batch, steps, codebooks = uniforms.shape
        if history.shape[1] == 0:
            history = torch.full((batch, 1, codebooks), self.config.codebook_size)
        tokens: list[Tensor] = []
        before, seen, cache = history, 0, None

        def choose(codebook: int, logits: Tensor) -> Tensor:
            dice = uniforms[:, len(tokens), codebook]
            return draw(logits, dice, temperature, top_p)

        while len(tokens) < steps:
            now = slice(seen, seen + before.shape[1])
            hidden, cache = self.trunk(
                before,
                labels[:, now],
                speed_bins,
                duration,
                cache,
                None if velocities is None else velocities[:, now],
            )
            seen += before.shape[1]
            _, codes = self.heads(hidden[:, -1], choose)
            before = codes[:, None]  # (B, 1, codebooks)
            tokens.append(before)
        return torch.cat(tokens, dim=1)


def draw(logits: Tensor, uniforms: Tensor, temperature: float, top_p: float) -> Tensor:
    """Samples codes (B,) of logits (B, N) by nucleus sampling (Holtzman et al. 2020).

    A code is where the cumulated probability of the codes, likeliest first, passes the
    uniform number (B,). For temperature and top_p see :meth:`Generator.sample`.
    """
    if temperature == 0:
        return logits.argmax(dim=-1)
    ordered, order = (logits / temperature).sort(dim=-1, descending=True, stable=True)
    cumulated = ordered.softmax(dim=-1).double().cumsum(dim=-1)
    # The nucleus is the shortest head of the list that reaches top_p.
    size = (cumulated < top_p).sum(dim=-1, keepdim=True).clamp(max=logits.shape[-1] - 1)
    total = cumulated.gather(-1, size)
    place = (cumulated <= uniforms[:, None] * total).sum(dim=-1, keepdim=True)
    return order.gather(-1, torch.minimum(place, size))[:, 0]


def duration_bin(seconds: NDArray[np.float64] | float) -> NDArray[np.int64]:
    """Returns the bin of durations; those beyond LONGEST share the last."""
    place = np.log(np.asarray(seconds) / SHORTEST) / math.log(LONGEST / SHORTEST)
    bins = np.floor(place * (DURATION_BINS - 1))
    return np.clip(bins, 0, DURATION_BINS - 1).astype(np.int64)


def _initialize(module: nn.Module) -> None:
    """Initializes weights as in GPT-2 (Radford et al. 2019)."""
    if isinstance(module, nn.Linear | nn.Embedding):
        nn.init.normal_(module.weight, std=0.02)
    if isinstance(module, nn.Linear) and module.bias is not None:
        nn.init.zeros_(module.bias)


def load_generator(path: Path) -> Generator:
    """Reads a generator, ready for inference.

    Raises:
        InputError: if the file is missing, damaged, or of something else.
    """
    return load_network(path, "generator", Generator, GeneratorConfig)
