import pytest
from pydrake.geometry import Meshcat

from loco_drake.viewing.captions import (
    Caption,
    PageText,
    caption_at,
    legend,
    replay_corner,
)
from tests.meshcat_messages import captions

# Names that a file or a gait may have.
SPOILERS = 'it\'s <b> \\n & "x"'


@pytest.fixture
def meshcat():
    return Meshcat()


def test_text_is_one_button_whose_name_is_safe(meshcat):
    text = PageText(meshcat, legend("plan"))
    text.show(Caption(SPOILERS, ("2",)))
    text.show(Caption(SPOILERS, ("3",)))
    (name,) = meshcat.GetButtonNames()
    assert "it&#x27;s &lt;b&gt; &#92;n &amp; &quot;x&quot;</span><br>3<br>plan:" in name
    assert not set("'\\\n") & set(name)


def test_what_has_just_changed_stands_out(meshcat):
    text = PageText(meshcat)
    names = []
    for marked in (False, True):
        text.show(Caption("dog-trot", marked=marked))
        names += meshcat.GetButtonNames()
    assert ["background:" in name for name in names] == [False, True]


def test_a_replay_has_a_caption_for_each_time_and_is_safe(meshcat):
    track = [(0.0, Caption(SPOILERS)), (0.5, Caption("dog-trot", ("1 m/s",), True))]
    corner = replay_corner(track, legend("plan", forces=True))
    PageText(meshcat).replay(corner)
    assert meshcat.GetButtonNames() == [corner]
    assert not set("'\\\n") & set(corner)
    told = captions(corner)
    assert [time for time, _ in told] == [0.0, 0.5]
    assert "it&#x27;s &lt;b&gt;" in told[0][1]
    for part in ("dog-trot</span><br>1 m/s<br>plan:", "1 cm for 5 N"):
        assert part in told[1][1]


def test_a_legend_names_what_is_shown():
    assert legend("recording", points=False) == ()
    (forces,) = legend("plan", points=False, forces=True)
    assert [name for _, name in forces.entries] == ["contact forces, 1 cm for 5 N"]
    points, _ = legend("plan", forces=True)
    names = [name for _, name in points.entries]
    assert (points.whose, names) == (
        "plan:",
        ["front toes", "rear toes", "withers and hip"],
    )


def test_a_caption_is_shown_until_the_next():
    track = [(0.0, Caption("a")), (0.5, Caption("b"))]
    shown = [caption_at(track, time).title for time in (-1.0, 0.0, 0.48, 0.5, 9.0)]
    assert shown == ["a", "a", "a", "b", "b"]


def test_whose_points_they_are_is_safe(meshcat):
    PageText(meshcat, legend(SPOILERS)).show(Caption("a"))
    (name,) = meshcat.GetButtonNames()
    assert "it&#x27;s &lt;b&gt;" in name
    assert not set("'\\\n") & set(name)
