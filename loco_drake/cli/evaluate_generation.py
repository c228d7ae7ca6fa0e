"""The command ``evaluate generation``."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from loco_drake.cli.evaluation import (
    estimate_text,
    of_robots,
    robot_names,
    write_figure,
)
from loco_drake.cli.output import (
    print_failed,
    print_figures,
    print_table,
    write_json,
)
from loco_drake.cli.trained_on import trained_on
from loco_drake.common.errors import InputError, check_at_least, check_choice
from loco_drake.datasets.registry import data_dir
from loco_drake.evaluation.generation import Generated, GenerationScore
from loco_drake.evaluation.generation_pictures import confusion_figure, motion_figure
from loco_drake.evaluation.model_figures import Effort, score_model, score_motions
from loco_drake.evaluation.recorded import Recorded, retarget_recordings
from loco_drake.evaluation.train_classifier import STEPS
from loco_drake.generation.motion_model import MotionModel, load_motion_model
from loco_drake.models.robots import ROBOTS, Robot, get_robot
from loco_drake.models.shipped import pretrained_path
from loco_drake.motion.gaits import LABELS, SOURCES, parse_label
from loco_drake.motion.motion import FPS, Motion
from loco_drake.motion.motion_file import load_motion


@dataclass(kw_only=True)
class EvaluateGeneration:
    """Compares generated motion with recorded motion.

    Can gaits be told apart (Table 1 of the paper), can generated be told from recorded
    motion, is it new, do feet slip or sink, is it as smooth and as fast, does it drift?
    docs/generation.md defines each figure.
    """

    robot: str = "go2"
    """The robot: go2, a1 or all."""
    labels: tuple[str, ...] = ()
    """Such as dog-trot dog-pace. Default: the fifteen, as far as there are recordings
    of them."""
    data_dir: Path | None = None
    """Folder of the recordings. Default: $LOCO_DRAKE_DATA, else the user's cache."""
    motions: Path | None = None
    """Scores the Motion files in this folder instead of generating."""
    tokenizer: Path | None = None
    """Weights from `train tokenizer`. Default: those that come with the package."""
    generator: Path | None = None
    """Weights from `train generator`. Default: those that come with the package."""
    count: int = 24
    """Generated trajectories of each label in a set, of 2 s."""
    generator_seeds: int = 3
    """Sets of generated trajectories."""
    minutes: int = 16
    """Motions of 60 s of each label to look for drift in; 0: none."""
    seeds: int = 5
    """Classifiers that are trained for each figure."""
    steps: int = STEPS
    """Optimizer steps of the transformer."""
    workers: int = 1
    """Processes that retarget the recordings."""
    figures: Path | None = None
    """Writes pictures to this folder."""
    seed: int = 0
    """Of the first motion and the first classifier; each further one has the next."""
    json: Path | None = None
    """Writes the figures to this file."""

    def run(self) -> int:
        """Prints tables for each robot, writes figures and pictures; returns 0.

        Raises:
            InputError: if an option is wrong, or there is nothing to compare.
        """
        check_choice("robot", self.robot, (*ROBOTS, "all"))
        for name, least in (
            ("count", 1),
            ("generator_seeds", 1),
            ("minutes", 0),
            ("seeds", 1),
            ("steps", 1),
            ("workers", 1),
            ("seed", 0),
        ):
            check_at_least(name, getattr(self, name), least)
        for label in self.labels:
            parse_label(label)
        folder = data_dir(self.data_dir)
        result = of_robots(self.robot, lambda name: self._robot(folder, name), KEYS)
        write_json(self.json, result)
        for name, figures in robot_names(result):
            _print(name, figures)
        return 0

    def _robot(self, folder: Path, name: str) -> dict[str, Any]:
        """Returns the figures of one robot."""
        robot = get_robot(name)
        model = None if self.motions else self._model(name)
        motions = self._load(robot) if self.motions else []
        say = _say(name)
        say("Retargeting the recordings")
        recorded = retarget_recordings(folder, robot, self.labels, self.workers)
        print_failed(recorded.failed.items())
        effort = Effort(
            count=self.count,
            sets=self.generator_seeds,
            minutes=self.minutes,
            seeds=tuple(range(self.seed, self.seed + self.seeds)),
            steps=self.steps,
            seed=self.seed,
        )
        if model is None:
            score, generated = score_motions(robot, motions, recorded, effort, say)
        else:
            names = self.labels or tuple(map(str, LABELS))
            other = self._other(folder, model, say)
            score, generated = score_model(model, names, recorded, other, effort, say)
            paths = {"tokenizer": self._tokenizer(), "generator": self._generator()}
            seen = trained_on(paths, recorded, name)
            score.figures["validation_trained_on"] = seen
        if self.figures is not None:
            self._draw(robot, recorded, generated, score)
        return score.figures

    def _model(self, name: str) -> MotionModel:
        return load_motion_model(self._tokenizer(), self._generator(), name)

    def _tokenizer(self) -> Path:
        return self.tokenizer or pretrained_path("tokenizer")

    def _generator(self) -> Path:
        return self.generator or pretrained_path("generator")

    def _other(
        self, folder: Path, model: MotionModel, say: Callable[[str], None]
    ) -> Recorded | None:
        """Returns the recordings of another robot that the tokenizer knows."""
        others = [n for n in model.tokenizer.config.robots if n != model.robot.name]
        if not others:
            return None
        say(f"Retargeting the recordings to {others[0]}, too")
        return retarget_recordings(
            folder, get_robot(others[0]), self.labels, self.workers
        )

    def _load(self, robot: Robot) -> list[Motion]:
        """Returns the robot's motions in the folder."""
        paths = sorted(self.motions.rglob("*.npz")) if self.motions else []
        loaded = [load_motion(path) for path in paths]
        motions = [
            motion
            for motion in loaded
            if motion.robot == robot.name
            and (not self.labels or str(motion.label) in self.labels)
        ]
        if not motions:
            raise InputError(
                f"There are no Motion files (*.npz) of {robot.name} to score in "
                f"{str(self.motions)!r}."
            )
        for motion in motions:
            if motion.fps != FPS:
                raise InputError(
                    f"Motions to score must be at {FPS:g} frames/s, one of "
                    f"{motion.label} is at {motion.fps:g}."
                )
        return motions

    def _draw(
        self,
        robot: Robot,
        recorded: Recorded,
        generated: Generated,
        score: GenerationScore,
    ) -> None:
        assert self.figures is not None
        for kind, recognition in score.recognition.items():
            path = self.figures / f"{robot.name}-confusion-{kind}.png"
            write_figure(confusion_figure(recognition, f"{robot.name}, {kind}"), path)
        real = (*recorded.validation, *recorded.train)
        picture = motion_figure(robot, real, generated.sets[0])
        write_figure(picture, self.figures / f"{robot.name}-motion.png")


