"""Pictures for a page: SVG that takes its ink from the page's colours."""

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

# Readable on white and on near-black, and by the colour-blind.
COLORS = {
    "dog": "#d9730d",
    "horse": "#2e86c9",
    "mpc": "#1f9d6b",
    "solo8": "#b5569b",
}
ROBOT_COLORS = {"go2": "#2e86c9", "a1": "#d9730d"}

# Stands for the colour of the page's text until the SVG is written.
INK = "#010203"
FAINT = "#808890"


@contextmanager
def page_style(name: str) -> Iterator[None]:
    """Makes figures drawn in the block match the page.

    Args:
        name: of the picture; keeps the ids in its SVG apart from those of others.
    """
    style: dict[str, Any] = {
        "axes.edgecolor": FAINT,
        "axes.labelcolor": INK,
        "axes.spines.right": False,
        "axes.spines.top": False,
        "axes.titlesize": 10,
        "figure.facecolor": "none",
        "axes.facecolor": "none",
        "savefig.facecolor": "none",
        "font.family": "sans-serif",
        "font.size": 10,
        "grid.color": FAINT,
        "grid.alpha": 0.3,
        "legend.frameon": False,
        "svg.fonttype": "none",
        "svg.hashsalt": name,
        "text.color": INK,
        "xtick.color": FAINT,
        "xtick.labelcolor": INK,
        "ytick.color": FAINT,
        "ytick.labelcolor": INK,
    }
    with mpl.rc_context(style):  # type: ignore[arg-type, unused-ignore]
        yield


def to_svg(figure: Figure, alt: str) -> str:
    """Returns a figure as an SVG element; call it within :func:`page_style`.

    Args:
        figure: drawn in the style of the page.
        alt: says what is to be seen, for those who cannot.
    """
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :].replace(INK, "currentColor")
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    escaped = alt.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
    return text.replace("<svg ", f'<svg role="img" aria-label="{escaped}" ', 1)
