"""``loco-drake report``: writes a page that compares all results with the paper."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from rich.console import Console

from loco_drake.cli.options import LABEL_CHOICES, Json, Output, option
from loco_drake.cli.output import do_all, print_table, write_json
from loco_drake.common.errors import InputError, check_at_least
from loco_drake.common.files import atomic_path

DEFAULT_REPLAYS = ("dog-trot", "horse-trot", "mpc-bound", "solo8-walk")


@dataclass(kw_only=True)
class Report:
    """Write one HTML page that compares all results with the paper's figures and table.

    The page works offline. Results are the JSON files of the evaluate commands; the
    page names missing results and the commands that produce them.
    """

    # Folder of results.
    results: Annotated[
        Path | None, option(metavar="DIR", default="the shipped results")
    ] = None
    # HTML page to write.
    out: Annotated[Path, option(name="html", metavar="FILE"), Output.FILE] = Path(
        "report.html"
    )
    replays: Annotated[
        tuple[str, ...],
        option(
            f"Gait labels: any of {LABEL_CHOICES}; of the replays on the page, of each "
            "robot that has a policy. none for no simulations.",
            name="labels",
            metavar="LABEL ...",
        ),
    ] = DEFAULT_REPLAYS
    # Duration in s: of each replay.
    replay_seconds: Annotated[float, option(name="duration")] = 4.0
    # Seed: of the motion in the replays.
    seed: int = 0
    json: Json = None

    def run(self) -> int:
        """Makes the page; returns 0."""
        from loco_drake.evaluation.report.page import build_report
        from loco_drake.evaluation.report.results import results_dir
        from loco_drake.generation.generate import check_duration

        check_at_least("seed", self.seed, 0)
        check_duration(self.replay_seconds)
        labels = () if self.replays == ("none",) else self.replays
        if "none" in labels:
            raise InputError("--labels is none, or gait labels, not both.")
        folder = self.results or results_dir()
        with Console(stderr=True).status("Reading results") as status:
            html, held = build_report(
                folder, labels, self.replay_seconds, self.seed, status.update
            )
        size = len(html.encode())
        paths = {"report": str(self.out), "results": str(folder), "bytes": size}
        rows = [
            (robot, f"{count['met']} of {count['goals']}", str(count["measured"]))
            for robot, count in held["goals"].items()
        ]

        def show() -> None:
            print_table("Goals", ("robot", "met", "measured"), rows)
            if missing := held["missing"]:
                print_table("Missing results", ("file", "made by"), missing.items())

        def save() -> None:
            with atomic_path(self.out) as temporary:
                temporary.write_text(html, encoding="utf-8")
            print(f"{self.out}: {size / 1e6:.1f} MB")

        do_all(show, lambda: write_json(self.json, {**paths, **held}), save)
        return 0
