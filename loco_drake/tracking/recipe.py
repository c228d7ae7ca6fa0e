"""Recipes: everything that a robot's policy is trained by, in one YAML file."""

from copy import deepcopy
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import yaml

from loco_drake.common.errors import (
    InputError,
    check_at_least,
    check_bounds,
    check_choice,
    check_name,
    quoted,
)
from loco_drake.common.files import atomic_path
from loco_drake.common.typed import FieldError, convert
from loco_drake.common.typed_yaml import read_yaml
from loco_drake.models.robot_files import is_robot_file
from loco_drake.models.robots import get_robot
from loco_drake.tracking.config import TrainingConfig
from loco_drake.tracking.guided_config import GuidedConfig
from loco_drake.tracking.recipe_parts import (
    BODY,
    EVALUATION,
    Body,
    Common,
    Evaluation,
    ReferenceSet,
    Stage,
)

Config = TypeVar("Config", TrainingConfig, GuidedConfig)

_WORLD = ("plant", "termination", "reset_noise")  # of a guided stage, from common
_SHIPPED = Path(__file__).parent / "recipes"


@dataclass(kw_only=True)
class Before:
    """The first stages of another recipe, such as that of another robot."""

    # A shipped recipe or a YAML file.
    recipe: Path
    # How many of its stages.
    stages: int = 1

    def read(self) -> "Recipe":
        """Returns the recipe without its later stages.

        Raises:
            InputError: if there is none, it is unsound, or has no such stage.
        """
        recipe = read_recipe(self.recipe)
        check_bounds(
            "The stages of the recipe before", self.stages, 1, len(recipe.stages)
        )
        return replace(recipe, stages=recipe.stages[: self.stages])


@dataclass(kw_only=True)
class Recipe:
    """What a robot's policy is trained by, from nothing to its weights."""

    # Robot: go2, a1, or the YAML file of another.
    robot: str = "go2"
    # Seed of the trainings; that of stage k, counted from 0, is larger by k.
    seed: int = 0
    # Environments that are simulated side by side.
    environments: int = 64
    # Networks of the first stage: null for new ones, a shipped policy such as go2, or
    # the policy.safetensors or checkpoint.safetensors of a run; of any robot.
    start_from: Path | None = None
    # How the tokenizer learns the robot first, unless it knows it; null for not at all.
    body: Body | None = None
    # Stages to do first, whose networks the first stage begins with; null for none.
    before: Before | None = None
    # What to train on, by name.
    references: dict[str, ReferenceSet] = field(default_factory=dict)
    common: Common = field(default_factory=Common)
    stages: list[Stage] = field(default_factory=list)
    # Stage whose network acts far from the plan, while that of the last stage acts near
    # it; null if the last one acts everywhere.
    recovery: str | None = None
    # Null for none.
    evaluation: Evaluation | None = field(default_factory=Evaluation)

    def check(self) -> None:
        """Raises InputError unless everything can begin."""
        get_robot(self.robot)
        check_at_least("seed", self.seed, 0)
        check_bounds("The recipe's environments", self.environments, 1)
        if not (self.stages and self.references):
            raise InputError("A recipe needs references and stages.")
        if self.before is not None:
            if self.start_from is not None:
                raise InputError("A recipe has either start_from or before.")
            self.before.read()
        if self.body is not None:
            self.body.check()
        if EVALUATION in self.references:
            raise InputError(f"No references can be called {EVALUATION!r}.")
        if self.evaluation is not None:
            self.evaluation.check()
        for name, references in self.references.items():
            _check_folder_name("name of references", name)
            references.check(name)
        names = [stage.name for stage in self.stages]
        if self.stages[0].guided is not None:
            raise InputError("The first stage has no policy that it could guide.")
        if self.recovery is not None:
            check_choice("stage for recovery", self.recovery, names[:-1])
            self._check_joined(len(names) - 1, self.recovery)
        for index, stage in enumerate(self.stages):
            _check_folder_name("name of a stage", stage.name)
            if names.count(stage.name) > 1:
                raise InputError(f"Two stages are called {quoted(stage.name)}.")
            check_bounds(f"Steps of the stage {stage.name}", stage.steps, 1)
            if stage.after is not None:
                what = f"stage before {stage.name}"
                check_choice(what, stage.after, names[:index])
            if stage.recovery is not None:
                what = f"stage for recovery in {stage.name}"
                check_choice(what, stage.recovery, names[:index])
                if stage.guided is None:
                    raise InputError(
                        f"The stage {stage.name} has a recovery, but is not guided."
                    )
                before = self.before_stage(index)
                assert before is not None
                self._check_joined(before, stage.recovery)
            for name in stage.references:
                check_choice("references", name, self.references)
            try:
                self.training(index).check()
                if stage.guided is not None:
                    self.guided(index).check()
            except InputError as error:
                raise InputError(f"Stage {quoted(stage.name)}: {error}") from None

    def _check_joined(self, near: int, far: str) -> None:
        """Raises InputError if one of two stages to join has two networks already."""
        names = [stage.name for stage in self.stages]
        for name in (names[near], far):
            index: int | None = names.index(name)
            while index is not None:
                if self.stages[index].recovery is not None:
                    raise InputError(f"The stage {name} has a recovery already.")
                index = self.before_stage(index)

    def before_stage(self, index: int) -> int | None:
        """Returns the stage whose networks a stage begins with, None for the first."""
        after = self.stages[index].after
        if after is not None:
            return [stage.name for stage in self.stages].index(after)
        return index - 1 if index else None

    def references_of(self, stage: Stage) -> list[str]:
        """Returns the names of the references of a stage."""
        return stage.references or list(self.references)

    def training(self, index: int, workers: int = 1) -> TrainingConfig:
        """Returns the configuration of a stage, counted from 0.

        Raises:
            InputError: if an option is unknown, of the wrong type or the recipe's.
        """
        stage = self.stages[index]
        if self.environments % workers:
            raise InputError(
                f"--workers must divide the recipe's {self.environments} environments, "
                f"not be {workers}."
            )
        parts = {
            part: _overlaid(getattr(self.common, part), getattr(stage, part))
            for part in ("environment", "ppo")
        }
        if "robot" in parts["environment"]:
            raise InputError("the robot is given once, for the whole recipe.")
        parts["environment"]["robot"] = self.robot
        values = {
            "steps": stage.steps,
            "workers": workers,
            "per_worker": self.environments // workers,
            "seed": self.seed + index,
            **parts,
        }
        return _converted(values, TrainingConfig)

    def guided(self, index: int, workers: int = 1) -> GuidedConfig:
        """Returns the configuration of a stage of guided policy search.

        Raises:
            InputError: as :meth:`training`.
        """
        stage = self.stages[index]
        own = {"steps": stage.steps, "workers": workers, "seed": self.seed + index}
        options = stage.guided or {}
        for name in ("robot", *own):
            if name in options:
                raise InputError(f"{name} is no option of a stage's guided search.")
        if stage.environment or stage.ppo:
            raise InputError("a guided stage has no environment and no ppo.")
        # Laws are found in the world of the other stages.
        world = {k: v for k, v in self.common.environment.items() if k in _WORLD}
        values = {**_overlaid(world, options), **own, "robot": self.robot}
        return _converted(values, GuidedConfig)


