"""Videos that are read back, and what is seen in pictures of a robot on its floor."""

import re
import subprocess

import numpy as np
import pytest
from PIL import Image

from loco_drake.viewing.rendering import can_render

needs_renderer = pytest.mark.skipif(
    not can_render(), reason="needs EGL to render, and there is none"
)


def robot_columns(picture):
    """Returns which columns show the Go2, which alone is nearly white, shape (W,)."""
    dark = picture.min(axis=-1)
    sky = (picture[..., 2].astype(int) - picture[..., 0]) > 25
    return ((dark > 200) & ~sky).any(axis=0)


def below_the_caption(picture):
    """Returns what is below the text, whose legend has the colours of the plan."""
    return picture[len(picture) // 4 :]


def plan_pixels(picture):
    """Returns how many pixels are blue, red and green, as points of the plan are."""
    rgb = picture.astype(int)
    red, green, blue = rgb[..., 0], rgb[..., 1], rgb[..., 2]
    return (
        int(((blue > red + 60) & (blue > green + 40)).sum()),
        int(((red > green + 60) & (red > blue + 60)).sum()),
        int(((green > red + 40) & (green > blue + 40)).sum()),
    )


def read_video(path):
    """Returns the pictures in a video, shape (N, H, W, 3), and its rate, frames/s."""
    if path.suffix == ".mp4":
        imageio = pytest.importorskip(
            "imageio_ffmpeg", reason="needs the extra 'video'"
        )
        line = [imageio.get_ffmpeg_exe(), "-i", path, "-pix_fmt", "rgb24"]
        done = subprocess.run(
            [*line, "-f", "rawvideo", "-"], capture_output=True, check=True
        )
        told = done.stderr.decode()
        width, height = map(int, re.search(r", (\d+)x(\d+)[ ,]", told).groups())
        pictures = np.frombuffer(done.stdout, np.uint8)
        rate = float(re.search(r", ([\d.]+) fps", told).group(1))
        return pictures.reshape(-1, height, width, 3), rate
    pictures, durations = [], []
    with Image.open(path) as image:
        for k in range(image.n_frames):
            image.seek(k)
            pictures.append(np.array(image.convert("RGB")))
            durations.append(image.info["duration"])
    return np.array(pictures), 1000 * len(durations) / sum(durations)
