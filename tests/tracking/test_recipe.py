"""Recipes as files: what is read, and what is refused."""

from dataclasses import replace
from pathlib import Path

import pytest

from loco_drake.common.errors import InputError
from loco_drake.motion.gaits import LABELS
from loco_drake.tracking.config import EnvironmentConfig, PpoConfig, TrainingConfig
from loco_drake.tracking.recipe import (
    Recipe,
    read_recipe,
    scaled,
    write_recipe,
)
from loco_drake.tracking.recipe_parts import ReferenceSet, Stage

TEXT = """
robot: a1
seed: 5
environments: 12
references:
  plain: {labels: [all]}
  fast: {labels: [dog-gallop, all, dog-gallop], count: 8, first_seed: 40}
common:
  environment: {fall_cost: 15, termination: {position: 1.5, rotation: 1.2}}
  ppo: {batch: 64, actor_rate: 1e-3}
stages:
  - {name: first, steps: 1000, references: [plain]}
  - name: second
    steps: 500
    environment: {termination: {position: 1.0}, randomization: {push: [0.1, 0.5]}}
"""


@pytest.fixture
def recipe(tmp_path):
    (tmp_path / "recipe.yaml").write_text(TEXT)
    return read_recipe(tmp_path / "recipe.yaml")


def test_options_of_a_stage_are_its_own_then_the_recipes_then_the_defaults(recipe):
    """Also within parts of parts; PyYAML takes 1e-3 for text."""
    environment = EnvironmentConfig(robot="a1", fall_cost=15.0)
    environment.termination.position, environment.termination.rotation = 1.5, 1.2
    ppo = PpoConfig(batch=64, actor_rate=0.001)
    first = TrainingConfig(
        steps=1000, workers=3, per_worker=4, seed=5, environment=environment, ppo=ppo
    )
    assert recipe.training(0, workers=3) == first
    second = replace(environment, randomization=replace(environment.randomization))
    second.termination = replace(environment.termination, position=1.0)
    second.randomization.push = (0.1, 0.5)
    assert recipe.training(1, workers=3) == replace(
        first, steps=500, seed=6, environment=second
    )
    assert recipe.references_of(recipe.stages[0]) == ["plain"]
    assert recipe.references_of(recipe.stages[1]) == ["plain", "fast"]


def test_all_stands_for_the_fifteen_and_each_label_is_taken_once(recipe):
    assert tuple(recipe.references["plain"].gaits) == LABELS
    gallop = LABELS[2]
    others = [label for label in LABELS if label != gallop]
    assert recipe.references["fast"].gaits == [gallop, *others]


@pytest.mark.parametrize("robot", ["go2", "a1"])
def test_a_recipe_is_written_as_it_is_read(robot, recipe, tmp_path):
    recipe.start_from = Path("go2")
    recipe.references["own"] = ReferenceSet(folder=Path("motions/own"))
    silent = replace(recipe, evaluation=None)
    for one in (recipe, silent, read_recipe(Path(robot))):
        write_recipe(one, tmp_path / "again.yaml")
        assert read_recipe(tmp_path / "again.yaml") == one


def test_a_share_of_a_recipe_has_that_share_of_steps_and_motions(recipe):
    part = scaled(recipe, 0.01)
    assert [stage.steps for stage in part.stages] == [10, 5]
    assert [of.count for of in part.references.values()] == [1, 1]
    assert [stage.steps for stage in recipe.stages] == [1000, 500]
    assert (recipe.evaluation.every, part.evaluation.every) == (1_000_000, 10_000)
    assert scaled(recipe, 1.0) == recipe


@pytest.mark.parametrize("robot", ["go2", "a1"])
def test_shipped_recipes_need_no_more_steps_than_their_budget(robot):
    recipe = read_recipe(Path(robot))
    assert recipe.robot == robot
    stages = [*recipe.stages, *(recipe.before.read().stages if recipe.before else [])]
    assert sum(stage.steps for stage in stages) <= 60_000_000


def test_a_guided_stage_has_the_options_of_train_guided(recipe):
    guided = {"stretches": 200, "stretch": {"length": 80}, "learning_rate": "1e-4"}
    recipe.stages[1].guided, recipe.stages[1].steps = guided, 3
    recipe.stages[1].environment = {}
    recipe.check()
    found = recipe.guided(1, workers=3)
    assert (found.robot, found.seed, found.workers, found.steps) == ("a1", 6, 3, 3)
    assert (found.stretches, found.stretch.length) == (200, 80)
    assert (found.stretch.tail, found.learning_rate) == (15, 1e-4)
    recipe.stages[1].recovery = "second"
    with pytest.raises(InputError, match="recovery in second"):
        recipe.check()
    recipe.stages[1].recovery = "first"
    recipe.check()
    part = scaled(recipe, 0.01).stages[1]
    assert (part.steps, part.guided["stretches"], part.guided["updates"]) == (1, 2, 50)
    assert "updates" not in guided
    recipe.stages[1].guided = None
    with pytest.raises(InputError, match="second has a recovery, but is not guided"):
        recipe.check()


