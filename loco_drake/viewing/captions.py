"""What Meshcat's page says in its corner: live, and in a replay by its time."""

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from pydrake.geometry import Meshcat, Rgba

from loco_drake.systems.drawing import FORCE_COLOR, FORCE_SCALE
from loco_drake.systems.keypoint_visualizer import COLORS

_CORNER = (
    '<div class="caption" style="position:fixed;left:92px;top:6px;color:#222;'
    "font:15px/1.4 sans-serif;text-shadow:none;white-space:pre;"
    'pointer-events:none">{}</div>'
)
_TITLE = '<span style="font-size:20px;font-weight:bold{}">{}</span>'
_MARKED = ";color:#fff;background:#d04000;padding:2px 8px"
_DOT = '<span style="color:rgb({},{},{})">&#9679;</span> {}'
# Meshcat runs no script of one's own, but a picture that cannot be loaded does.
_SCRIPT = '<img src="data:," alt="" onerror="{}">'
# Shows what belongs to the time of the recording, until the text is replaced. What is
# drawn in a part of the recording only, as contacts are, is repeated with all of it. No
# apostrophe or backslash may be in it: Meshcat puts it into a string.
_FOLLOW = """
((box) => {
  const told = JSON.parse(atob("DATA"));
  let shown = -1;
  const step = () => {
    if (!box.isConnected) return;
    const {actions, duration} = viewer.animator;
    for (const action of actions) action.getClip().duration = duration;
    const now = Math.max(0, ...actions.map((action) => action.time)) + 1e-6;
    const later = told.findIndex((caption) => caption[0] > now);
    const wanted = Math.max(0, (later < 0 ? told.length : later) - 1);
    if (wanted != shown) box.innerHTML = told[shown = wanted][1];
    requestAnimationFrame(step);
  };
  step();
})(this.parentNode)
"""


@dataclass(frozen=True)
class Caption:
    """What the corner says."""

    title: str
    lines: tuple[str, ...] = ()
    marked: bool = False  # whether the title stands out, since it has just changed


Track = Sequence[tuple[float, Caption]]
"""Captions, each with the time in s from which on it is shown, from 0 on."""


@dataclass(frozen=True)
class LegendRow:
    """What some colours mean."""

    whose: str  # before them
    entries: tuple[tuple[Rgba, str], ...]


Legend = tuple[LegendRow, ...]
"""What is always shown below a caption."""


def caption_at(track: Track, time: float) -> Caption:
    """Returns the caption that is shown at ``time`` in s."""
    begun = [caption for start, caption in track if start <= time + 1e-6]
    return begun[-1] if begun else track[0][1]


def rgb(color: Rgba) -> tuple[int, int, int]:
    """Returns red, green and blue, 0 to 255."""
    red, green, blue = (round(255 * part) for part in color.rgba[:3])
    return red, green, blue


class PageText:
    """Text in the upper left corner of Meshcat's page.

    Meshcat has no text of its own, but shows the name of a button as HTML. It also puts
    the name into JavaScript, where a quote or a new line would be an error.

    Args:
        meshcat: its page gets the text.
        legend: what is always shown below, see :func:`legend`.
    """

    def __init__(self, meshcat: Meshcat, legend: Legend = ()) -> None:
        self._meshcat, self._legend = meshcat, legend
        self._shown = ""

    def show(self, caption: Caption) -> None:
        """Replaces what is shown."""
        self._replace(_CORNER.format(_html(caption, self._legend)))

    def replay(self, corner: str) -> None:
        """Shows from now on what :func:`replay_corner` returned."""
        self._replace(corner)

    def _replace(self, text: str) -> None:
        if text == self._shown:
            return
        if self._shown:
            self._meshcat.DeleteButton(self._shown)
        self._meshcat.AddButton(text)
        self._shown = text


def replay_corner(track: Track, legend: Legend = ()) -> str:
    """Returns HTML of a corner that says what belongs to the time of a recording."""
    told = [(time, _html(caption, legend)) for time, caption in track]
    data = base64.b64encode(json.dumps(told).encode()).decode()
    script = " ".join(_FOLLOW.replace("DATA", data).split())
    return _CORNER.format(_SCRIPT.format(escape(script)))


def legend(whose: str, *, points: bool = True, forces: bool = False) -> Legend:
    """Returns what colours mean.

    Args:
        whose: whose points are shown, such as "plan".
        points: whether they are.
        forces: whether contact forces are shown.
    """
    rows = []
    if points:
        names = ("front toes", "rear toes", "withers and hip")
        rows.append(LegendRow(f"{whose}:", tuple(zip(COLORS[::2], names, strict=True))))
    if forces:
        scale = f"contact forces, 1 cm for {FORCE_SCALE / 100:g} N"
        rows.append(LegendRow("", ((FORCE_COLOR, scale),)))
    return tuple(rows)


def _row_html(row: LegendRow) -> str:
    dots = [_DOT.format(*rgb(color), _safe(name)) for color, name in row.entries]
    return " ".join(filter(None, [_safe(row.whose), *dots]))


def _html(caption: Caption, legend: Legend) -> str:
    title = _TITLE.format(_MARKED if caption.marked else "", _safe(caption.title))
    parts = [title, *map(_safe, caption.lines), *map(_row_html, legend)]
    return "<br>".join(parts)


def _safe(text: str) -> str:
    """Returns text as HTML that may stand in a string of JavaScript."""
    return escape(text).replace("\\", "&#92;")
