"""The folder of a recipe's run: what is where in it, and what it says of the run."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from loco_drake.common.errors import InputError
from loco_drake.common.files import read_json
from loco_drake.common.run_folder import CHECKPOINT
from loco_drake.tracking.learning_curve import PROGRESS, learning_curve
from loco_drake.tracking.recipe import Recipe
from loco_drake.tracking.recipe_evaluation import read_points, steps_to_goal
from loco_drake.tracking.train import POLICY

RECIPE, CURVE, REFERENCES = "recipe.yaml", "curve.json", "references"
BEFORE = "before"  # folder of the stages of another recipe
TOKENIZER = "tokenizer"  # folder of its training, if it had to learn the robot
# What a stage ended with; written when nothing is left to do in its folder.
FIGURES = "figures.json"
START = "start.safetensors"
POINTS = "evaluation.json"


def check_recipe_folder(folder: Path, *, resume: bool) -> None:
    """Raises InputError if a recipe cannot begin, or go on, in ``folder``."""
    found = [x for x in (RECIPE, POLICY, CHECKPOINT) if (folder / x).exists()]
    found += sorted(path.name for path in folder.glob("[0-9]*-*"))
    if resume and RECIPE not in found:
        raise InputError(
            f"There is no recipe to resume in {str(folder)!r}, which has no {RECIPE}; "
            "to begin one, leave out --resume."
        )
    if found and not resume:
        raise InputError(
            f"{str(folder)!r} holds a run already ({', '.join(found)}); resume it "
            "with --resume, or name another folder with --out."
        )


def stage_folder(folder: Path, recipe: Recipe, index: int) -> Path:
    """Returns the folder of a stage, such as ``2-steered``; the index begins at 0."""
    return folder / f"{index + 1}-{recipe.stages[index].name}"


def recipe_curve(folder: Path, recipe: Recipe) -> dict[str, Any]:
    """Returns the learning curve of all stages, one after the other.

    Returns:
        "steps" and "seconds" of all stages so far, those of a recipe before this one
        included; "stages" with the name of each that has begun and the steps at which
        it did; and "curve" with "steps", "seconds" and
        "return": the mean over its labels of the normalized return (0-100) of recent
        training episodes, see :func:`.learning_curve`. "evaluation" has the points of
        :class:`.Evaluator`, and "steps_to_90" the steps of its first return of 90, or
        None.
    """
    stages: list[dict[str, Any]] = []
    curve: dict[str, list[Any]] = {"steps": [], "seconds": [], "return": []}
    steps, seconds = 0, 0.0
    if recipe.before is not None:
        earlier = recipe_curve(folder / BEFORE, recipe.before.read())
        steps, seconds = earlier["steps"], earlier["seconds"]
    for index, stage in enumerate(recipe.stages):
        own = stage_folder(folder, recipe, index)
        if not own.is_dir():
            break
        stages.append({"name": stage.name, "first_step": steps})
        log = (
            learning_curve(own / PROGRESS)
            if (own / PROGRESS).is_file()
            else {"steps": [], "seconds": [], "return": {}}
        )
        curve["steps"] += [steps + x for x in log["steps"]]
        curve["seconds"] += [round(seconds + x, 1) for x in log["seconds"]]
        for scores in zip(*log["return"].values(), strict=True):
            known = [score for score in scores if score is not None]
            curve["return"].append(round(sum(known) / len(known), 2))
        ended = own / FIGURES
        done = read_json(ended) if ended.is_file() else {}
        steps += int(done.get("steps", max(log["steps"], default=0)))
        seconds = max(curve["seconds"], default=seconds)
    points = read_points(folder / POINTS)
    return {
        "steps": steps,
        "seconds": seconds,
        "stages": stages,
        "curve": curve,
        "evaluation": [asdict(point) for point in points],
        "steps_to_90": steps_to_goal(points),
    }