def test_guided_stages_and_the_rest_of_the_recipe(recipe):
    recipe.common.environment["plant"] = {"friction": 0.6}
    guided = Stage(name="shown", steps=2, guided={}, recovery="second")
    recipe.stages.append(guided)
    recipe.check()
    found = recipe.guided(2)
    assert (found.plant.friction, found.termination.position) == (0.6, 1.5)
    recipe.recovery = "first"
    with pytest.raises(InputError, match="The stage shown has a recovery already"):
        recipe.check()
    recipe.recovery = None
    recipe.stages.append(replace(guided, name="again"))
    with pytest.raises(InputError, match="The stage shown has a recovery already"):
        recipe.check()
    recipe.stages[3] = Stage(name="after", steps=2, guided={}, ppo={"batch": 64})
    with pytest.raises(InputError, match="a guided stage has no environment and no"):
        recipe.check()


@pytest.mark.parametrize(
    ("stage", "guided", "said"),
    [
        (0, {}, "The first stage has no policy that it could guide"),
        (1, {"batch": 64}, "Stage 'second': it has the unknown field 'batch'"),
        (1, {"robot": "go2"}, "robot is no option of a stage's guided search"),
        (1, {"seed": 1}, "seed is no option of a stage's guided search"),
        (1, {"stretch": {"length": 10}}, "length must be 40 or more, not 10"),
    ],
)
def test_guided_stages_that_are_wrong(recipe, stage, guided, said):
    recipe.stages[stage].guided, recipe.stages[stage].environment = guided, {}
    with pytest.raises(InputError, match=said):
        recipe.check()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("robot: a1", "robot: spot", "go2, a1"),
        ("seed: 5", "seed: -5", "--seed must be 0 or more, not -5"),
        ("environments: 12", "environments: 0", "environments must be 1 or more"),
        ("environments: 12", "environments: 40", "--batch must be at least 80"),
        ("name: second", "name: first", "Two stages are called 'first'"),
        ("name: second", "name: a/b", "no slash"),
        ("name: second", "name: ..", "must not begin with a dot"),
        ("plain: {", "../plain: {", "no slash"),
        ("steps: 500", "steps: 0", "Steps of the stage second must be 1 or more"),
        ("steps: 500", "steps: many", "must be a whole number, not 'many'"),
        ("steps: 500", "step: 500", "unknown field 'step'"),
        ("references: [plain]", "references: [slow]", "plain, fast"),
        ("labels: [all]", "labels: [cat-trot]", "dog-pace"),
        ("labels: [all]", "labels: []", "no labels"),
        ("  plain: {", "  evaluation: {", "No references can be called 'evaluation'"),
        ("seed: 5", "evaluation: {every: 0}", "every must be 1 or more"),
        ("count: 8", "count: 0", "count must be 1 or more"),
        ("fall_cost: 15", "fall: 15", "environment has the unknown field 'fall'"),
        ("fall_cost: 15", "robot: go2", "the robot is given once"),
        ("fall_cost: 15", "fall_cost: -1", "Stage 'first': --fall-cost must be 0"),
        ("push: [0.1, 0.5]", "push: [0.5, 0.1]", "Stage 'second': "),
        ("push: [0.1, 0.5]", "push: 3", "randomization.push must be"),
    ],
)
def test_unsound_recipes_are_refused_in_one_sentence(old, new, said, tmp_path):
    assert old in TEXT
    (tmp_path / "recipe.yaml").write_text(TEXT.replace(old, new))
    with pytest.raises(InputError) as error:
        read_recipe(tmp_path / "recipe.yaml")
    assert said in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_a_recipe_that_does_not_exist_is_refused_with_those_that_do():
    with pytest.raises(InputError, match="or a shipped recipe: a1, go2"):
        read_recipe(Path("go3"))
    with pytest.raises(InputError, match="needs references and stages"):
        Recipe(stages=[Stage(name="first", steps=1)]).check()


def test_workers_must_divide_the_environments(recipe):
    with pytest.raises(InputError, match="must divide the recipe's 12 environments"):
        recipe.training(0, workers=5)
