"""How the figures of the goals are read from results.

A measure returns the figure of a robot, or None where it was not measured.
"""

from collections.abc import Callable

from loco_drake.evaluation.report.goal import Measured
from loco_drake.evaluation.report.results import Figures, Results

Measure = Callable[[Results, str], Measured | None]

MOST_CORRECTION = 0.030  # m RMS; what may be moved for the sake of standing feet
# Of 100: what steps of training are counted for, and what no gait is to be below.
LEAST_RETURN, LEAST_WORST_RETURN = 90.0, 80.0


def plain(file: str, *keys: str, factor: float = 1.0) -> Measure:
    """Returns what reads the number under ``keys`` of ``file``, times ``factor``."""

    def measure(results: Results, robot: str) -> Measured | None:
        figures = results.of(file, robot)
        if figures is None:
            return None
        value = figures.part(*keys[:-1]).required(keys[-1])
        return None if value is None else Measured(factor * value)

    return measure


def estimate(*keys: str) -> Measure:
    """Returns what reads an estimate and its interval from "generation"."""

    def measure(results: Results, robot: str) -> Measured | None:
        figures = results.of("generation", robot)
        if figures is None:
            return None
        return read_estimate(figures, *keys)

    return measure


def read_estimate(figures: Figures, *keys: str) -> Measured | None:
    """Returns the estimate ``{mean, low, high}`` under ``keys``; None if it is null."""
    *path, last = keys
    within = figures.part(*path)
    if within.values.get(last) is None:
        return None
    found = within.part(last)
    mean = found.required("mean")
    if mean is None:
        return None
    return Measured(mean, found.required("low"), found.required("high"))


def retargeted_slip(results: Results, robot: str) -> Measured | None:
    """Slip of the retargeted feet, m/s, with how far their targets were moved."""
    figures = results.of("retargeting", robot)
    if figures is None:
        return None
    whole = figures.part("all")
    slip = whole.required("stance_slip_median_mps")
    moved = whole.required("correction_rmse_m")
    if slip is None or moved is None:
        return None
    price = f"moved {1000 * moved:.1f} mm RMS"
    return Measured(slip, price=price, paid=moved <= MOST_CORRECTION)


def tracking(key: str, factor: float = 1.0) -> Measure:
    """Returns what reads a tracking figure of all labels, with the stretch."""

    def measure(results: Results, robot: str) -> Measured | None:
        figures = results.of("tracking-generated", robot)
        if figures is None:
            return None
        whole = figures.part("all")
        value, stretch = whole.required(key), whole.required("stretch")
        if value is None:
            return None
        price = "" if stretch is None else f"at stretch {stretch:.3f}"
        return Measured(factor * value, price=price)

    return measure


def worst_gait(results: Results, robot: str) -> Measured | None:
    """The least of the labels' mean returns, with its label."""
    figures = results.of("tracking-generated", robot)
    if figures is None:
        return None
    returns = [
        (value, label)
        for label, part in figures.parts("labels")
        if (value := part.required("normalized_return")) is not None
    ]
    if not returns:
        return None
    value, label = min(returns)
    return Measured(value, price=label)


def training_steps(results: Results, robot: str) -> Measured | None:
    """Millions of steps of training; missed where they did not bring the return."""
    steps = _at_the_end(results, robot, "steps")
    if steps is None:
        return None
    score = tracking("normalized_return")(results, robot)
    if score is None:
        return Measured(steps / 1e6, price="return not measured", paid=False)
    price = f"return {score.value:.1f}"
    return Measured(steps / 1e6, price=price, paid=score.value >= LEAST_RETURN)


def training_hours(results: Results, robot: str) -> Measured | None:
    """Hours of training."""
    seconds = _at_the_end(results, robot, "seconds")
    return None if seconds is None else Measured(seconds / 3600)


def _at_the_end(results: Results, robot: str, key: str) -> float | None:
    """Returns the last value of a learning curve."""
    figures = results.of("learning", robot)
    values = [] if figures is None else figures.numbers("learning", key)
    return values[-1] if values else None
