"""``loco-drake report``: writes a page that compares all results with the paper."""

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from loco_drake.cli.output import print_table, write_json
from loco_drake.common.errors import InputError, check_at_least
from loco_drake.common.files import atomic_path

DEFAULT_REPLAYS = ("dog-trot", "horse-trot", "mpc-bound", "solo8-walk")


@dataclass(kw_only=True)
class Report:
    """Write one HTML page that compares all results with the paper's figures and table.

    The page works offline. Results are the JSON files of the evaluate commands; the
    page names missing results and the commands that produce them.
    """

    # Folder of results. Default: the shipped results.
    results: Path | None = None
    # HTML file to write.
    out: Path = Path("report.html")
    # Gaits to simulate and embed for each robot that has a policy; none for no replays.
    replays: tuple[str, ...] = DEFAULT_REPLAYS
    # Length of each replay, s.
    replay_seconds: float = 4.0
    # Seed of the motion in the replays.
    seed: int = 0
    # Write paths and counts to this JSON file.
    json: Path | None = None

    def run(self) -> int:
        """Makes the page; returns 0."""
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
            html, held = build_report(
                folder, labels, self.replay_seconds, self.seed, status.update
            )
        with atomic_path(self.out) as temporary:
            temporary.write_text(html, encoding="utf-8")
        size = self.out.stat().st_size
        paths = {"report": str(self.out), "results": str(folder), "bytes": size}
        write_json(self.json, {**paths, **held})
        rows = [
            (robot, f"{count['met']} of {count['goals']}", str(count["measured"]))
            for robot, count in held["goals"].items()
        ]
        print_table("Goals", ("robot", "met", "measured"), rows)
        if missing := held["missing"]:
            print_table("Missing results", ("file", "made by"), missing.items())
        print(f"{self.out}: {size / 1e6:.1f} MB")
        return 0
