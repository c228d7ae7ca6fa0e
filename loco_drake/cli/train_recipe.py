"""``loco-drake train recipe``: trains a tracking policy from nothing, in stages."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from loco_drake.cli.options import Json, OutFolder, option
from loco_drake.cli.output import do_all, print_table, say, write_json
from loco_drake.common.errors import InputError, check_at_least
from loco_drake.common.progress import progress_bar


@dataclass(kw_only=True)
class TrainRecipe:
    """Train a tracking policy by a recipe, from nothing to its weights.

    A recipe names the motions to train on and the stages of the training, see
    docs/tracking.md. Ctrl-C stops it; --resume continues from the last update.
    """

    # A shipped recipe (go2, a1, and own for a robot of one's own), or a YAML file.
    # Required without --resume.
    recipe: Annotated[Path | None, option(metavar="NAME|FILE")] = None
    # Robot: go2, a1, or the YAML file of another, see docs/own_robot.md.
    robot: Annotated[
        str | None, option(metavar="ROBOT|FILE", default="that of the recipe")
    ] = None
    # Folder to write to: motions, a run folder for each stage, and the policy.
    out: OutFolder = Path("runs/recipe")
    # Continue what is in --out: where it was stopped. A recipe that is given again must
    # agree with what has begun.
    resume: bool = False
    # Number of worker processes; it must divide the recipe's environments, and the
    # results do not depend on it.
    workers: int = 2
    # Try a recipe with this share of its steps and motions.
    scale: float = 1.0
    # Seed: of all trainings.
    seed: Annotated[int | None, option(default="that of the recipe")] = None
    json: Json = None

    def run(self) -> int:
        """Trains, prints and writes; returns 1 if it was stopped early, else 0."""
        from loco_drake.tracking.recipe import read_recipe, scaled
        from loco_drake.tracking.recipe_run import run_recipe

        check_at_least("workers", self.workers, 1)
        recipe = None
        if self.recipe is not None:
            recipe = scaled(read_recipe(self.recipe, self.robot), self.scale)
            recipe.seed = recipe.seed if self.seed is None else self.seed
        elif not self.resume:
            raise InputError("--recipe must name a shipped recipe or a YAML file.")
        elif (self.robot, self.seed, self.scale) != (None, None, 1.0):
            raise InputError("--robot, --seed and --scale go with --recipe.")
        with progress_bar() as bar:
            task, doing = bar.add_task("recipe", total=None, note=""), ""

            def report(what: str, done: int, total: int, note: str) -> None:
                nonlocal doing
                if what != doing:
                    bar.reset(task, description=what)
                    doing = what
                bar.update(task, completed=done, total=total, note=note)

            figures = run_recipe(
                self.out,
                recipe,
                resume=self.resume,
                workers=self.workers,
                report=report,
            )
        returns, points = figures["curve"]["return"], figures["evaluation"]
        rows = [
            ("steps", f"{figures['steps']}"),
            ("hours", f"{figures['seconds'] / 3600:.2f}"),
            ("training return", f"{returns[-1]:.1f}" if returns else "-"),
            (
                "return without noise",
                (points and f"{points[-1]['mean_return']:.1f}") or "-",
            ),
            ("steps to a return of 90", f"{figures['steps_to_90'] or '-'}"),
        ]
        do_all(
            lambda: print_table(str(self.out), ("figure", "value"), rows),
            lambda: write_json(self.json, figures),
        )
        if figures["interrupted"]:
            say("Stopped early; the same command with --resume goes on.")
            return 1
        return 0
