"""A motion model generates endless motion chunk by chunk."""

import math
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from loco_drake.common.determinism import single_thread, uniforms
from loco_drake.common.errors import InputError
from loco_drake.common.immutable import Immutable
from loco_drake.common.rotations import quat_error, rotate_plane
from loco_drake.generation.footing import Footing, start_footing, step_footing
from loco_drake.generation.generator import Generator, duration_bin, load_generator
from loco_drake.generation.speed_rank import drawn_rank, rank_bin
from loco_drake.generation.telling import is_told
from loco_drake.generation.tokenizer import Tokenizer, load_tokenizer
from loco_drake.models.robots import ROBOTS, Robot, get_robot
from loco_drake.models.shipped import network_path
from loco_drake.motion.gaits import LABELS, ROW_LABELS
from loco_drake.motion.motion import FPS

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

CHUNK_SECONDS = 1.0
_LEARN_BODY = (
    " Let a tokenizer learn its body with loco-drake train tokenizer --add-to, see "
    "docs/own_robot.md."
)
SETTLING = 4  # frames before the first one, in which feet reach the ground


@dataclass(frozen=True, eq=False)
class Stream(Immutable):
    """Immutable state of B motions in generation.

    One frame is held back, since its velocity needs the frame after it.
    """

    seeds: Integers  # (B,)
    duration: Array  # intended, s, (B,)
    speed_rank: Array  # in [0, 1], see speed_rank.py, (B,)
    chunk: int  # number of chunks so far
    tokens: Integers  # the latest ones, (B, n, codebooks)
    labels: Integers  # of the tokens, index into gaits.LABELS, (B, n)
    told: Array  # velocities of the tokens, see telling.py; NaN: not told, (B, n, 3)
    footing: Footing  # after the frame held back
    q: Array  # last frame returned and the one held back, (B, 2, 19); or (B, 0, 19)
    contacts: NDArray[np.bool_]  # of the frame held back, (B, 4)

    def __post_init__(self) -> None:
        for value in (*vars(self).values(), *vars(self.footing).values()):
            if isinstance(value, np.ndarray):
                value.setflags(write=False)


@dataclass(frozen=True, eq=False)
class Frames:
    """Consecutive frames of B motions at motion.FPS, in the order of Drake's plant."""

    q: Array  # R_WB as w, x, y, z, p_WB in m, joints in rad, (B, n, 19)
    # Central differences: w_WB_W in rad/s, v_WB_W in m/s, joints in rad/s, (B, n, 18).
    v: Array
    contacts: NDArray[np.bool_]  # feet in stance, (B, n, 4)
    labels: Integers  # index into gaits.LABELS, (B, n)

    def __getitem__(self, index: int) -> "Frames":
        """Returns the frames of one motion, without the first axis."""
        return Frames(**{name: value[index] for name, value in vars(self).items()})


