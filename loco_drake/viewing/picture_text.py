"""Captions drawn into pictures, as Meshcat's page shows them in its corner."""

from functools import lru_cache
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from loco_drake.viewing.captions import Caption, Legend, rgb
from loco_drake.viewing.rendering import Picture

_LEFT, _TOP = 12, 8  # pixels
_TITLE, _TEXT = 17, 13  # pixels
_SPACING = 1.35  # of lines, over their height
_INK, _MARKED_INK, _MARK = (34, 34, 34), (255, 255, 255), (208, 64, 0)
_PADDING = 4  # around a marked title, pixels


def write_caption(picture: Picture, caption: Caption, legend: Legend = ()) -> Picture:
    """Returns a picture with a caption, and a legend below it, in its upper left."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    title, text = _font(_TITLE, bold=True), _font(_TEXT)
    at = (_LEFT, _TOP)
    if caption.marked:
        left, top, right, bottom = draw.textbbox(at, caption.title, title)
        box = (left - _PADDING, top - _PADDING, right + _PADDING, bottom + _PADDING)
        draw.rectangle(box, fill=_MARK)
    draw.text(at, caption.title, _MARKED_INK if caption.marked else _INK, title)
    y = _TOP + _SPACING * _TITLE + _PADDING
    for line in caption.lines:
        draw.text((_LEFT, y), line, _INK, text)
        y += _SPACING * _TEXT
    for row in legend:
        x = float(_LEFT)
        words = [(row.whose, _INK)] if row.whose else []
        for color, name in row.entries:
            words += [("\N{BLACK CIRCLE}", rgb(color)), (name, _INK)]
        for word, ink in words:
            draw.text((x, y), word, ink, text)
            x += draw.textlength(f"{word} ", text)
        y += _SPACING * _TEXT
    return np.asarray(image)


@lru_cache
def _font(size: int, *, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Returns DejaVu Sans, which matplotlib brings: it has arrows."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    path = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name
    return ImageFont.truetype(str(path), size)
