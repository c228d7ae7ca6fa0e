"""The command ``evaluate steering``."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from loco_drake.cli.evaluation import SimulatedEvaluation, print_by_label, say_of
from loco_drake.cli.output import tracked, write_figure
from loco_drake.motion.gaits import parse_label

if TYPE_CHECKING:
    from loco_drake.evaluation.steering_courses import Course
    from loco_drake.systems.scenario import Scenario


@dataclass(kw_only=True)
class EvaluateSteering(SimulatedEvaluation):
    """Drive the simulated robot by commands and measure how it follows them."""

    # Gait labels, such as dog-trot dog-pace. Default: those that the policy was trained
    # on.
    labels: tuple[str, ...] = ()
    # Number of 60 s drives per label; seeds count up from --seed.
    seeds: int = 2
    # Seed of the first drive, and of the generated motion.
    seed: int = 0
    # Search for the range of each label; otherwise the published ranges are used.
    search: bool = False
    # Weights of the policy, or the name of a shipped variant, such as randomized.
    # Default: the robot's main policy.
    policy: Path | None = None
    # Folder for pictures: errors over the grid; of each gait the response to commands
    # and a figure of eight.
    figures: Path | None = None

    def prepare(self, name: str) -> "tuple[Scenario, list[Course]]":
        """Returns what to simulate for a robot."""
        from loco_drake.control.actor import load_actor
        from loco_drake.evaluation.steering_courses import Course
        from loco_drake.models.robots import get_robot
        from loco_drake.models.shipped import policy_path
        from loco_drake.systems.steering import command_ranges

        robot = get_robot(name)
        trained = load_actor(policy_path(robot, self.policy), robot).config.labels
        labels = [parse_label(label) for label in self.labels or trained]
        ranges = {} if self.search else command_ranges(robot)
        seeds = range(self.seed, self.seed + self.seeds)
        return self._scenario(name, str(labels[0])), [
            Course(str(label), seeds, ranges.get(label.index)) for label in labels
        ]

    def _scenario(self, name: str, label: str) -> "Scenario":
        """Returns the scenario of a robot, which begins with the gait ``label``."""
        from loco_drake.models.robots import get_robot
        from loco_drake.models.shipped import policy_path
        from loco_drake.systems.scenario import (
            GeneratedReference,
            Scenario,
            SteeringConfig,
            TrainedPolicy,
        )

        return Scenario(
            robot=name,
            reference=GeneratedReference(gait=label, duration=60.0),
            steering=SteeringConfig(measured_ranges=False),
            policy=TrainedPolicy(weights=policy_path(get_robot(name), self.policy)),
        )

    def evaluate(
        self, name: str, scenario: "Scenario", courses: "list[Course]"
    ) -> dict[str, Any]:
        """Returns the figures of one robot."""
        from loco_drake.evaluation.steering_table import overall, run_courses

        results = run_courses(scenario, courses, self.workers)
        labels = dict(tracked(results, f"Driving {name}", len(courses)))
        return {"robot": name, "labels": labels, "all": overall(labels)}

    def show(self, name: str, figures: dict[str, Any]) -> int:
        """Prints tables of all labels, and draws the pictures; returns 0."""
        rows = {**figures["labels"], "all of these": figures["all"]}
        print_by_label(f"{name}, steered", ["steering"], rows)
        title = f"{name}, ranges of the commands"
        print_by_label(title, ["steering_range"], figures["labels"])
        if self.figures is not None:
            self._draw(self.figures, name, figures)
        return 0

    def _draw(self, folder: Path, name: str, figures: dict[str, Any]) -> None:
        from loco_drake.evaluation.steering_pictures import steering_figures

        say_of(name)("Drawing")
        scenario = self._scenario(name, next(iter(figures["labels"])))
        for title, picture in steering_figures(scenario, figures, self.seed):
            write_figure(picture, folder / f"{name}-{title}.png")
