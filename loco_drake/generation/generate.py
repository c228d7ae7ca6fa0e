"""Generation of whole motions with a motion model."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError, check_bounds
from loco_drake.generation.motion_model import MotionModel
from loco_drake.motion.gaits import ROW_LABELS, GaitLabel, GaitSchedule, parse_label
from loco_drake.motion.motion import FPS, GROUNDED, LEARNED_FROM, Motion

Integers = NDArray[np.int64]

# Label of a motion with several gaits.
SEVERAL = GaitLabel("several", "gaits")
LONGEST_DURATION = 600.0  # s


def generate_motions(
    model: MotionModel,
    gait: GaitLabel | GaitSchedule,
    duration: float,
    seeds: Sequence[int],
    *,
    temperature: float = 1.0,
    top_p: float = 0.95,
    speed_rank: float | None = None,
    velocity: ArrayLike | None = None,
) -> list[Motion]:
    """Generates one motion for each seed, in one batch.

    Args:
        model: shipped, or of one's own training.
        gait: one that the generator was trained on, or several after each other.
            The motion's label is then SEVERAL; ``gait_changes`` says which.
        duration: from first to last frame, in s, at most LONGEST_DURATION.
        seeds: not negative; each motion depends on its own only.
        temperature: see :meth:`.Generator.sample`.
        top_p: see there.
        speed_rank: see :meth:`.MotionModel.start`.
        velocity: what all motions are told, see :meth:`.MotionModel.extend`, shape
            (3,), or what the tokens of each are, (B, n, 3); the last one holds.

    Raises:
        InputError: if an argument is not as said.
    """
    check_duration(duration)
    check_sampling(temperature, top_p, speed_rank)
    told = _told(model, velocity, len(seeds))
    schedule = GaitSchedule((gait,)) if isinstance(gait, GaitLabel) else gait
    schedule.check_ends_by(duration)
    if any(seed < 0 for seed in seeds):
        raise InputError("Seeds must be 0 or more.")
    count = round(duration * FPS) + 1
    stream = model.start(np.array(seeds), duration, speed_rank=speed_rank)
    label = schedule.labels[0] if len(schedule.labels) == 1 else SEVERAL
    parts = []
    for chunk in range(-(-count // model.chunk_frames)):
        labels = np.tile(
            token_labels(model, schedule, chunk * model.chunk_tokens), (len(seeds), 1)
        )
        tokens = chunk * model.chunk_tokens + np.arange(model.chunk_tokens)
        velocities = (
            None if told is None else told[:, tokens.clip(0, told.shape[1] - 1)]
        )
        stream, frames = model.extend(
            stream,
            labels,
            velocity=velocities,
            temperature=temperature,
            top_p=top_p,
        )
        parts.append(frames)
    q, v, contacts, rows = (
        np.concatenate([getattr(part, name) for part in parts], axis=1)[:, :count]
        for name in ("q", "v", "contacts", "labels")
    )
    changes = [0, *(np.flatnonzero(np.diff(rows[0])) + 1).tolist()]
    gait_changes = tuple((k, ROW_LABELS[rows[0, k]]) for k in changes)
    return [
        Motion(
            robot=model.robot.name,
            source=label.source,
            gait=label.gait,
            fps=FPS,
            joint_names=model.robot.joint_names,
            base_position=q[i, :, 4:7].copy(),
            base_quaternion=q[i, :, :4].copy(),
            joint_positions=q[i, :, 7:].copy(),
            base_velocity=v[i, :, 3:6].copy(),
            base_angular_velocity=v[i, :, :3].copy(),
            joint_velocities=v[i, :, 6:].copy(),
            contacts=contacts[i].copy(),
            provenance={
                "generated": f"{schedule} for {duration:g} s",
                "seed": str(seed),
                "temperature": f"{temperature:g}",
                "top_p": f"{top_p:g}",
                "pace": f"{stream.speed_rank[i]:.4g}",
                **({} if told is None else {"told": _text(told[i])}),
                "tokenizer": model.tokenizer.fingerprint,
                **({LEARNED_FROM: GROUNDED} if model.grounded else {}),
            },
            gait_changes=gait_changes if label == SEVERAL else (),
        )
        for i, seed in enumerate(seeds)
    ]


def token_labels(model: MotionModel, schedule: GaitSchedule, first: int) -> Integers:
    """Returns the labels of a chunk from token number ``first`` on, (chunk_tokens,).

    A token has the gait that is scheduled at its first frame.
    """
    tokens = first + np.arange(model.chunk_tokens)
    return schedule.at(tokens * model.frames_per_token / FPS)


def generate_motion(
    model: MotionModel, label: GaitLabel | str, duration: float, seed: int
) -> Motion:
    """Generates one motion; see :func:`generate_motions`.

    The label may be a text, such as "dog-trot".
    """
    label = parse_label(label) if isinstance(label, str) else label
    (motion,) = generate_motions(model, label, duration, [seed])
    return motion


def check_duration(duration: float) -> None:
    """Raises InputError unless ``duration`` is in (0, LONGEST_DURATION] s.

    A motion has three frames at least, of which velocities can be told.
    """
    if not 0 < duration <= LONGEST_DURATION:
        raise InputError(
            f"The duration must be above 0 and at most {LONGEST_DURATION:g} s, "
            f"not {duration:g}."
        )
    if round(duration * FPS) < 2:
        raise InputError(
            f"The duration must be {2 / FPS:g} s or more, not {duration:g}."
        )


def check_velocity(velocity: ArrayLike) -> None:
    """Raises InputError unless velocities to tell (..., 3) are finite."""
    values = np.asarray(velocity, dtype=np.float64)
    if not np.isfinite(values).all():
        raise InputError(
            "A velocity to tell must be three finite numbers: forward and sideways m/s "
            f"and yaw rate rad/s; not {', '.join(f'{v:g}' for v in values.flat)}."
        )


def _told(model: MotionModel, velocity: ArrayLike | None, batch: int) -> Array | None:
    """Returns what the tokens of each motion are told, (B, n, 3)."""
    if velocity is None:
        return None
    told = np.asarray(velocity, dtype=np.float64)
    check_velocity(told)
    model.check_told()
    return np.tile(told, (batch, 1, 1)) if told.ndim == 1 else told


def _text(told: Array) -> str:
    """Returns what a motion was told (n, 3) as text."""
    if len(told) > 1:
        return f"{len(told)} tokens"
    return ", ".join(f"{value:g}" for value in told[0])


def check_sampling(temperature: float, top_p: float, speed_rank: float | None) -> None:
    """Raises InputError unless :func:`generate_motions` takes these."""
    check_bounds("The temperature", temperature, 0)
    check_bounds("top_p", top_p, 0, 1, above=True)
    if speed_rank is not None and not 0 <= speed_rank <= 1:
        raise InputError(
            f"The pace must be from 0, the slowest that the gait was recorded at, to "
            f"1, the fastest, not {speed_rank:g}."
        )
