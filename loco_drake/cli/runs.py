"""``loco-drake runs list``: the trainings in a folder."""

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import tyro

from loco_drake.cli.options import Json, UnusedSeed, option
from loco_drake.cli.output import do_all, print_table, say, write_json
from loco_drake.common.errors import InputError

_TRAININGS = ("tokenizer", "generator", "tracker", "guided", "student", "classifier")


@dataclass(kw_only=True)
class RunsList:
    """List trainings: their names, how far they are, and what they score.

    A run's name is that of its folder, which the --out of a training gives.
    """

    # Folder to look in, at any depth.
    folder: Annotated[Path, tyro.conf.Positional, option(metavar="[DIR]")] = Path(
        "runs"
    )
    json: Json = None
    seed: UnusedSeed = 0

    def run(self) -> int:
        """Prints the table; returns 0.

        Raises:
            InputError: if there is no such folder.
        """
        if not self.folder.is_dir():
            raise InputError(
                f"There is no folder {str(self.folder)!r}; trainings make runs/ unless "
                "--out names another one."
            )
        runs = find_runs(self.folder)
        rows = [
            [
                run["name"],
                run["training"],
                f"{run['steps']} of {run['of_steps']}",
                run["state"],
                "-" if run["return"] is None else f"{run['return']:.1f}",
                run["changed"][:16].replace("T", " "),
            ]
            for run in runs
        ]
        columns = ["run", "training", "steps", "state", "return", "changed, UTC"]
        do_all(
            lambda: (
                print_table(f"Runs in {self.folder}", columns, rows)
                if runs
                else say(f"There are no runs in {str(self.folder)!r}.")
            ),
            lambda: write_json(self.json, {"folder": str(self.folder), "runs": runs}),
        )
        return 0


def find_runs(root: Path) -> list[dict[str, Any]]:
    """Returns the trainings below ``root`` in the order of their names.

    "name" is the folder below ``root``. "state" is "at work", "ended", or
    "interrupted", which --resume continues. "return" is the mean over labels of the
    normalized return (0-100) in recent training episodes, None of other trainings.
    """
    from loco_drake.common.run_folder import CHECKPOINT, is_locked, read_checkpoint
    from loco_drake.common.weights import kind_of
    from loco_drake.tracking.learning_curve import PROGRESS, learning_curve

    runs = []
    for path in sorted(root.rglob(CHECKPOINT)):
        training = (kind_of(path) or "").removesuffix(" checkpoint")
        if training not in _TRAININGS:
            continue
        folder, score = path.parent, None
        try:
            saved = read_checkpoint(path, training)
        except InputError as error:
            say(str(error))
            continue
        if (folder / PROGRESS).is_file():
            curve = learning_curve(folder / PROGRESS)["return"].values()
            last = [scores[-1] for scores in curve if scores and scores[-1] is not None]
            score = round(sum(last) / len(last), 2) if last else None
        steps, planned = saved.state["steps"], int(saved.options["steps"])
        ended = "ended" if steps >= planned else "interrupted"
        changed = datetime.fromtimestamp(path.stat().st_mtime, UTC)
        runs.append(
            {
                "name": str(folder.relative_to(root)),
                "training": training,
                "steps": steps,
                "of_steps": planned,
                "state": "at work" if is_locked(folder) else ended,
                "return": score,
                "changed": changed.isoformat(timespec="seconds"),
            }
        )
    return runs
