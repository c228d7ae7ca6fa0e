"""``loco-drake report``: one page of all results, beside what is published."""

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from loco_drake.cli.output import print_table, write_json
from loco_drake.common.errors import InputError, check_at_least
from loco_drake.common.files import atomic_path

DEFAULT_REPLAYS = ("dog-trot", "horse-trot", "mpc-bound", "solo8-walk")


@dataclass(kw_only=True)
class Report:
    """Make one HTML page of all results: the paper's figures and table, ours beside.

    The page needs no other file and no network. Results are what the evaluate commands
    write with --json; the page says which are missing, and how they are made.
    """

    results: Path | None = None
    """Folder of results. Default: those that come with the package."""
    out: Path = Path("report.html")
    """The page."""
    replays: tuple[str, ...] = DEFAULT_REPLAYS
    """Gaits to simulate and embed, of each robot with a policy; none: no replays."""
    replay_seconds: float = 4.0
    """Length of each replay, s."""
    seed: int = 0
    """Of the motion that is shown."""
    json: Path | None = None
    """Writes paths and counts to this file."""

    def run(self) -> int:
        """Makes the page; returns 0.

        Raises:
            InputError: if an option or a result is wrong; nothing is written then.
        """
        from loco_drake.evaluation.report.page import build_report
        from loco_drake.evaluation.report.results import results_dir
        from loco_drake.generation.generate import check_duration

        check_at_least("seed", self.seed, 0)
        check_duration(self.replay_seconds)
        labels = () if self.replays == ("none",) else self.replays
        if "none" in labels:
            raise InputError("--replays is none, or gait labels, not both.")
        folder = self.results or results_dir()
        with Console(stderr=True).status("Reading results") as status:
            report = build_report(
                folder, labels, self.replay_seconds, self.seed, status.update
            )
        with atomic_path(self.out) as temporary:
            temporary.write_text(report.html, encoding="utf-8")
        size = self.out.stat().st_size
        figures = {
            "report": str(self.out),
            "results": str(folder),
            "bytes": size,
            "goals": report.counts,
            "missing": report.missing,
            "replays": [f"{robot} {label}" for robot, label in report.replays],
            "reason": {
                f"{robot} in {file}": why
                for (file, robot), why in report.absent.items()
            },
        }
        write_json(self.json, figures)
        rows = [
            (robot, f"{count['met']} of {count['goals']}", str(count["measured"]))
            for robot, count in report.counts.items()
        ]
        print_table("Goals", ("robot", "met", "measured"), rows)
        if report.missing:
            print_table("Missing results", ("file", "made by"), report.missing.items())
        print(f"{self.out}: {size / 1e6:.1f} MB")
        return 0