class MotionModel:
    """Tokenizer and generator as one source of motion of a robot. Immutable.

    Raises:
        InputError: if the generator was trained with another tokenizer, or the
            tokenizer does not know the robot.
    """

    def __init__(self, tokenizer: Tokenizer, generator: Generator, robot: str) -> None:
        made = get_robot(robot)
        if generator.config.tokenizer != tokenizer.fingerprint:
            raise InputError(
                f"The generator's weights are for the tokenizer "
                f"{generator.config.tokenizer}, not for {tokenizer.fingerprint}; "
                f"train the generator again after the tokenizer."
            )
        if made.name not in tokenizer.config.robots:
            raise InputError(
                f"The tokenizer's weights are not for the robot {made.name!r}; "
                f"there are weights for {', '.join(tokenizer.config.robots)}."
                + _LEARN_BODY
                * (made.name not in ROBOTS)
            )
        self.tokenizer = tokenizer.eval()
        self.generator = generator.eval()
        # Batching changes sums in their last bits. In 64 bits this is too little to
        # change a code or a contact.
        self._writer = deepcopy(self.generator).double()
        self._decoder = deepcopy(self.tokenizer).double()
        self.robot: Robot = made
        # Whether it learned from grounded motion only.
        self.grounded = generator.config.grounded
        self.frames_per_token = tokenizer.config.frames_per_token
        self.chunk_tokens = round(CHUNK_SECONDS * FPS / self.frames_per_token)
        self.chunk_frames = self.chunk_tokens * self.frames_per_token
        # Tokens at the beginning of a stream that only give context.
        settling = math.ceil(SETTLING / self.frames_per_token)
        self.lead = max(tokenizer.memory, settling)
        self._robot_index = tokenizer.config.robots.index(made.name)
        known = generator.config.labels
        self._known = {i for i, label in enumerate(LABELS) if str(label) in known}

    def start(
        self,
        seeds: Integers,
        duration: Array | float = 3600.0,
        pose: Array | None = None,
        speed_rank: Array | float | None = None,
    ) -> Stream:
        """Returns an empty stream of B motions, each of which depends on its seed only.

        Args:
            seeds: not negative, shape (B,).
            duration: intended duration, s, shape (B,) or for all.
            pose: x, y in m and yaw in rad of the first frame, shape (B, 3); default 0.
            speed_rank: rank in [0, 1] of the speed among the recorded speeds of the
                gait, shape (B,) or for all; drawn for each seed by default.
        """
        seeds = np.array(seeds, dtype=np.int64)
        batch = len(seeds)
        if speed_rank is None:
            speed_rank = drawn_rank(seeds)
        pose = np.zeros((batch, 3)) if pose is None else np.array(pose, np.float64)
        return Stream(
            seeds=seeds,
            duration=np.full(batch, duration, dtype=np.float64),
            speed_rank=np.full(batch, speed_rank, dtype=np.float64),
            chunk=0,
            tokens=np.zeros((batch, 0, self.generator.config.codebooks), np.int64),
            labels=np.zeros((batch, 0), dtype=np.int64),
            told=np.zeros((batch, 0, 3)),
            footing=start_footing(pose),
            q=np.zeros((batch, 0, 19)),
            contacts=np.zeros((batch, 4), dtype=np.bool_),
        )

    def extend(
        self,
        stream: Stream,
        labels: Integers,
        *,
        velocity: Array | None = None,
        temperature: float = 1.0,
        top_p: float = 0.95,
    ) -> tuple[Stream, Frames]:
        """Returns the stream extended by a chunk, and the ``chunk_frames`` of it.

        Random numbers are functions of seed and chunk, so extending a stream again in
        the same way gives the same frames.

        Args:
            stream: the stream, which is not modified.
            labels: index into gaits.LABELS of each motion (B,), or of each of its
                new tokens (B, chunk_tokens).
            velocity: forward and sideways in m/s and yaw rate in rad/s, in the heading
                frame, that each motion (B, 3), or each of its new tokens (B,
                chunk_tokens, 3), is told; the nearest that was recorded of its gait is
                told. NaN tells nothing, as does None.
            temperature: see :meth:`Generator.sample`.
            top_p: see :meth:`Generator.sample`.

        Raises:
            InputError: if the weights were not trained on a label, or a velocity is to
                be told to weights that were not taught it.
        """
        batch = len(stream.seeds)
        labels = np.asarray(labels, dtype=np.int64)
        self.check_labels(labels)
        told = self._in_stand_heights(velocity, batch)
        new = np.broadcast_to(labels.reshape(batch, -1), (batch, self.chunk_tokens))
        # The first tokens only provide context for the decoder.
        lead = 0 if stream.chunk else self.lead
        new = np.concatenate((np.repeat(new[:, :1], lead, axis=1), new), axis=1)
        told = np.concatenate((np.repeat(told[:, :1], lead, axis=1), told), axis=1)
        shape = (new.shape[1], self.generator.config.codebooks)
        dice = [uniforms(int(seed), stream.chunk, shape) for seed in stream.seeds]
        window = self.generator.config.window
        history, given = stream.tokens[:, -window:], stream.labels[:, -window:]
        velocities = np.concatenate((stream.told[:, -window:][:, 1:], told), axis=1)
        with single_thread():
            drawn = self._writer.sample(
                torch.from_numpy(history.copy()),
                torch.from_numpy(np.concatenate((given[:, 1:], new), axis=1)),
                torch.from_numpy(rank_bin(stream.speed_rank)[:, None]),
                torch.from_numpy(duration_bin(stream.duration)),
                torch.from_numpy(np.stack(dice)),
                temperature,
                top_p,
                torch.from_numpy(velocities) if is_told(velocities) else None,
            )
        return self.append(stream, drawn.numpy(), new, told)

    def append(
        self, stream: Stream, tokens: Integers, labels: Integers, told: Array
    ) -> tuple[Stream, Frames]:
        """Decodes tokens (B, n, codebooks), of labels (B, n), that continue ``stream``.

        ``told`` are the velocities that they were told, (B, n, 3), as in a stream. For
        an empty stream, the frames of the first ``lead`` tokens are not returned.
        """
        before = stream.tokens.shape[1]
        window = np.concatenate((stream.tokens, tokens), axis=1)
        window_labels = np.concatenate((stream.labels, labels), axis=1)
        seen = min(before, self.tokenizer.memory)
        with torch.inference_mode(), single_thread():
            decoded = self._decoder.decode(
                torch.from_numpy(window[:, before - seen :]),
                torch.full((len(tokens),), self._robot_index),
            )
        features = decoded.numpy()[:, seen * self.frames_per_token :]
        footing, q, held = stream.footing, stream.q, stream.contacts[:, None]
        if not stream.chunk:
            lead = self.lead * self.frames_per_token
            footing, q, held = self._settle(
                footing, features[:, lead - SETTLING : lead]
            )
            features = features[:, lead:]
        footing, q_new, contacts = step_footing(self.robot, footing, features)
        q = np.concatenate((q, q_new), axis=1)
        contacts = np.concatenate((held, contacts), axis=1)
        frame_labels = np.repeat(
            window_labels[:, -features.shape[1] // self.frames_per_token - 1 :],
            self.frames_per_token,
            axis=1,
        )
        # All new ones, too, from which a caller can go back.
        keep = max(self.generator.config.window, self.tokenizer.memory, tokens.shape[1])
        after = replace(
            stream,
            chunk=stream.chunk + 1,
            tokens=window[:, -keep:].copy(),
            labels=window_labels[:, -keep:].copy(),
            told=np.concatenate((stream.told, told), axis=1)[:, -keep:].copy(),
            footing=footing,
            q=q[:, -2:].copy(),
            contacts=contacts[:, -1].copy(),
        )
        earlier, later = q[:, :-2], q[:, 2:]
        turn = quat_error(earlier[..., :4], later[..., :4])
        frames = Frames(
            q=q[:, 1:-1],
            v=np.concatenate((turn, later[..., 4:] - earlier[..., 4:]), -1) * (FPS / 2),
            contacts=contacts[:, :-1],
            labels=frame_labels[:, self.frames_per_token - 1 : -1],
        )
        return after, frames

    def _settle(
        self, footing: Footing, features: Array
    ) -> tuple[Footing, Array, NDArray[np.bool_]]:
        """Plays the frames before the first so that the last is at the start pose.

        Returns the footing, the last two frames (B, 2, 19) and contacts of the last.
        """
        there, _, _ = step_footing(
            self.robot, start_footing(np.zeros_like(footing.pose)), features
        )
        turn = footing.pose[:, 2] - there.pose[:, 2]
        xy = footing.pose[:, :2] - rotate_plane(there.pose[:, :2], turn)
        start = np.concatenate((xy, turn[:, None]), axis=-1)
        after, q, contacts = step_footing(self.robot, start_footing(start), features)
        return after, q[:, -2:], contacts[:, -1:]

    def _in_stand_heights(self, velocity: Array | None, batch: int) -> Array:
        """Returns the velocities of a chunk's tokens as telling.py has them."""
        shape = (batch, self.chunk_tokens, 3)
        if velocity is None or not is_told(velocity):
            return np.full(shape, np.nan)
        self.check_told()
        velocity = np.asarray(velocity, dtype=np.float64).reshape(batch, -1, 3)
        height = self.robot.stand_height
        return np.broadcast_to(velocity / [height, height, 1.0], shape)

    def check_told(self) -> None:
        """Raises InputError if the weights were not taught to be told velocities."""
        if not self.generator.config.told:
            raise InputError(
                "The generator was not taught velocities; `loco-drake train generator "
                "--teach` teaches it."
            )

    def check_labels(self, labels: Integers) -> None:
        """Raises InputError if the weights were not trained on one of ``labels``."""
        unknown = sorted(set(labels.ravel().tolist()) - self._known)
        if unknown:
            names = [str(ROW_LABELS[i]) for i in unknown]
            raise InputError(
                f"The generator was not trained on {', '.join(names)}; "
                f"it was on {', '.join(self.generator.config.labels)}."
            )


def load_motion_model(tokenizer: Path, generator: Path, robot: str) -> MotionModel:
    """Reads both weights files.

    Raises:
        InputError: if one is missing or damaged, or they do not belong together.
    """
    return MotionModel(load_tokenizer(tokenizer), load_generator(generator), robot)


def motion_model_of(
    robot: str, tokenizer: Path | None = None, generator: Path | None = None
) -> MotionModel:
    """Returns a motion model for ``robot``; None stands for the shipped weights.

    The shipped model is loaded once.

    Raises:
        InputError: as :func:`load_motion_model`.
    """
    if tokenizer is generator is None:
        return pretrained_motion_model(robot)
    made = get_robot(robot)
    return load_motion_model(
        tokenizer or network_path(made, "tokenizer"),
        generator or network_path(made, "generator"),
        robot,
    )


@lru_cache
def pretrained_motion_model(robot: str) -> MotionModel:
    """Returns the motion model for ``robot``, loaded once.

    It is the shipped one, or that in the folder that the robot's file names.

    Raises:
        InputError: if there are no weights for that robot.
    """
    made = get_robot(robot)
    return load_motion_model(
        network_path(made, "tokenizer"), network_path(made, "generator"), robot
    )
