"""Scenes from the first to the last, as a page and as pictures."""

from collections.abc import Iterator, Sequence

from pydrake.geometry import Meshcat

from loco_drake.evaluation.tracking import FRAMES_PER_SECOND
from loco_drake.models.scenery import publish_replay
from loco_drake.viewing.captions import replay_corner
from loco_drake.viewing.picture_text import write_caption
from loco_drake.viewing.rendering import Camera, Picture
from loco_drake.viewing.stage import Stage, viewpoint
from loco_drake.viewing.takes import Scene, caption_of

_FRAMES_OF_CAPTION = 8  # between captions; they show the speed


def record(stage: Stage, meshcat: Meshcat) -> str:
    """Records all scenes of a stage in its Meshcat, one after another.

    Returns:
        HTML that says on a saved page what is shown, see :mod:`.captions`.
    """
    meshcat.SetCameraPose(*viewpoint(stage.scenes, page=True))
    meshcat.StartRecording(frames_per_second=FRAMES_PER_SECOND)
    track = []
    for number, (scene, time) in enumerate(
        frame_times(stage.scenes, FRAMES_PER_SECOND)
    ):
        at = number / FRAMES_PER_SECOND
        stage.draw(scene, time, at=at)
        if time == 0 or number % _FRAMES_OF_CAPTION == 0:
            place = stage.scenes.index(scene)
            track.append((at, caption_of(stage.scenes, place, time)))
    publish_replay(meshcat)
    return replay_corner(track, stage.legend)


def pictures(scenes: Sequence[Scene], fps: float) -> Iterator[Picture]:
    """Yields ``fps`` pictures a second of all scenes, one after another, with captions.

    Raises:
        OSError: if this machine cannot render.
    """
    stage = Stage(scenes, rendered=True)
    camera = Camera(*viewpoint(scenes))
    for number, (scene, time) in enumerate(frame_times(scenes, fps)):
        stage.set_up(scene, time)
        if time == 0 or number % _FRAMES_OF_CAPTION == 0:
            caption = caption_of(stage.scenes, stage.scenes.index(scene), time)
        yield write_caption(camera.take(stage.query_object), caption, stage.legend)


def frame_times(scenes: Sequence[Scene], fps: float) -> list[tuple[Scene, float]]:
    """Returns scene and time in it, s, of each of the frames of all scenes."""
    return [
        (scene, k / fps)
        for scene in scenes
        # A tolerance, so that a duration of whole steps keeps its last frame.
        for k in range(int(scene.duration * fps + 1e-6) + 1)
    ]
