"""The tokenizer: a causal VQ-VAE with residual codebooks over motion features.

van den Oord et al. 2017 (VQ-VAE); Zeghidour et al. 2021 (residual quantization).
:mod:`loco_drake.generation.train_tokenizer` learns the codebooks; it is separate
because the quantization library takes seconds to import.
"""

import math
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional

from loco_drake.common.errors import InputError
from loco_drake.common.weights import load_network
from loco_drake.generation.features import CONTACTS, SIZE


@dataclass(frozen=True)
class TokenizerConfig:
    """Sizes of a :class:`Tokenizer`."""

    BEFORE: ClassVar = {"books": "codebooks", "book_size": "codebook_size"}

    # Robots of the training; encoder and decoder are conditioned on one.
    robots: tuple[str, ...] = ("go2",)
    frames_per_token: int = 4  # downsampling factor
    width: int = 128  # channels of the hidden layers at the rate of tokens
    depth: int = 3  # residual blocks at that rate, in encoder and decoder each
    frame_width: int = 48  # channels of the decoder's layers at the rate of frames
    code_size: int = 48  # dimension of a code
    codebooks: int = 12  # residual codebooks; a token is one code of each
    codebook_size: int = 128  # codes in a codebook
    # Those of ``robots``, the last ones, that were added after the training: codes mean
    # the same as before. The fingerprint does not depend on them.
    added: tuple[str, ...] = field(default=(), repr=False)
    # Those of ``added``, the last ones, that have layers of their own.
    bodies: tuple[str, ...] = field(default=(), repr=False)
    # Fingerprint of the tokenizer whose codes it has, if its decoder was fine-tuned.
    codes_of: str = field(default="", repr=False)

    @property
    def first(self) -> tuple[str, ...]:
        """Those of ``robots`` that were not added later."""
        return self.robots[: len(self.robots) - len(self.added)]


# Weights that have a row for each robot.
BODY_ROWS = ("decoder_robot.weight", "encoder_robot.weight")


class CausalConv(nn.Module):
    """A convolution over this and earlier times, (B, T, width) to the same.

    As one matrix product, which on a CPU is faster to train than nn.Conv1d.
    """

    def __init__(self, width: int, kernel: int) -> None:
        super().__init__()
        self.reach = kernel - 1  # times before the present that count
        self.linear = nn.Linear(width * kernel, width)

    def forward(self, x: Tensor) -> Tensor:
        """Convolves x, whose times before the first are 0."""
        time = x.shape[1]
        x = functional.pad(x, (0, 0, self.reach, 0))
        taps = [x[:, i : i + time] for i in range(self.reach + 1)]
        out: Tensor = self.linear(torch.cat(taps, dim=-1))
        return out


class ConvBlock(nn.Module):
    """Residual block: norm, causal convolution, nonlinearity, pointwise layer."""

    def __init__(self, width: int, kernel: int = 3) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.conv = CausalConv(width, kernel)
        self.reach = self.conv.reach
        self.out = nn.Linear(width, width)

    def forward(self, x: Tensor) -> Tensor:
        """Maps (B, T, width) to the same shape."""
        hidden = functional.silu(self.conv(self.norm(x)))
        out: Tensor = x + self.out(hidden)
        return out


class BodyLayers(nn.Module):
    """A robot's own layers, where features come in and go out."""

    def __init__(self, config: TokenizerConfig) -> None:
        super().__init__()
        frames = config.frames_per_token
        self.encoder_in = nn.Linear(SIZE * frames, config.width)
        self.decoder_in = nn.Linear(config.code_size, config.width)
        self.expand = nn.Linear(config.width, frames * config.frame_width)
        self.decoder_out = nn.Linear(config.frame_width, SIZE)


