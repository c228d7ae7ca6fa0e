"""The command ``evaluate generation``."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from loco_drake.cli.evaluation import Evaluation, print_report, say_of, trained_on
from loco_drake.cli.options import Figures, Generator, Tokenizer, option
from loco_drake.cli.output import print_failed, write_figure
from loco_drake.evaluation.effort import Effort
from loco_drake.motion.gaits import LABELS

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(kw_only=True)
class EvaluateGeneration(Effort, Evaluation):
    """Compare generated motion with recorded motion.

    Measures gait recognition (Table 1 of the paper), two-sample accuracy, novelty,
    slip, penetration, jerk, speed and drift, as defined in docs/generation_method.md.
    """

    KEYS = (
        "classifiers",
        "two_sample_accuracy",
        "fid",
        "fid_real_real",
        "nearest_training_rad",
        "nearest_training_rad_validation",
        "drift_60s",
        "transfer_joint_rmse_rad",
        "real_time_factor",
        "labels",
        "all",
    )

    # Folder of Motion files: scored instead of generating motion.
    motions: Annotated[Path | None, option(metavar="DIR")] = None
    tokenizer: Tokenizer = None
    generator: Generator = None
    # Folder for pictures: all plots.
    figures: Figures = None
    # Seed: of the first motion and the first classifier, and 1 more for each further
    # one.
    seed: int = 0

    def check(self) -> None:
        """Raises InputError if an option is wrong."""
        Effort.check(self)
        Evaluation.check(self)
        self._pictures: dict[str, dict[str, Figure]] = {}

    def of_robot(self, name: str) -> dict[str, Any]:
        """Returns the figures of one robot."""
        from loco_drake.evaluation import model_figures
        from loco_drake.evaluation.generation import score_generation
        from loco_drake.evaluation.generation_pictures import generation_figures
        from loco_drake.evaluation.recorded import load_to_score
        from loco_drake.generation.motion_model import load_motion_model
        from loco_drake.models.robots import get_robot
        from loco_drake.models.shipped import network_path

        robot, say = get_robot(name), say_of(name)
        paths = {
            "tokenizer": self.tokenizer or network_path(robot, "tokenizer"),
            "generator": self.generator or network_path(robot, "generator"),
        }
        labels = self.labels or tuple(map(str, LABELS))
        model = other = None
        if self.motions is not None:
            motions = load_to_score(self.motions, robot, self.labels)
            generated = model_figures.cut_for_scoring(motions)
            motions_grounded = all(motion.grounded for motion in motions)
            if beyond := {str(m.label) for m in motions if m.label not in LABELS}:
                say(
                    f"Motions of {', '.join(sorted(beyond))} are left out of all "
                    "comparisons, which are of the fifteen labels."
                )
        else:
            model = load_motion_model(paths["tokenizer"], paths["generator"], name)
            known = model_figures.known_labels(model, labels)
        ground = motions_grounded if model is None else model.grounded
        recorded = self.retarget(robot, ground)
        if model is not None:
            others = [n for n in model.tokenizer.config.first[::-1] if n != name]
            other = self.retarget(get_robot(others[0]), ground) if others else None
            say(f"Generating {', '.join(map(str, known))}")
            generated = model_figures.generate_for_scoring(
                model, known, self, self.seed
            )
        figures, recognition = score_generation(
            robot, recorded, generated, self, self.seed, say
        )
        model_figures.add_model_figures(figures, model, labels, recorded, other)
        if model is not None:
            figures["validation_trained_on"] = trained_on(paths, recorded, name)
        if self.figures is not None:
            self._pictures[name] = generation_figures(
                robot, recorded, generated.sets[0], recognition
            )
        return figures

    def draw(self, name: str, figures: dict[str, Any]) -> None:
        """Writes the pictures of a robot, if they are wanted."""
        if self.figures is not None:
            for title, picture in self._pictures.get(name, {}).items():
                write_figure(picture, self.figures / f"{name}-{title}.png")

    def show(self, name: str, figures: dict[str, Any]) -> int:
        """Prints accuracies, figures by label, and all else; returns 0."""
        from loco_drake.evaluation.report import sections, tables
        from loco_drake.evaluation.report.figures import Figures

        if figures["classifiers"] is None:
            print_failed([(name, str(figures["reason"]))])
            return 0
        found = Figures(figures)
        robots = {name: found}
        for table in (
            *tables.recognition_tables(robots).values(),
            sections.generation_table(name, found),
            sections.realism_table(robots),
        ):
            print_report(table)
        return 0
