"""The recording that a motion was made of."""

from dataclasses import replace
from pathlib import Path

from loco_drake.common.errors import InputError
from loco_drake.datasets import human
from loco_drake.datasets.registry import get_dataset, read_clip
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.motion.motion import Motion
from loco_drake.retargeting.scaling import in_time

_NEEDED = ("file", "frames", "scale")


def source_clip(motion: Motion, folder: Path) -> KeypointClip:
    """Returns the stretch that a motion was retargeted from, in its size and time.

    It begins at the origin and heads along +x. Of a motion that was steered or
    simulated since it is still the recording.

    Args:
        motion: whose provenance names the recording.
        folder: the data folder.

    Raises:
        InputError: if the provenance names none, or it cannot be found or read.
    """
    known = motion.provenance
    missing = [name for name in _NEEDED if name not in known]
    if missing:
        raise InputError(f"its provenance names no {missing[0]} of a recording.")
    person = motion.source == human.SOURCE
    folder /= human.FOLDER if person else get_dataset(motion.source).folder
    files = sorted(folder.rglob("*"))
    found = [path for path in files if path.name == known["file"] and path.is_file()]
    if not found:
        raise InputError(f"there is no {known['file']} in {folder}.")
    try:
        cycles = int(known.get("cycles", "1").split(",")[0])
        start, end = map(int, known["frames"].split("-"))
        rate = float(known["recording_fps"]) if "recording_fps" in known else None
        scale, time_scale = float(known["scale"]), float(known.get("time_scale", 1.0))
    except ValueError:
        raise InputError("its provenance is damaged.") from None
    if person:
        clip = human.read_human(found[0], motion.gait, cycles).keypoints()
    else:
        clip = read_clip(motion.source, found[0], motion.gait, start, end, rate)
    clip = clip.mirrored() if "mirrored" in known else clip
    clip = in_time(clip, time_scale)
    points = (clip.withers, clip.hip, clip.toes)
    withers, hip, toes = (scale * p for p in points)
    return replace(clip, withers=withers, hip=hip, toes=toes)
