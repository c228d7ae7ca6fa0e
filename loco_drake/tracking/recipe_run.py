"""Trainings by a recipe, from its motions to the weights; resumable at any time."""

import shutil
import signal
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from threading import Event
from typing import Any

from loco_drake.common.determinism import single_thread
from loco_drake.common.errors import InputError, quoted
from loco_drake.common.files import atomic_path, write_json
from loco_drake.common.run_folder import CHECKPOINT, locked, stop_requests
from loco_drake.control.actor_file import halve_policy
from loco_drake.control.plan import Plan
from loco_drake.engine.local import Local
from loco_drake.models.robots import get_robot
from loco_drake.models.shipped import training_path
from loco_drake.tracking.beginning import read_beginning
from loco_drake.tracking.joining import join_policies
from loco_drake.tracking.recipe import Recipe, read_recipe, write_recipe
from loco_drake.tracking.recipe_body import knows, make_body, tokenizer_in
from loco_drake.tracking.recipe_evaluation import Evaluator
from loco_drake.tracking.recipe_folder import (
    BEFORE,
    CURVE,
    FIGURES,
    POINTS,
    RECIPE,
    REFERENCES,
    START,
    TOKENIZER,
    check_recipe_folder,
    recipe_curve,
    stage_folder,
)
from loco_drake.tracking.recipe_parts import BODY, EVALUATION, Stage
from loco_drake.tracking.recipe_references import make_references
from loco_drake.tracking.references import load_references
from loco_drake.tracking.train import POLICY, train_tracker
from loco_drake.tracking.train_guided import train_guided

# What must be the same if a run goes on.
_WHOLE = ("robot", "seed", "environments", "start_from", "before", "body")
_BOTH = "both.safetensors"  # the policy in 32 bits, while it is written

# Is told what is being done, how much of it is done and of how much, and a note.
Report = Callable[[str, int, int, str], None]


def run_recipe(
    folder: Path,
    recipe: Recipe | None = None,
    *,
    resume: bool = False,
    workers: int = 1,
    report: Report = lambda what, done, total, note: None,
) -> dict[str, Any]:
    """Trains a policy by a recipe; see docs/tracking.md for what is in ``folder``.

    An interruption (Ctrl-C), or being killed, loses at most the current batch.

    Args:
        folder: for motions, stages and policy.
        recipe: what to do; with ``resume``, None for that of the folder.
        resume: go on in ``folder``. Stages that have not begun may be others then.
        workers: simulation processes; results do not depend on them.
        report: called after each batch.

    Returns:
        robot, interrupted, steps of all stages so far, and their learning curve.

    Raises:
        InputError: if the folder holds a run and ``resume`` is not set, or the other
            way round; if another process works in it; or if the recipe is another.
        ChildProcessError: if workers die several times at the same step.
    """
    folder = Path(folder)
    check_recipe_folder(folder, resume=resume)
    if recipe is None:
        recipe = read_recipe(folder / RECIPE)
    recipe.check()
    recipe.training(0, workers)
    with locked(folder), single_thread(), stop_requests() as stop:
        check_recipe_folder(folder, resume=resume)
        evaluator = None
        if recipe.evaluation is not None:
            motions = folder / REFERENCES / EVALUATION
            evaluator = Evaluator(recipe, motions, folder / POINTS)
        run = _Run(folder, recipe, workers, report, stop, evaluator)
        if resume:
            run.check_continues(read_recipe(folder / RECIPE))
        run.begin(resume=resume)
        done = run.do_before() and run.make_body() and run.make_references()
        interrupted = not (done and run.train())
        if not interrupted:
            run.finish()
        curve = recipe_curve(folder, recipe)
        write_json(folder / CURVE, curve)
    return {"robot": recipe.robot, "interrupted": interrupted, **curve}


