"""Video files: MP4 by ffmpeg of the package imageio-ffmpeg, WebP and GIF by Pillow."""

from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from itertools import chain
from pathlib import Path

from PIL import Image

from loco_drake.common.errors import InputError
from loco_drake.common.files import atomic_path
from loco_drake.systems.keypoint_visualizer import COLORS
from loco_drake.viewing.rendering import HEIGHT, WIDTH, Picture

SUFFIXES = (".mp4", ".webp", ".gif")
FPS = 25  # frames/s
# Pillow holds all frames of a file in memory, .7 MB each.
_MAX_SECONDS = 120.0
# Constant rate factor of H.264: 18 cannot be told from the original, 28 is coarse.
_MP4_QUALITY = 23
_WEBP_QUALITY = 70  # of 100
# GIF packs so badly that it gets half the width and height.
_GIF_COLORS, _GIF_REDUCTION = 64, 2
_BLOCK = 8  # pixels; sides are multiples of it


def check_video(path: Path, seconds: float) -> None:
    """Checks before any work that a video can be written.

    Args:
        path: of the video.
        seconds: its duration at most.

    Raises:
        InputError: if its suffix is unknown, a package is missing, or it is too long.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(
            f"A video is a file of MP4, WebP or GIF, named *{', *'.join(SUFFIXES)}, "
            f"not {path.name!r}."
        )
    if suffix != ".mp4" and seconds > _MAX_SECONDS:
        raise InputError(
            f"A video of {seconds:g} s must be an MP4: WebP and GIF hold at most "
            f"{_MAX_SECONDS:g} s."
        )
    if suffix == ".mp4" and find_spec("imageio_ffmpeg") is None:
        raise InputError(
            "To write MP4, install the package imageio-ffmpeg, the extra 'video' of "
            "loco_drake; WebP and GIF need nothing more."
        )


def write_video(path: Path, pictures: Iterable[Picture]) -> None:
    """Writes pictures at FPS frames/s, in the format that the suffix says, atomically.

    Raises:
        InputError: if :func:`check_video` would refuse it.
    """
    check_video(path, 0.0)
    with atomic_path(path) as temporary:
        if path.suffix.lower() == ".mp4":
            _write_mp4(temporary, pictures)
        else:
            _write_animation(temporary, pictures)


def _write_mp4(path: Path, pictures: Iterable[Picture]) -> None:
    from imageio_ffmpeg import write_frames

    writer = write_frames(
        str(path),
        (WIDTH, HEIGHT),
        fps=FPS,
        codec="libx264",
        quality=None,
        macro_block_size=_BLOCK,
        # The index first, so that browsers play it while it loads.
        output_params=["-crf", str(_MP4_QUALITY), "-movflags", "+faststart"],
    )
    writer.send(None)
    try:
        for picture in pictures:
            writer.send(picture)
    finally:
        writer.close()


def _write_animation(path: Path, pictures: Iterable[Picture]) -> None:
    gif = path.suffix.lower() == ".gif"
    images = map(Image.fromarray, pictures)
    frames = _for_gif(images) if gif else images
    first = next(frames)
    first.save(
        path,
        save_all=True,
        append_images=list(frames),
        duration=1000 // FPS,  # ms
        loop=0,
        quality=_WEBP_QUALITY,
    )


def _for_gif(images: Iterator[Image.Image]) -> Iterator[Image.Image]:
    """Yields images of half the size in the same few colours, so that none flickers."""
    reduced = (image.reduce(_GIF_REDUCTION) for image in images)
    first = next(reduced)
    # The plan's few pixels would get no colours of their own.
    few = [round(255 * part) for color in COLORS for part in color.rgba[:3]]
    found = first.quantize(_GIF_COLORS - len(COLORS)).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette([*found[: 3 * (_GIF_COLORS - len(COLORS))], *few])
    for image in chain([first], reduced):
        yield image.quantize(palette=palette, dither=Image.Dither.NONE)
