"""The command ``evaluate generation``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from loco_drake.cli.evaluation import (
    Evaluation,
    estimate_text,
    say_of,
    trained_on,
    write_figure,
)
from loco_drake.cli.output import print_failed, print_figures, print_table
from loco_drake.evaluation.effort import Effort
from loco_drake.motion.gaits import LABELS, SOURCES

_FIGURES = (
    "fid",
    "fid_real_real",
    "nearest_training_rad",
    "nearest_training_rad_validation",
    "drift_60s",
    "transfer_joint_rmse_rad",
    "real_time_factor",
)
_ESTIMATE = ("mean", "low", "high")
_ROWS = {
    "recorded -> recorded": "real_to_real",
    "recorded -> generated (quality)": "real_to_generated",
    "generated -> recorded (diversity)": "generated_to_real",
    "... of as many trajectories": "generated_to_real_matched",
}
# Column: key, factor, digits.
_COLUMNS = {
    "slip mm/s": ("stance_slip_median_mps", 1000, 1),
    "sunk mm": ("penetration_max_m", 1000, 2),
    "jerk ratio": ("jerk_ratio", 1, 2),
    "speed error m/s": ("speed_error_mps", 1, 3),
}


@dataclass(kw_only=True)
class EvaluateGeneration(Effort, Evaluation):
    """Compare generated motion with recorded motion.

    Measures gait recognition (Table 1 of the paper), two-sample accuracy, novelty,
    slip, penetration, jerk, speed and drift, as defined in docs/generation.md.
    """

    KEYS = ("classifiers", "two_sample_accuracy", *_FIGURES, "labels", "all")

    motions: Path | None = None
    """Score the Motion files in this folder instead of generating motion."""
    tokenizer: Path | None = None
    """Weights from `train tokenizer`. Default: the shipped weights."""
    generator: Path | None = None
    """Weights from `train generator`. Default: the shipped weights."""
    figures: Path | None = None
    """Folder for plots."""
    seed: int = 0
    """Seed of the first motion and the first classifier; it increases by 1 for each
    further one."""

    def check(self) -> None:
        """Raises InputError if an option is wrong."""
        from loco_drake.datasets.registry import data_dir

        super().check()
        self._folder = data_dir(self.data_dir)

    def of_robot(self, name: str) -> dict[str, Any]:
        """Returns the figures of one robot."""
        from loco_drake.evaluation.generation_pictures import generation_figures
        from loco_drake.evaluation.model_figures import score_model, score_motions
        from loco_drake.evaluation.recorded import load_to_score, retarget_recordings
        from loco_drake.generation.motion_model import load_motion_model
        from loco_drake.models.robots import get_robot
        from loco_drake.models.shipped import pretrained_path

        robot, say = get_robot(name), say_of(name)
        paths = {
            "tokenizer": self.tokenizer or pretrained_path("tokenizer"),
            "generator": self.generator or pretrained_path("generator"),
        }
        if self.motions:
            motions = load_to_score(self.motions, robot, self.labels)
        else:
            model = load_motion_model(paths["tokenizer"], paths["generator"], name)
        say("Retargeting the recordings")
        recorded = retarget_recordings(self._folder, robot, self.labels, self.workers)
        print_failed(recorded.failed.items())
        if self.motions:
            score, generated = score_motions(
                robot, motions, recorded, self, self.seed, say
            )
        else:
            others = [n for n in model.tokenizer.config.robots if n != name]
            other = None
            if others:
                say(f"Retargeting the recordings to {others[0]}, too")
                other = retarget_recordings(
                    self._folder, get_robot(others[0]), self.labels, self.workers
                )
            labels = self.labels or tuple(map(str, LABELS))
            score, generated = score_model(
                model, labels, recorded, other, self, self.seed, say
            )
            seen = trained_on(paths, recorded, name)
            score.figures["validation_trained_on"] = seen
        if self.figures is not None:
            pictures = generation_figures(
                robot, recorded, generated.sets[0], score.recognition
            )
            for title, picture in pictures.items():
                write_figure(picture, self.figures / f"{name}-{title}.png")
        return score.figures

    def show(self, name: str, figures: dict[str, Any]) -> None:
        """Prints accuracies, figures by label, and all else."""
        if figures["classifiers"] is None:
            print_failed([(name, str(figures["reason"]))])
            return
        for kind, rows in figures["classifiers"].items():
            columns = [k for k in ("all", *SOURCES) if k in rows["real_to_real"]]
            print_table(
                f"{name}: accuracy of a {kind} classifier",
                ["trained on -> tested on", *columns],
                [
                    [text, *(estimate_text(rows[key][column]) for column in columns)]
                    for text, key in _ROWS.items()
                ],
            )
        labels = {**figures["labels"], "all": figures["all"]}
        print_figures(f"{name}: motion", "label", _COLUMNS, labels)
        nothing = dict.fromkeys(_ESTIMATE)
        rows = {"real or generated, linear": figures["two_sample_accuracy"] or {}}
        rows |= {key.replace("_", " "): {"mean": figures[key]} for key in _FIGURES}
        print_figures(
            f"{name}: all labels",
            "figure",
            {key: (key, 1, 4) for key in _ESTIMATE},
            {key: {**nothing, **row} for key, row in rows.items()},
        )
