"""What ``simulate`` and ``drive`` share."""

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from loco_drake.cli.output import print_table
from loco_drake.common.errors import InputError
from loco_drake.common.files import atomic_path

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

    from loco_drake.evaluation.tracking import Recorder
    from loco_drake.systems.scenario import Scenario

_MAX_DURATION = 3600.0
# A simulation that is this far behind, s, goes on from there rather than hurry.
_MOST_LAG = 1.0


def override(config: Any, **given: Any) -> None:
    """Sets the fields that are not None."""
    for name, value in given.items():
        if value is not None:
            setattr(config, name, value)


def use_weights(
    scenario: "Scenario",
    *,
    weights: Path | None,
    tokenizer: Path | None,
    generator: Path | None,
    policy: Path | None,
) -> None:
    """Lets a scenario take weights of one's own; single files go before ``weights``.

    Raises:
        InputError: if the folder ``weights`` has none, or several of a kind; or if the
            motion is not generated and ``tokenizer`` or ``generator`` is given.
    """
    from loco_drake.models.shipped import chosen_weights
    from loco_drake.systems.scenario import GeneratedReference, TrainedPolicy

    found = chosen_weights(
        weights, policy=policy, tokenizer=tokenizer, generator=generator
    )
    policy = found.pop("policy")
    if policy is not None:
        scenario.policy = TrainedPolicy(weights=policy)
    reference = scenario.reference
    if isinstance(reference, GeneratedReference):
        override(reference, **found)
    elif tokenizer is not None or generator is not None:
        raise InputError(
            "--tokenizer and --generator write motion, and the reference is a file."
        )


def check_duration(duration: float) -> None:
    """Raises InputError unless ``duration``, s, can be simulated."""
    # It imports Drake, which --help does not need.
    from loco_drake.control.plan import PLAN_DT

    if not PLAN_DT <= duration <= _MAX_DURATION:
        raise InputError(
            f"The duration must be above 0 s, at least a sample of {PLAN_DT} s, "
            f"and at most {_MAX_DURATION:g} s, not {duration}."
        )


def start_meshcat(port: int | None, *, announce: bool) -> "Meshcat":
    """Returns a Meshcat at ``port``, or at a free one if that is in use.

    Args:
        port: its port; None for a free one.
        announce: whether to print its address.

    Raises:
        InputError: if there can be no such port.
    """
    from loco_drake.models.scenery import dress

    meshcat = _open_meshcat(port)
    dress(meshcat)
    if announce:
        print(f"Meshcat: {meshcat.web_url()}", flush=True)
    return meshcat


def _open_meshcat(port: int | None) -> "Meshcat":
    from pydrake.geometry import Meshcat, MeshcatParams

    if port is None:
        return Meshcat()
    if not (1024 <= port <= 65535):
        raise InputError(f"The port must be from 1024 to 65535, not {port}.")
    try:
        return Meshcat(MeshcatParams(port=port))
    except RuntimeError:
        print(f"Port {port} is in use; Meshcat takes a free one.", file=sys.stderr)
        return Meshcat()


def save_page(meshcat: "Meshcat", path: Path, corner: str) -> None:
    """Writes Meshcat's page with what was recorded.

    Args:
        meshcat: what shows the page.
        path: the file.
        corner: HTML that the page has besides.
    """
    begin, end = meshcat.StaticHtml().rsplit("</body>", 1)
    with atomic_path(path) as temporary:
        temporary.write_text(f"{begin}{corner}\n</body>{end}")


def in_terminal() -> bool:
    """Returns whether somebody is there who can press Ctrl-C."""
    return sys.stdin.isatty() and sys.stdout.isatty()


def stay() -> None:
    """Waits for Ctrl-C."""
    print("The replay is on that page until Ctrl-C.", flush=True)
    try:
        while True:
            time.sleep(1.0)
    except KeyboardInterrupt:
        pass


class Pace:
    """Keeps a simulation from running ahead of the clock.

    It waits outside AdvanceTo, so that the speed that commands print is true.

    Args:
        recorder: of the simulation, which is ready to start.
        waits: whether to wait at all.
    """

    def __init__(self, recorder: "Recorder", waits: bool) -> None:
        # The first evaluation of the networks sets up torch.
        recorder.diagram.GetOutputPort("action").Eval(recorder.context)
        self._waits = waits
        self._begin = self._start = time.perf_counter()

    @property
    def elapsed(self) -> float:
        """Seconds since the simulation was ready."""
        return time.perf_counter() - self._begin

    def keep(self, now: float) -> None:
        """Waits until the clock has reached the simulation's time ``now``, s."""
        ahead = now - (time.perf_counter() - self._start)
        if ahead < -_MOST_LAG:
            self._start -= ahead
        if self._waits and ahead > 0:
            time.sleep(ahead)


def print_figures(title: str, figures: dict[str, object]) -> None:
    """Prints the figures of a simulation with their units."""
    units = {
        "_rad": "rad",
        "_radps": "rad/s",
        "_mps": "m/s",
        "_m": "m",
        "_s": "s",
        "_return": "of 100",
    }
    rows = []
    for name, value in figures.items():
        text = f"{value:.3f}" if isinstance(value, float) else str(value)
        suffix = next((suffix for suffix in units if name.endswith(suffix)), "")
        figure = name if suffix == "_return" else name.removesuffix(suffix)
        rows.append((figure.replace("_", " "), text, units.get(suffix, "")))
    print_table(title, ("figure", "value", "unit"), rows)