class Tokenizer(nn.Module):
    """A VQ-VAE: encoder, residual codebooks, decoder, feature statistics.

    A token covers ``frames_per_token`` frames. Encoder and decoder are causal: codes do
    not depend on later frames, nor frames on later tokens.
    """

    def __init__(self, config: TokenizerConfig) -> None:
        super().__init__()
        self.config = config
        width, frames = config.width, config.frames_per_token
        self.register_buffer("mean", torch.zeros(SIZE))
        self.register_buffer("std", torch.ones(SIZE))
        self.mean: Tensor
        self.std: Tensor
        self.encoder_robot = nn.Embedding(len(config.robots), width)
        self.decoder_robot = nn.Embedding(len(config.robots), width)
        # The frames of a token are concatenated, so that most layers run at the low
        # rate.
        self.encoder_in = nn.Linear(SIZE * frames, width)
        self.encoder = nn.Sequential(*(ConvBlock(width) for _ in range(config.depth)))
        self.encoder_out = nn.Linear(width, config.code_size)
        self.register_buffer(
            "codebooks",
            torch.zeros(config.codebooks, config.codebook_size, config.code_size),
        )
        self.codebooks: Tensor
        self.decoder_in = nn.Linear(config.code_size, width)
        decoder = [ConvBlock(width) for _ in range(config.depth)]
        smooth = [ConvBlock(config.frame_width, kernel=5) for _ in range(2)]
        self.decoder = nn.Sequential(*decoder)
        self.expand = nn.Linear(width, frames * config.frame_width)
        self.smooth = nn.Sequential(*smooth)
        self.decoder_out = nn.Linear(config.frame_width, SIZE)
        self.bodies = nn.ModuleList(BodyLayers(config) for _ in config.bodies)
        # Number of earlier tokens that the frames of a token can depend on.
        self.memory = sum(block.reach for block in decoder) + math.ceil(
            sum(block.reach for block in smooth) / frames
        )

    def check_books(self, books: int | None) -> None:
        """Raises InputError unless it has so many codebooks; None is all."""
        most = self.config.codebooks
        if books is not None and not 1 <= books <= most:
            raise InputError(
                f"--books must be from 1 to {most}, as many as the tokenizer has, not "
                f"{books}."
            )

    def set_statistics(self, mean: Tensor, std: Tensor) -> None:
        """Sets mean and deviation for normalization, those of features (SIZE,)."""
        self.mean.copy_(mean)
        # Do not amplify features that hardly vary.
        self.std.copy_(std.clamp(min=0.02))
        self.mean[CONTACTS], self.std[CONTACTS] = 0.5, 0.5

    def embed(self, features: Tensor, robot: Tensor) -> Tensor:
        """Returns vectors to quantize: (B, T, SIZE) -> (B, T / f, code_size).

        f is ``frames_per_token``; ``robot`` are indices into ``config.robots``, (B,).
        """
        batch, frames, _ = features.shape
        x = (features - self.mean) / self.std
        x = x.view(batch, frames // self.config.frames_per_token, -1)
        x = self._by_body("encoder_in", x, robot) + self.encoder_robot(robot)[:, None]
        out: Tensor = self.encoder_out(self.encoder(x))
        return out

    def encode(self, features: Tensor, robot: Tensor) -> Tensor:
        """Returns codes (B, T / frames_per_token, codebooks); see :meth:`embed`."""
        residual = self.embed(features, robot)
        codes = []
        for codebook in self.codebooks:
            nearest = torch.cdist(residual, codebook[None]).argmin(dim=-1)
            codes.append(nearest)
            residual = residual - codebook[nearest]
        return torch.stack(codes, dim=-1)

    def decode(self, codes: Tensor, robot: Tensor) -> Tensor:
        """Returns features (B, n * frames_per_token, SIZE), contacts as probabilities.

        Args:
            codes: of all codebooks or of the first few, shape (B, n, <= codebooks).
            robot: index into ``config.robots``, shape (B,).
        """
        features = self.decode_embedded(self.lookup(codes), robot)
        contacts = features[..., CONTACTS].sigmoid()
        return torch.cat((features[..., : CONTACTS.start], contacts), dim=-1)

    def lookup(self, codes: Tensor) -> Tensor:
        """Returns sums of code vectors: (B, n, codebooks) -> (B, n, code_size)."""
        codebooks = torch.arange(codes.shape[-1])
        total: Tensor = self.codebooks[codebooks, codes].sum(dim=-2)
        return total

    def decode_embedded(self, embedded: Tensor, robot: Tensor) -> Tensor:
        """Decodes vectors (B, n, code_size); contacts are logits."""
        x = self._by_body("decoder_in", embedded, robot)
        x = x + self.decoder_robot(robot)[:, None]
        # (B, n, frames * frame_width)
        x = self._by_body("expand", self.decoder(x), robot)
        x = x.view(x.shape[0], -1, self.config.frame_width)
        x = self._by_body("decoder_out", self.smooth(x), robot)
        # Denormalize all features except the contact logits.
        scaled = x * self.std + self.mean
        return torch.cat((scaled[..., : CONTACTS.start], x[..., CONTACTS]), dim=-1)

    def _by_body(self, layer: str, x: Tensor, robot: Tensor) -> Tensor:
        """Applies the layer of that name, each robot's own, to x (B, T, width)."""
        out: Tensor = getattr(self, layer)(x)
        first = len(self.config.robots) - len(self.bodies)
        for index, body in enumerate(self.bodies, first):
            own = robot == index
            if own.any():
                out = torch.where(own[:, None, None], getattr(body, layer)(x), out)
        return out

    @property
    def fingerprint(self) -> str:
        """Hash of these weights in 16 bits, as they are shipped.

        It says what codes mean, to which robots that were added later make no
        difference. A tokenizer whose decoder was fine-tuned has that from before.
        """
        if self.config.codes_of:
            return self.config.codes_of
        config = replace(self.config, robots=self.config.first)
        # With the field names of the first weights.
        digest = sha256(repr(config).replace("codebook", "book").encode())
        for name, value in sorted(self.state_dict().items()):
            if name.startswith("bodies."):
                continue
            if name in BODY_ROWS:
                value = value[: len(config.robots)]
            data = value.half() if value.is_floating_point() else value
            digest.update(name.encode() + data.contiguous().numpy().tobytes())
        return digest.hexdigest()[:16]


def load_tokenizer(path: Path) -> Tokenizer:
    """Reads a tokenizer, ready for inference.

    Raises:
        InputError: if the file is missing, damaged, or of something else.
    """
    return load_network(path, "tokenizer", Tokenizer, TokenizerConfig)