def _say(robot: str) -> Callable[[str], None]:
    console = Console(stderr=True, highlight=False)
    return lambda text: console.print(f"{robot}: {text}", markup=False)


_ROWS = {
    "recorded -> recorded": "real_to_real",
    "recorded -> generated (quality)": "real_to_generated",
    "generated -> recorded (diversity)": "generated_to_real",
    "... of as many trajectories": "generated_to_real_matched",
}
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
KEYS = (
    "classifiers",
    "two_sample_accuracy",
    *_FIGURES,
    "labels",
    "all",
)
# Column: key, factor, digits.
_COLUMNS = {
    "slip mm/s": ("stance_slip_median_mps", 1000, 1),
    "sunk mm": ("penetration_max_m", 1000, 2),
    "jerk ratio": ("jerk_ratio", 1, 2),
    "speed error m/s": ("speed_error_mps", 1, 3),
}


def _print(name: str, result: dict[str, Any]) -> None:
    if result["classifiers"] is None:
        print_failed([(name, str(result["reason"]))])
        return
    for kind, rows in result["classifiers"].items():
        columns = [k for k in ("all", *SOURCES) if k in rows["real_to_real"]]
        print_table(
            f"{name}: accuracy of a {kind} classifier",
            ["trained on -> tested on", *columns],
            [
                [text, *(estimate_text(rows[key][column]) for column in columns)]
                for text, key in _ROWS.items()
            ],
        )
    labels = {**result["labels"], "all": result["all"]}
    print_figures(f"{name}: motion", "label", _COLUMNS, labels)
    nothing = dict.fromkeys(_ESTIMATE)
    figures = {key.replace("_", " "): {"mean": result[key]} for key in _FIGURES}
    two_sample = {"real or generated, linear": result["two_sample_accuracy"] or {}}
    print_figures(
        f"{name}: all labels",
        "figure",
        {key: (key, 1, 4) for key in _ESTIMATE},
        {key: {**nothing, **row} for key, row in (two_sample | figures).items()},
    )
