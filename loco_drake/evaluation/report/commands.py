"""Which command made a result, as its own figures tell."""

from loco_drake.evaluation.report.expected import EXPECTED, ResultFile
from loco_drake.evaluation.report.results import Figures, Results

# Conditions in results of tracking: key, option, and what needs no option.
_OPTIONS = (
    ("reference", "--reference", "generated"),
    ("contact", "--contact", "similar"),
    ("time_step_s", "--time-step", 0.01),
    ("friction", "--friction", 0.8),
    ("duration_s", "--duration", 10.0),
)


def commands(results: Results) -> dict[str, str]:
    """Returns the command that makes each expected file, by path.

    Of results of tracking that are there, the options are those of their conditions.

    Raises:
        InputError: if a result is damaged.
    """
    return {file.path: _command(file, results) for file in EXPECTED}


def _command(file: ResultFile, results: Results) -> str:
    found = results.found.get(file.path, {})
    if not file.name.startswith("tracking-") or not found:
        return file.command
    (figures,) = found.values()
    options = [f"--robot {file.robots[0]}"]
    for key, option, default in _OPTIONS:
        text = isinstance(default, str)
        value = figures.values.get(key) if text else figures.number(key)
        if value not in (None, default):
            options.append(f"{option} {value if text else f'{value:g}'}")
    if file.flags:
        options.append(file.flags)
    seeds = _most_episodes(figures)
    if seeds:
        options.append(f"--seeds {seeds:.0f}")
    return f"loco-drake evaluate tracking {' '.join(options)}"


def _most_episodes(figures: Figures) -> float:
    counts = [part.number("episodes") or 0.0 for _, part in figures.parts("labels")]
    return max(counts, default=0.0)