@dataclass(frozen=True)
class _Run:
    """A recipe in its locked folder."""

    folder: Path
    recipe: Recipe
    workers: int
    report: Report
    stop: Event
    evaluator: Evaluator | None

    def stage_folder(self, index: int) -> Path:
        return stage_folder(self.folder, self.recipe, index)

    def check_continues(self, before: Recipe) -> None:
        """Raises InputError unless what has begun would be the same by ``before``."""
        old, new = asdict(before), asdict(self.recipe)
        differ = [name for name in _WHOLE if old[name] != new[name]]
        kept = {x: new["references"].get(x) for x in old["references"]}
        if kept != old["references"]:
            differ.append("references")
        # What differs for the whole recipe does so for each stage.
        for index, stage in enumerate([] if differ else before.stages):
            if not stage_folder(self.folder, before, index).exists():
                break
            if index >= len(self.recipe.stages) or _of_stage(before, index) != (
                _of_stage(self.recipe, index)
            ):
                differ.append(f"the stage {quoted(stage.name)}, which has begun")
        if differ:
            raise InputError(
                f"The run in {str(self.folder)!r} follows a recipe with other "
                f"{', '.join(differ)}; resume it as it is, or begin in another folder "
                "with --out."
            )

    def begin(self, *, resume: bool) -> None:
        """Writes the recipe, and what the first stage starts from."""
        start = self.folder / START
        if self.recipe.start_from is not None and not (resume and start.is_file()):
            path = training_path(self.recipe.start_from)
            read_beginning(path, self.recipe.training(0).ppo.hidden)
            with atomic_path(start) as temporary:
                shutil.copyfile(path, temporary)
        path = self.folder / RECIPE
        if not path.is_file() or read_recipe(path) != self.recipe:
            write_recipe(self.recipe, path)

    def do_before(self) -> bool:
        """Does the stages of the recipe before; returns False if it was stopped."""
        if self.recipe.before is None:
            return True
        folder, start = self.folder / BEFORE, self.folder / START
        if start.is_file():
            return True
        first = self.recipe.before.read()
        figures = run_recipe(
            folder,
            first,
            resume=(folder / RECIPE).is_file(),
            workers=self.workers,
            report=lambda what, *rest: self.report(f"before: {what}", *rest),
        )
        if figures["interrupted"]:
            return False
        last = stage_folder(folder, first, len(first.stages) - 1)
        ended = CHECKPOINT if first.stages[-1].guided is None else POLICY
        with atomic_path(start) as temporary:
            shutil.copyfile(last / ended, temporary)
        return True

    def make_body(self) -> bool:
        """Teaches the tokenizer the robot, if need be; returns False if stopped."""
        robot = get_robot(self.recipe.robot)
        if self.recipe.body is None or knows(robot):
            return True

        def report(done: int, total: int) -> None:
            self.report("motions body", done, total, "")

        made = make_body(
            robot,
            self.recipe.body,
            self.folder / REFERENCES / BODY,
            self.folder / TOKENIZER,
            self.recipe.seed,
            report,
            self.stop.is_set,
        )
        return made is not None

    def make_references(self) -> bool:
        """Makes all motions; returns False if it was stopped."""
        robot, sets = get_robot(self.recipe.robot), dict(self.recipe.references)
        if self.recipe.evaluation is not None:
            sets[EVALUATION] = self.recipe.evaluation.motions
        own = tokenizer_in(self.folder / TOKENIZER)
        for name, references in sets.items():

            def report(done: int, total: int, name: str = name) -> None:
                self.report(f"motions {name}", done, total, "")

            folder = self.folder / REFERENCES / name
            stopped = self.stop.is_set
            if not make_references(robot, references, folder, report, stopped, own):
                return False
        return True

    def train(self) -> bool:
        """Does all stages that are not done; returns False if it was stopped."""
        plans: dict[str, list[Plan]] = {}
        for index, stage in enumerate(self.recipe.stages):
            if (self.stage_folder(index) / FIGURES).is_file():
                continue
            for name in self.recipe.references_of(stage):
                if self.stop.is_set():
                    return False
                if name not in plans:
                    robot = get_robot(self.recipe.robot)
                    folder = self.folder / REFERENCES / name
                    plans[name] = load_references(robot, folder)
            own = [x for n in self.recipe.references_of(stage) for x in plans[n]]
            if not self._train_stage(index, stage, own):
                return False
        return True

    def finish(self) -> None:
        """Writes the policy."""
        last = self.stage_folder(len(self.recipe.stages) - 1)
        target = self.folder / POLICY
        if self.recipe.recovery is None:
            halve_policy(last / POLICY, target)
            return
        both = self._join(last / POLICY, self.recipe.recovery)
        halve_policy(both, target)
        both.unlink()
        if self.evaluator:
            done = self._steps_before(len(self.recipe.stages))
            self.evaluator.evaluate(done, None, target)

    def _join(self, near: Path, stage: str) -> Path:
        """Writes the policy ``near`` and that of a stage, far from the plan, as one."""
        names = [one.name for one in self.recipe.stages]
        far = self.stage_folder(names.index(stage)) / POLICY
        join_policies(near, far, self.folder / _BOTH)
        return self.folder / _BOTH

    def _train_stage(self, index: int, stage: Stage, plans: list[Plan]) -> bool:
        folder, first = self.stage_folder(index), None
        resume = (folder / CHECKPOINT).is_file()
        earlier = self.recipe.before_stage(index)
        if not resume and earlier is not None:
            both = (stage, self.recipe.stages[earlier])
            by_ppo = all(one.guided is None for one in both)
            # Between trainings by PPO the checkpoint: it has all that its policy has.
            first = self.stage_folder(earlier) / (CHECKPOINT if by_ppo else POLICY)
            if stage.recovery is not None:
                first = self._join(first, stage.recovery)
        elif not resume and (self.folder / START).is_file():
            first = self.folder / START

        before = self._steps_before(index)

        def report(steps: int, scores: dict[str, float]) -> None:
            mean = sum(scores.values()) / len(scores)
            note = f"return {mean:.1f} of 100"
            self.report(f"{index + 1} {stage.name}", steps, stage.steps, note)
            if self.stop.is_set():  # before the training listened itself
                signal.raise_signal(signal.SIGINT)
            if stage.guided is not None:
                return  # steps are rounds
            if self.evaluator and self.evaluator.is_due(before + steps):
                self.evaluator.evaluate(before + steps, index, folder / POLICY)

        figures = self._train(index, stage, plans, first, report)
        if figures["interrupted"]:
            return False
        if self.evaluator:
            steps = before + figures["steps"]
            self.evaluator.evaluate(steps, index, folder / POLICY)
        write_json(folder / FIGURES, figures)
        return True

    def _train(
        self,
        index: int,
        stage: Stage,
        plans: list[Plan],
        first: Path | None,
        report: Callable[[int, dict[str, float]], None],
    ) -> dict[str, Any]:
        """Begins a stage with ``first``, or goes on if that is None."""
        folder = self.stage_folder(index)
        resume = (folder / CHECKPOINT).is_file()
        if stage.guided is None:
            config = self.recipe.training(index, self.workers)
            return train_tracker(
                plans, config, folder, resume=resume, first=first, report=report
            )
        guided = self.recipe.guided(index, self.workers)
        figures = train_guided(
            plans,
            first,
            guided,
            folder,
            resume=resume,
            report=report,
            executor=Local(self.workers),
        )
        (self.folder / _BOTH).unlink(missing_ok=True)
        # What it costs, as other stages have it.
        return {**figures, "rounds": figures["steps"], "steps": figures["periods"]}

    def _steps_before(self, index: int) -> int:
        folder, own = (
            self.folder,
            replace(self.recipe, stages=self.recipe.stages[:index]),
        )
        return int(recipe_curve(folder, own)["steps"])


def _of_stage(recipe: Recipe, index: int) -> tuple[Any, ...]:
    """Returns what a stage depends on, for comparison."""
    stage = recipe.stages[index]
    before = recipe.before_stage(index)
    own = (stage.name, before, recipe.references_of(stage))
    if stage.guided is not None:
        return *own, recipe.guided(index), stage.recovery
    return *own, recipe.training(index)
