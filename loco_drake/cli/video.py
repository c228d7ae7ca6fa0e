"""What ``simulate`` and ``play`` share to write videos."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from loco_drake.cli.output import tracked

if TYPE_CHECKING:
    from loco_drake.viewing.takes import Scene


def prepare_video(path: Path, seconds: float) -> None:
    """Checks before any work that a video of that many seconds can be made.

    Raises:
        InputError: if the file cannot be written.
        OSError: if this machine cannot render.
    """
    from loco_drake.viewing.rendering import make_engine
    from loco_drake.viewing.video_file import check_video

    check_video(path, seconds)
    make_engine()


def make_video(path: Path, scenes: "Sequence[Scene]") -> None:
    """Renders scenes, one after another, and writes them."""
    from loco_drake.viewing.replay import frame_times, pictures
    from loco_drake.viewing.video_file import FPS, write_video

    total = len(frame_times(scenes, FPS))
    write_video(path, tracked(pictures(scenes, FPS), "Rendering", total))