def read_recipe(name: Path, robot: str | None = None) -> Recipe:
    """Returns a recipe: a YAML file, or a shipped one by its name, such as go2.

    It is for ``robot`` if that is given.

    Raises:
        InputError: if there is none of that name, or it is unsound.
    """
    path = Path(name)
    shipped = {file.stem: file for file in sorted(_SHIPPED.glob("*.yaml"))}
    if not path.is_file():
        if str(name) not in shipped:
            raise InputError(
                f"There is no recipe {str(name)!r}; give a YAML file, or a shipped "
                f"recipe: {', '.join(shipped)}."
            )
        path = shipped[str(name)]
    recipe = read_yaml(path, Recipe, "a recipe")
    if robot is not None:
        # A run goes on from any folder.
        recipe.robot = str(Path(robot).resolve()) if is_robot_file(robot) else robot
    recipe.check()
    return recipe


def write_recipe(recipe: Recipe, path: Path) -> None:
    """Writes a recipe with all its fields, for :func:`read_recipe`."""
    values = asdict(recipe)
    parts = [values, *values["references"].values()]
    if recipe.before is not None:
        parts.append(values["before"])
    for name in (EVALUATION, BODY):
        parts += [] if values[name] is None else [values[name]["motions"]]
    for part in parts:
        part.update((k, str(v)) for k, v in part.items() if isinstance(v, Path))
    with atomic_path(path) as temporary:
        temporary.write_text(yaml.safe_dump(values, sort_keys=False))


def scaled(recipe: Recipe, scale: float) -> Recipe:
    """Returns a copy with so much of the steps and motions, at least one of each."""
    check_bounds("--scale", scale, 0, 1, above=True)
    copy = deepcopy(recipe)
    for stage in copy.stages:
        stage.steps = max(1, round(scale * stage.steps))
        if stage.guided is not None:
            for name in ("stretches", "updates"):
                whole = stage.guided.get(name, getattr(GuidedConfig, name))
                stage.guided[name] = max(1, round(scale * whole))
    for references in copy.references.values():
        references.count = max(1, round(scale * references.count))
    if (body := copy.body) is not None:
        body.steps = max(1, round(scale * body.steps))
        body.motions.count = max(1, round(scale * body.motions.count))
    if copy.evaluation is not None:
        copy.evaluation.every = max(1, round(scale * copy.evaluation.every))
    return copy


def _converted(values: dict[str, Any], to: type[Config]) -> Config:
    """Returns a configuration; raises InputError if there is no such option."""
    try:
        config: Config = convert(values, to, numeric_text=True)
    except FieldError as error:
        raise InputError(f"{error}.") from None
    return config


def _check_folder_name(what: str, name: str) -> None:
    check_name(what, name)
    if name.startswith("."):
        raise InputError(f"A {what} must not begin with a dot, like {quoted(name)}.")


def _overlaid(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Returns nested mappings, those of ``above`` before those of ``below``."""
    result = dict(below)
    for key, value in above.items():
        old = result.get(key)
        both = isinstance(value, dict) and isinstance(old, dict)
        result[key] = _overlaid(old, value) if both else value  # type: ignore[arg-type]
    return result
