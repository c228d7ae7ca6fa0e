"""The controls of a player on Meshcat's page."""

from dataclasses import replace
from math import isfinite

from pydrake.geometry import Meshcat

from loco_drake.systems.meshcat_driver import ButtonPresses
from loco_drake.viewing.captions import PageText
from loco_drake.viewing.stage import Stage, viewpoint
from loco_drake.viewing.takes import caption_of

PAUSE = "Pause (Space)"
BACK, FORWARD = "Frame back (left)", "Frame on (right)"
PREVIOUS, NEXT = "Previous (up)", "Next (down)"
STOP = "Stop (Esc)"
BUTTONS = {
    PAUSE: "Space",
    BACK: "ArrowLeft",
    FORWARD: "ArrowRight",
    PREVIOUS: "ArrowUp",
    NEXT: "ArrowDown",
    STOP: "Escape",
}
SLIDER = "frame"
_TOLD = 0.25  # s between updates of slider and text while it plays


class Player:
    """Plays the scenes of a stage, over and over, as buttons and slider say.

    Args:
        stage: what draws the scenes in ``meshcat``.
        meshcat: its page gets the controls.
    """

    def __init__(self, stage: Stage, meshcat: Meshcat) -> None:
        self._stage, self._meshcat = stage, meshcat
        self._text = PageText(meshcat, stage.legend)
        self._number, self._time = 0, 0.0
        self._told = 0.0  # s since slider and text were updated
        self._drawn = (-1, -1)
        self.paused = False
        for name, key in BUTTONS.items():
            meshcat.AddButton(name, key)
        self._presses = ButtonPresses(meshcat, BUTTONS)
        meshcat.SetCameraPose(*viewpoint(stage.scenes, page=True))
        self.select(0)

    @property
    def number(self) -> int:
        """Which scene is shown, from 0."""
        return self._number

    @property
    def frame(self) -> int:
        """Which of its frames, from 0."""
        return round(self._time * self._scene.fps)

    @property
    def stopped(self) -> bool:
        """Whether the button to stop was pressed."""
        return self._meshcat.GetButtonClicks(STOP) > 0

    def select(self, number: int) -> None:
        """Shows the beginning of a scene; after the last comes the first."""
        self._number = number % len(self._stage.scenes)
        self._scene = self._stage.scenes[self._number]
        self._time = 0.0
        # A slider keeps its range.
        if SLIDER in self._meshcat.GetSliderNames():
            self._meshcat.DeleteSlider(SLIDER)
        last = max(len(self._scene) - 1, 1)
        self._shown = self._meshcat.AddSlider(SLIDER, 0, last, 1, 0)
        self._show(True)

    def seek(self, frame: int) -> None:
        """Shows a frame, or the first or last one if there is none such, and pauses."""
        self.paused = True
        frame = min(max(frame, 0), len(self._scene) - 1)
        self._time = frame / self._scene.fps
        self._show(True)

    def step(self, by: int) -> None:
        """Shows the frame that is ``by`` frames later, or earlier, and pauses."""
        self.seek(self.frame + by)

    def update(self, elapsed: float) -> None:
        """Does what the controls say, and plays on unless paused.

        Args:
            elapsed: time since the last call, s.
        """
        pressed = self._presses.new()
        # A page that sends the slider's value sends one that it was not told.
        asked = self._meshcat.GetSliderValue(SLIDER)
        if asked != self._shown and isfinite(asked):
            self.seek(round(asked))
        if pressed[PAUSE] % 2:
            self.paused = not self.paused
            self._show(True)
        if scenes := pressed[NEXT] - pressed[PREVIOUS]:
            self.select(self._number + scenes)
        if frames := pressed[FORWARD] - pressed[BACK]:
            self.step(frames)
        if self.paused:
            return
        self._time += elapsed
        if self._time > self._scene.duration:
            self.select(self._number + 1)
            return
        self._told += elapsed
        self._show(self._told >= _TOLD)

    def _show(self, told: bool) -> None:
        """Draws the frame unless it is drawn, and says which it is if ``told``."""
        if self._drawn != (self._number, self.frame):
            self._drawn = (self._number, self.frame)
            self._stage.draw(self._scene, self._time)
        if not told:
            return
        self._told = 0.0
        self._shown = self._meshcat.SetSliderValue(SLIDER, self.frame)
        said = caption_of(self._stage.scenes, self._number, self._time)
        frame = f"frame {self.frame} of {len(self._scene)}"
        paused = ("paused",) if self.paused else ()
        self._text.show(replace(said, lines=(*said.lines, frame, *paused)))
