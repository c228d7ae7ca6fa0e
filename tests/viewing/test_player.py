import pytest
from pydrake.geometry import Meshcat

from loco_drake.viewing.player import (
    BACK,
    BUTTONS,
    FORWARD,
    NEXT,
    PAUSE,
    PREVIOUS,
    SLIDER,
    STOP,
    Player,
)
from loco_drake.viewing.stage import Stage
from loco_drake.viewing.takes import one_by_one, take_of_motion
from tests.meshcat_messages import click, move
from tests.synthetic_motion import synthetic_motion


@pytest.fixture(scope="module")
def stage(go2):
    """Shows 1 s, 51 frames, and 2 s, 101 frames."""
    takes = [
        take_of_motion(f"{seconds:g} s", synthetic_motion(seconds=seconds), go2)
        for seconds in (1.0, 2.0)
    ]
    return Stage(one_by_one(takes), Meshcat())


@pytest.fixture
def drawn(stage, monkeypatch):
    """Scenes and times that were drawn."""
    calls = []
    draw = stage.draw
    monkeypatch.setattr(
        stage,
        "draw",
        lambda scene, time: (calls.append((scene, time)), draw(scene, time)),
    )
    return calls


@pytest.fixture
def meshcat(stage):
    stage.meshcat.DeleteAddedControls()
    return stage.meshcat


@pytest.fixture
def player(stage, meshcat, drawn):
    return Player(stage, meshcat)


def shown(meshcat):
    """Returns the text on the page."""
    (text,) = set(meshcat.GetButtonNames()) - set(BUTTONS)
    return text


def test_keys_are_those_of_players(player, meshcat):
    assert set(BUTTONS) <= set(meshcat.GetButtonNames())
    keys = {BUTTONS[name] for name in (PAUSE, BACK, FORWARD, PREVIOUS, NEXT)}
    assert keys == {"Space", "ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"}
    assert not player.stopped
    click(meshcat, STOP)
    assert player.stopped


def test_it_plays_in_time_and_goes_on_with_the_next_file(player, drawn, stage):
    player.update(0.5)
    assert (player.number, player.frame) == (0, 25)
    assert drawn[-1] == (stage.scenes[0], 0.5)
    player.update(0.3)
    player.update(0.3)
    assert (player.number, player.frame) == (1, 0)
    for _ in range(5):
        player.update(0.45)
    # Over and over.
    assert (player.number, player.frame) == (0, 0)


def test_pause_and_steps_by_a_frame(player, meshcat, drawn):
    player.update(0.4)
    click(meshcat, PAUSE)
    player.update(0.1)
    assert player.paused
    assert player.frame == 20
    assert "paused" in shown(meshcat)
    count = len(drawn)
    player.update(0.1)
    assert len(drawn) == count  # a picture that stays is not drawn again
    for _ in range(3):
        click(meshcat, FORWARD)
    player.update(0.1)
    assert player.frame == 23
    click(meshcat, BACK)
    player.update(0.1)
    assert player.frame == 22
    click(meshcat, PAUSE)
    player.update(0.1)
    assert player.frame == 27


def test_a_step_pauses_and_stays_within_the_file(player, meshcat):
    click(meshcat, BACK)
    player.update(0.1)
    assert player.paused
    assert (player.number, player.frame) == (0, 0)
    player.seek(50)
    player.step(1)
    assert (player.number, player.frame) == (0, 50)


def test_files_go_round_and_the_slider_gets_their_length(player, meshcat):
    click(meshcat, NEXT)
    player.update(0.0)
    assert player.number == 1
    move(meshcat, SLIDER, 100)
    player.update(0.0)
    assert player.frame == 100
    click(meshcat, NEXT)
    player.update(0.0)
    assert (player.number, player.frame) == (0, 0)
    click(meshcat, PREVIOUS)
    player.update(0.0)
    assert player.number == 1
    assert "2 of 2: dog-trot  2 s" in shown(meshcat)
    assert "0.80 m/s" in shown(meshcat)


def test_the_slider_goes_to_a_frame_and_follows_when_it_plays(player, meshcat):
    move(meshcat, SLIDER, 33)
    player.update(0.02)
    assert player.paused
    assert player.frame == 33
    assert "frame 33 of 51" in shown(meshcat)
    click(meshcat, PAUSE)
    player.update(0.3)
    assert player.frame == 48
    assert meshcat.GetSliderValue(SLIDER) == 48
    # What the player told the slider is not taken for a hand's.
    player.update(0.02)
    assert player.frame == 49
    assert not player.paused


def test_a_slider_that_is_no_number_moves_nothing(player, meshcat):
    move(meshcat, SLIDER, float("nan"))
    player.update(0.1)
    assert player.frame == 5
    assert not player.paused
