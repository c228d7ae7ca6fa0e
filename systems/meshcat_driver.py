"""A driver's controls on Meshcat's page: keys, sliders, buttons and a gamepad."""

from collections import Counter
from collections.abc import Iterable, Sequence
from math import isfinite

import numpy as np
from pydrake.geometry import Meshcat

from loco_drake.common.arrays import Array
from loco_drake.control.driving import COMMAND, GAIT, ORDERS, PUSH, RESET
from loco_drake.motion.gaits import gait_index

# Name, least, most, step, and the keys to go down and up. Of a command, in its order,
# m/s and rad/s. The page has room for fifteen letters.
SLIDERS = (
    ("forward (W, S)", -1.5, 3.5, 0.1, "KeyS", "KeyW"),
    ("sideways (A, D)", -1.0, 1.0, 0.1, "KeyD", "KeyA"),
    ("turn (Q, E)", -2.0, 2.0, 0.1, "KeyE", "KeyQ"),
)
HALT = "Halt (Space)"
RESET_BUTTON = "Put upright (R)"
STOP = "Stop (Esc)"
# By how many the gait changes. Digits as keys would act while a slider's number is
# typed.
GAIT_STEPS = {"Previous gait (Z)": -1, "Next gait (X)": 1}
# A push, N s to the left.
PUSHES = {"Push left (arrow)": 6.0, "Push right (arrow)": -6.0}
_KEYS = {
    "Previous gait (Z)": "KeyZ",
    "Next gait (X)": "KeyX",
    HALT: "Space",
    "Push left (arrow)": "ArrowLeft",
    "Push right (arrow)": "ArrowRight",
    RESET_BUTTON: "KeyR",
    STOP: "Escape",
}
_PUSH_PAUSE = 0.5  # s; a key that is held down repeats itself

# Axes of a standard gamepad and what they command at full deflection; all of them
# point right or down, and the command forward or left.
_AXES = ((1, -2.0), (0, -0.6), (2, -1.5))
_DEAD_ZONE = 0.1


class ButtonPresses:
    """Counts the presses of buttons that were just added to a Meshcat's page."""

    def __init__(self, meshcat: Meshcat, names: Iterable[str]) -> None:
        self._meshcat = meshcat
        self._clicks = Counter(dict.fromkeys(names, 0))

    def new(self) -> Counter[str]:
        """Returns how often each button was pressed since the last call."""
        clicks = Counter(
            {name: self._meshcat.GetButtonClicks(name) for name in self._clicks}
        )
        pressed = clicks - self._clicks
        self._clicks = clicks
        return pressed


class MeshcatDriver:
    """Adds a driver's controls to Meshcat's page and reads them.

    The command is the sum of sliders and gamepad. Values that are not finite or beyond
    their range are limited, and a gamepad that is gone counts as let go;
    :attr:`notes` says so.

    Args:
        meshcat: the Meshcat whose page gets the controls.
        gaits: gaits to choose from: labels, or any.
        gait: the gait at the beginning.
    """

    def __init__(self, meshcat: Meshcat, gaits: Sequence[str], gait: str) -> None:
        self._meshcat = meshcat
        self._gaits, self._gait = gaits, gaits.index(gait)
        self._pushed = -_PUSH_PAUSE
        self._had_gamepad = False
        #: What was limited or is missing, for the driver to see.
        self.notes: tuple[str, ...] = ()
        for name, low, high, step, down, up in SLIDERS:
            meshcat.AddSlider(name, low, high, step, 0.0, down, up)
        buttons = {**_KEYS, **dict.fromkeys(gaits, "")}
        for name, key in buttons.items():
            meshcat.AddButton(name, key)
        self._presses = ButtonPresses(meshcat, buttons)

    @property
    def stopped(self) -> bool:
        """Whether the button to stop was pressed."""
        return self._meshcat.GetButtonClicks(STOP) > 0

    def sample(self, time: float) -> Array:
        """Returns the orders that the controls give now, see :mod:`.control.driving`.

        Args:
            time: the simulation's time, s; pushes are at least half a second apart.
        """
        pressed = self._presses.new()
        if HALT in pressed:
            for name, *_ in SLIDERS:
                self._meshcat.SetSliderValue(name, 0.0)
        orders = np.zeros(ORDERS)
        orders[COMMAND] = self._command()
        for number, gait in enumerate(self._gaits):
            if gait in pressed:
                self._gait = number
        step = sum(pressed[name] * size for name, size in GAIT_STEPS.items())
        self._gait = (self._gait + step) % len(self._gaits)
        orders[GAIT] = gait_index(self._gaits[self._gait])
        pushes = sorted(pressed.keys() & PUSHES.keys())
        if pushes and time >= self._pushed + _PUSH_PAUSE:
            orders[PUSH] = PUSHES[pushes[0]]
            self._pushed = time
        orders[RESET] = RESET_BUTTON in pressed
        return orders

    def _command(self) -> Array:
        low, high = (np.array([slider[k] for slider in SLIDERS]) for k in (1, 2))
        sliders = np.array([self._meshcat.GetSliderValue(name) for name, *_ in SLIDERS])
        asked = sliders + self._gamepad()
        command = np.clip(np.where(np.isfinite(asked), asked, 0.0), low, high)
        if not np.array_equal(command, asked):
            self.notes = (*self.notes, "command limited")
        # Steps of .1 add up to a bit more or less.
        return np.round(command, 6)

    def _gamepad(self) -> Array:
        """Returns what the gamepad commands, 0 without one, shape (3,)."""
        pad = self._meshcat.GetGamepad()
        # One that was pulled out keeps its index and loses its axes. A page that was
        # closed leaves the last state behind.
        there = bool(pad.axes) and self._meshcat.GetNumActiveConnections() > 0
        axes = list(pad.axes) if there else []
        self._had_gamepad |= there
        notes = []
        if self._had_gamepad and not there:
            notes.append("gamepad is gone")
        command = np.zeros(3)
        for k, (axis, most) in enumerate(_AXES):
            value = axes[axis] if axis < len(axes) else 0.0
            if not (isfinite(value) and abs(value) <= 1.0):
                value = min(max(value, -1.0), 1.0) if isfinite(value) else 0.0
                notes.append("gamepad limited")
            if abs(value) > _DEAD_ZONE:
                command[k] = most * value
        self.notes = tuple(dict.fromkeys(notes))
        return command
