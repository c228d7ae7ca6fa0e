import numpy as np

from loco_drake.systems.keypoint_visualizer import COLORS
from loco_drake.viewing.captions import Caption, legend, rgb
from loco_drake.viewing.picture_text import write_caption

SKY = (191, 212, 235)


def sky(height=120, width=640):
    return np.full((height, width, 3), SKY, dtype=np.uint8)


def changed(picture):
    return (picture != sky()).any(axis=-1)


def box(pixels):
    rows, columns = np.nonzero(pixels)
    return rows.min(), rows.max(), columns.min(), columns.max()


def test_text_stands_dark_in_the_upper_left_and_nowhere_else():
    before = sky()
    picture = write_caption(before, Caption("dog-trot", ("1.00 s  1.20 m/s",)))
    assert (before == sky()).all()
    top, bottom, left, right = box(changed(picture))
    assert top > 4
    assert bottom < 50
    assert left > 8
    assert right < 160
    assert picture[changed(picture)].min() < 60


def test_each_line_and_the_legend_are_below_the_one_before():
    caption = Caption("a", ("b",))
    alone = changed(write_caption(sky(), Caption("a")))
    lines = changed(write_caption(sky(), caption))
    picture = write_caption(sky(), caption, legend("plan"))
    _, end, *_ = box(alone)
    start, bottom, *_ = box(lines & ~alone)
    assert start > end
    below = changed(picture) & ~lines
    start, _, _, right = box(below)
    assert start > bottom
    assert right < 400
    for color in COLORS[::2]:
        dots = (picture == rgb(color)).all(axis=-1)
        assert dots.sum() > 15
        assert box(dots)[0] > bottom


def test_a_title_that_has_changed_stands_out():
    plain = write_caption(sky(), Caption("a"))
    marked = write_caption(sky(), Caption("a", marked=True))
    red = marked.astype(int)[..., 0] - marked[..., 2]
    assert (red > 150).sum() > 100
    assert (plain.astype(int)[..., 0] - plain[..., 2]).max() < 30


def test_the_font_has_an_arrow():
    """What a font lacks, it shows as the same box."""
    arrow, missing = (
        write_caption(sky(), Caption(text)) for text in ("\u2192", "\U0010fffd")
    )
    assert (arrow != missing).any()
