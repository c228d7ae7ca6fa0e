"""The record of the training data in the header of weights."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from loco_drake import __version__
from loco_drake.common.weights import load_weights
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.generation.training_motions import Library, recording_name
from loco_drake.motion.motion import FPS, Motion

_SETTINGS = ("steps", "learning_rate", "weight_decay", "seed")


def training_record(library: Library, settings: LoopSettings) -> dict[str, Any]:
    """Returns the record of a training, as JSON.

    Returns:
        ``robots``; ``recordings``, the seconds of motion learned from of each subject
        (a recording, or an animal with all of its own) and robot, mirror images not
        counted; ``held_out``, the subjects that were not; and the settings.
    """
    seconds: dict[str, dict[str, float]] = {}
    for clip in library.train[: len(library.train) // 2]:  # then come mirror images
        of_robot = seconds.setdefault(clip.recording, {})
        of_robot[clip.robot] = of_robot.get(clip.robot, 0.0) + len(clip) / FPS
    return {
        "robots": list(library.robots),
        "recordings": {
            name: {robot: round(s, 2) for robot, s in sorted(of_robot.items())}
            for name, of_robot in sorted(seconds.items())
        },
        "held_out": sorted({clip.recording for clip in library.held_out}),
        **{name: getattr(settings, name) for name in _SETTINGS},
        "loco_drake": __version__,
    }


def read_training_record(path: Path, kind: str) -> dict[str, Any] | None:
    """Returns the record in a weights file, None if there is none.

    Args:
        path: of the weights.
        kind: "tokenizer" or "generator".

    Raises:
        InputError: if the file is missing, damaged, or of something else.
    """
    _, config = load_weights(path, kind)
    info = config.get("info")
    record = info.get("training") if isinstance(info, dict) else None
    known = isinstance(record, dict) and isinstance(record.get("recordings"), dict)
    return record if known else None


def seen_in_training(
    record: dict[str, Any] | None, motions: Iterable[Motion]
) -> list[str] | None:
    """Returns which recordings of ``motions`` the weights were trained on.

    Args:
        record: from :func:`read_training_record`.
        motions: retargeted recordings.

    Returns:
        Sorted names of subjects; None if it was not recorded.
    """
    if record is None:
        return None
    return sorted({recording_name(m) for m in motions} & set(record["recordings"]))
