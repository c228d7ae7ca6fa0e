"""The command ``evaluate robustness``."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from loco_drake.cli.evaluation import SimulatedEvaluation, print_by_label, say_of
from loco_drake.cli.options import Figures, Policy, TrainedLabels, option
from loco_drake.cli.output import print_table, tracked, write_figure
from loco_drake.common.errors import check_choice
from loco_drake.motion.gaits import parse_label

if TYPE_CHECKING:
    from loco_drake.evaluation.robustness_table import Course
    from loco_drake.systems.scenario import Scenario


@dataclass(kw_only=True)
class EvaluateRobustness(SimulatedEvaluation):
    """Disturb the simulated robot ever more and measure what it survives."""

    labels: TrainedLabels = ()
    # Disturbances: push, slope, step, friction, payload, latency.
    kinds: Annotated[tuple[str, ...], option(metavar="NAME ...", default="all")] = ()
    # Number of seeds, counted up from --seed: each gives a plan of each label, tracked
    # under every disturbance.
    seeds: int = 2
    # Seed: of the first plan of each label.
    seed: int = 0
    policy: Policy = None
    # Folder for pictures: of the success curves.
    figures: Figures = None

    def check(self) -> None:
        """Raises InputError if an option is wrong."""
        from loco_drake.evaluation.disturbances import KINDS

        super().check()
        for kind in self.kinds:
            check_choice("kind", kind, KINDS)

    def prepare(self, name: str) -> "tuple[Scenario, list[Course]]":
        """Returns what to simulate for a robot."""
        from loco_drake.control.actor_file import load_actor
        from loco_drake.evaluation.disturbances import DURATION, KINDS
        from loco_drake.evaluation.robustness_table import Course
        from loco_drake.models.robots import get_robot
        from loco_drake.models.shipped import policy_path
        from loco_drake.systems.scenario import (
            GeneratedReference,
            Scenario,
            TrainedPolicy,
        )

        robot = get_robot(name)
        weights = policy_path(robot, self.policy)
        trained = load_actor(weights, robot).config.labels
        labels = [str(parse_label(label)) for label in self.labels or trained]
        scenario = Scenario(
            robot=robot.definition,
            reference=GeneratedReference(gait=labels[0], duration=DURATION),
            policy=TrainedPolicy(weights=weights),
        )
        kinds = tuple(dict.fromkeys(self.kinds or KINDS))
        seeds = range(self.seed, self.seed + self.seeds)
        return scenario, [Course(label, s, kinds) for label in labels for s in seeds]

    def evaluate(
        self, name: str, scenario: "Scenario", courses: "list[Course]"
    ) -> dict[str, Any]:
        """Returns the figures of one robot."""
        from loco_drake.evaluation.disturbances import DURATION
        from loco_drake.evaluation.robustness_table import run_courses, summarize

        outcomes = run_courses(scenario, courses, self.executor)
        done = tracked(outcomes, f"Disturbing {name}", len(courses))
        return {
            "robot": name,
            "duration_s": DURATION,
            "seeds": self.seeds,
            **summarize(courses, done),
        }

    def show(self, name: str, figures: dict[str, Any]) -> int:
        """Prints tables of all labels and levels; returns 0."""
        from loco_drake.evaluation.robustness_pictures import levels_table

        rows = {**figures["labels"], "all of these": figures["all"]}
        print_by_label(f"{name}, disturbed", ["robustness"], rows)
        print_table(f"{name}, success of all gaits", *levels_table(figures["all"]))
        return 0

    def draw(self, name: str, figures: dict[str, Any]) -> None:
        """Writes a picture of the curves, if it is wanted."""
        from loco_drake.evaluation.report.figures import Figures
        from loco_drake.evaluation.robustness_pictures import curves_figure

        if self.figures is not None:
            say_of(name)("Drawing")
            picture = curves_figure({name: Figures(figures)})
            write_figure(picture, self.figures / f"{name}-robustness.png")
