"""The command ``evaluate steering``."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from loco_drake.cli.evaluation import SimulatedEvaluation, print_by_label, say_of
from loco_drake.cli.options import Figures, Policy, TrainedLabels
from loco_drake.cli.output import print_table, tracked, write_figure
from loco_drake.common.errors import InputError
from loco_drake.motion.gaits import parse_label

if TYPE_CHECKING:
    from loco_drake.evaluation.steering_courses import Course
    from loco_drake.systems.scenario import Scenario

_TASKS = 48  # recorded trajectories of a label whose velocities are asked for, at most
# Columns of the comparison: figure, title, decimals.
_OF_WAYS = (
    ("velocity_rmse_mps", "velocity, m/s RMS", 3),
    ("yaw_rate_rmse_radps", "yaw rate, rad/s RMS", 3),
    ("plan_velocity_rmse_mps", "... of the plan", 3),
    ("plan_yaw_rate_rmse_radps", "... of the plan", 3),
    ("bend_mps", "bent by, m/s", 2),
    ("bend_radps", "bent by, rad/s", 2),
    ("normalized_return", "return", 1),
    ("fall_rate", "falls", 2),
    ("plan_slip_median_mps", "slip of the plan, m/s", 3),
    ("plan_joint_limit_violations", "joint limits", 0),
)
_OF_NATURALNESS = (
    ("two_sample_accuracy", "two-sample"),
    ("two_sample_accuracy_of_turns", "... of turns"),
)


def ways_table(figures: dict[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Returns columns and rows of the comparison of ways of steering of a label."""
    from loco_drake.evaluation.naturalness import WAYS

    rows = []
    for way in ("not asked", *WAYS):
        driven = figures.get(way, {})
        natural = (figures["naturalness"] or {}).get(way, {})
        row = [way]
        for key, _, decimals in _OF_WAYS:
            value = driven.get(key)
            row.append("–" if value is None else f"{value:.{decimals}f}")
        for key, _ in _OF_NATURALNESS:
            value = natural.get(key)
            row.append("–" if value is None else f"{value['mean']:.2f}")
        rows.append(row)
    titles = [title for _, title, *_ in (*_OF_WAYS, *_OF_NATURALNESS)]
    return ["way", *titles], rows


@dataclass(kw_only=True)
class EvaluateSteering(SimulatedEvaluation):
    """Drive the simulated robot by commands and measure how it follows them."""

    labels: TrainedLabels = ()
    # Number of seeds, counted up from --seed: each gives a drive of 60 s of each label.
    seeds: int = 2
    # Seed: of the first drive, and of the generated motion.
    seed: int = 0
    # Search for the range of each label; otherwise the published ranges are used.
    search: bool = False
    # Compare bending the plan with telling the generator the command, and with both, in
    # the published ranges and, by a two-sample test, with recordings.
    compare: bool = False
    policy: Policy = None
    # Folder for pictures: errors over the grid; of each gait the response to commands
    # and a figure of eight.
    figures: Figures = None

    def prepare(self, name: str) -> "tuple[Scenario, list[Course]]":
        """Returns what to simulate for a robot."""
        from loco_drake.control.actor_file import load_actor
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
            robot=get_robot(name).definition,
            reference=GeneratedReference(gait=label, duration=60.0),
            steering=SteeringConfig(measured_ranges=False),
            policy=TrainedPolicy(weights=policy_path(get_robot(name), self.policy)),
        )

    def evaluate(
        self, name: str, scenario: "Scenario", courses: "list[Course]"
    ) -> dict[str, Any]:
        """Returns the figures of one robot."""
        if self.compare:
            return self._compared(name, scenario, courses)
        from loco_drake.evaluation.steering_overall import overall
        from loco_drake.evaluation.steering_table import run_courses

        results = run_courses(scenario, courses, self.executor)
        labels = dict(tracked(results, f"Driving {name}", len(courses)))
        return {"robot": name, "labels": labels, "all": overall(labels)}

    def show(self, name: str, figures: dict[str, Any]) -> int:
        """Prints tables of all labels; returns 0."""
        if self.compare:
            for label, of_label in figures["labels"].items():
                print_table(f"{name}, {label}", *ways_table(of_label))
            return 0
        rows = {**figures["labels"], "all of these": figures["all"]}
        print_by_label(f"{name}, steered", ["steering"], rows)
        title = f"{name}, ranges of the commands"
        print_by_label(title, ["steering_range"], figures["labels"])
        return 0

    def _compared(
        self, name: str, scenario: "Scenario", courses: "list[Course]"
    ) -> dict[str, Any]:
        """Returns the figures of each way of steering, by label."""
        from loco_drake.evaluation.naturalness import naturalness
        from loco_drake.evaluation.samples import by_label, cut
        from loco_drake.evaluation.steering_ways import compare_ways
        from loco_drake.generation.motion_model import pretrained_motion_model
        from loco_drake.models.robots import get_robot

        for course in courses:
            if course.range is None:
                raise InputError(
                    f"There is no published range of {course.label} to compare in."
                )
        model = pretrained_motion_model(name)
        model.check_told()
        recorded = self.retarget(get_robot(name), model.grounded)
        stretches = by_label(cut((*recorded.train, *recorded.validation)))
        ways = compare_ways(scenario, courses, self.executor)
        labels = {}
        for label, figures in tracked(ways, f"Driving {name}", len(courses)):
            found, natural = stretches.get(label), None
            if found is not None:
                # From all recordings.
                tasks = found[:: -(-len(found) // _TASKS)]
                natural = naturalness(model, tasks, self.seeds, self.seed)
            labels[label] = {**figures, "naturalness": natural}
        return {"robot": name, "compare": True, "labels": labels}

    def draw(self, name: str, figures: dict[str, Any]) -> None:
        """Writes the pictures of a robot, if they are wanted."""
        from loco_drake.evaluation.steering_pictures import steering_figures

        if self.figures is None or self.compare:
            return
        say_of(name)("Drawing")
        scenario = self._scenario(name, next(iter(figures["labels"])))
        for title, picture in steering_figures(scenario, figures, self.seed):
            write_figure(picture, self.figures / f"{name}-{title}.png")
