"""Tokens as a language of all robots: one robot's motion, decoded for another.

``transfer_joint_rmse_rad``: the Go2's motion of a recording is encoded as the Go2's and
decoded for the A1; what comes out is compared with the A1's own retarget of the same
recording, joint by joint and frame by frame, RMS over all frames and joints.
"""

from collections.abc import Sequence

import numpy as np
import torch

from loco_drake.common.determinism import single_thread
from loco_drake.evaluation.samples import subject_of
from loco_drake.generation.features import JOINTS, motion_features
from loco_drake.generation.tokenizer import Tokenizer
from loco_drake.models.robots import get_robot
from loco_drake.motion.motion import Motion


def transfer_rmse(
    tokenizer: Tokenizer, pairs: Sequence[tuple[Motion, Motion]]
) -> float:
    """Returns the RMS of the joints' error, in rad, over all pairs.

    Args:
        tokenizer: knows both robots.
        pairs: motion to encode, and what it is to become on the other robot; both of
            the same stretch of a recording. Frames beyond the last whole token are
            left out.
    """
    squares = []
    for given, wanted in pairs:
        features = motion_features(get_robot(given.robot), given)
        size = tokenizer.config.frames_per_token
        frames = min(len(given), len(wanted)) // size * size
        source, target = (
            torch.tensor([tokenizer.config.robots.index(motion.robot)])
            for motion in (given, wanted)
        )
        with torch.inference_mode(), single_thread():
            batch = torch.tensor(features[None, :frames], dtype=torch.float32)
            decoded = tokenizer.decode(tokenizer.encode(batch, source), target)
        joints = decoded[0, :, JOINTS].numpy()
        squares.append((joints - wanted.joint_positions[:frames]).ravel() ** 2)
    return float(np.sqrt(np.concatenate(squares).mean()))


def pair_up(
    given: Sequence[Motion], wanted: Sequence[Motion]
) -> list[tuple[Motion, Motion]]:
    """Returns the motions of two robots that were made of the same stretches."""

    def stretch(motion: Motion) -> tuple[str, str | None, str | None]:
        file, frames = (motion.provenance.get(key) for key in ("file", "frames"))
        return str(motion.label), file, frames

    partners = {stretch(motion): motion for motion in wanted if subject_of(motion)}
    return [
        (motion, partners[stretch(motion)])
        for motion in given
        if stretch(motion) in partners
    ]
