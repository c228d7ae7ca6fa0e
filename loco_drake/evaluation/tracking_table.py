"""How well a policy tracks many references, label by label.

An episode's figures are those of :mod:`loco_drake.evaluation.tracking`. Its world is
that of the model, or is drawn for its label and seed from a
:class:`loco_drake.tracking.randomization.RandomizationConfig`. A label's figures are
made of its episodes':

* normalized_return: mean; the worst episode's beside it
* fall_rate: share of episodes
* joint_rmse_rad, base_position_rmse_m, base_orientation_rmse_rad: root of the mean
  square over all samples of all episodes
* stance_slip_median_mps: median over all steps of all toes in stance of all episodes
* stretch, speed_mps, torque_saturation, speed_saturation, cost_of_transport: mean
* real_time_factor: simulated over wall seconds inside AdvanceTo, warm
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.control.plan import PLAN_DT, Plan, plan_from_motion
from loco_drake.datasets.segments import Segment, select_labels
from loco_drake.engine.executor import Executor
from loco_drake.engine.local import LOCAL
from loco_drake.evaluation.motion_scores import median
from loco_drake.evaluation.mujoco import MujocoRecorder
from loco_drake.evaluation.tracking import (
    Recorder,
    effort_metrics,
    slip_speeds,
    tracking_metrics,
)
from loco_drake.models.mujoco_plant import MujocoConfig
from loco_drake.models.plant import plant_damping
from loco_drake.models.robots import Robot, SimulatedRobot, get_simulated
from loco_drake.motion.gaits import any_label
from loco_drake.motion.motion_file import load_motion
from loco_drake.retargeting.retarget import SegmentRetargeter
from loco_drake.retargeting.scaling import Variant
from loco_drake.systems.scenario import PlanReference, Scenario
from loco_drake.tracking.randomization import RandomizationConfig
from loco_drake.tracking.references import check_robot, read_motions

_POOLED = ("joint_rmse_rad", "base_position_rmse_m", "base_orientation_rmse_rad")
_MEANS = (
    "stretch",
    "speed_mps",
    "torque_saturation",
    "speed_saturation",
    "cost_of_transport",
)


@dataclass(frozen=True)
class Trial:
    """One episode to simulate."""

    label: str  # the gait
    seed: int  # of the generator; or which of the segments it is
    duration: float  # s; of a recorded reference at most its length
    # The recording to follow; None to follow the generator.
    segment: Segment | None = None
    ground: bool = False  # whether that recording's motion is made to obey physics
    # Or the Motion file to follow, from this sample on.
    motion: Path | None = None
    start: int = 0

    @property
    def generated(self) -> bool:
        """Whether it follows the generator."""
        return self.segment is None and self.motion is None


@dataclass(frozen=True)
class Episode:
    """The result of a trial."""

    trial: Trial
    figures: dict[str, float]  # of the episode, by name
    slip: Array  # speeds of the toes in stance, m/s, shape (M,)
    samples: int  # how many were simulated
    fell: bool  # whether the robot did
    wall: float  # seconds spent inside AdvanceTo


class _Runner:
    """Simulates one trial after the other in one diagram."""

    def __init__(
        self,
        scenario: Scenario,
        randomization: RandomizationConfig,
        mujoco: MujocoConfig | None,
    ) -> None:
        self._robot = get_simulated(scenario.robot)
        self._randomization = randomization
        self._recorder: Recorder | MujocoRecorder
        if mujoco is None:
            self._damping = plant_damping(self._robot, scenario.plant)
            self._recorder = Recorder(scenario)
        else:
            self._damping = self._robot.kd
            self._recorder = MujocoRecorder(scenario, mujoco)
        self._retargeters = {}
        if isinstance(self._robot, Robot):
            self._retargeters = {
                ground: SegmentRetargeter(self._robot, variant=Variant(ground=ground))
                for ground in (False, True)
            }
        # The first step sets up torch.
        self._recorder.start()
        self._recorder.run(PLAN_DT)

    def __call__(self, trial: Trial) -> Episode:
        duration = trial.duration
        random = np.random.default_rng((trial.seed, any_label(trial.label).index))
        episode: dict[str, Any] = {}
        if not self._randomization.is_off:
            domain = self._randomization.draw(self._robot, random, 0.0, duration)
            episode["domain"] = domain
        if trial.generated:
            self._recorder.start(gait=trial.label, seed=trial.seed, **episode)
        else:
            plan = self._plan(trial)
            duration = min(duration, plan.end_time)
            self._recorder.start(plan=plan, **episode)
        rollout, wall = self._recorder.run(duration)
        return Episode(
            trial=trial,
            figures=tracking_metrics(rollout)
            | effort_metrics(rollout, self._robot, self._damping),
            slip=slip_speeds(rollout, self._robot),
            samples=len(rollout.state),
            fell=rollout.fell,
            wall=wall,
        )

    def _plan(self, trial: Trial) -> Plan:
        if trial.motion is not None:
            motion = load_motion(trial.motion)
            return plan_from_motion(self._robot, motion.slice(trial.start, len(motion)))
        segment = trial.segment
        assert segment is not None
        result = self._retargeters[trial.ground](segment)
        if isinstance(result, str):
            raise InputError(f"{segment.name} cannot be retargeted: {result}")
        return plan_from_motion(self._robot, result[1])


def generated_trials(
    labels: Iterable[str], seeds: Iterable[int], duration: float
) -> list[Trial]:
    """Returns a trial for each label and seed."""
    seeds = list(seeds)
    return [Trial(label, seed, duration) for label in labels for seed in seeds]


def retargeted_trials(
    segments: Sequence[Segment],
    labels: Iterable[str],
    count: int,
    duration: float,
    ground: bool = False,
) -> list[Trial]:
    """Returns up to ``count`` trials of each label, evenly spread over its segments.

    Their motion is grounded if ``ground``.

    Raises:
        InputError: if a label has no segment.
    """
    trials = []
    for label in labels:
        own = select_labels(segments, [label])
        chosen = np.unique(np.linspace(0, len(own) - 1, count).round().astype(int))
        trials += [Trial(label, int(k), duration, own[k], ground) for k in chosen]
    return trials


def motion_trials(
    robot: SimulatedRobot, folder: Path, count: int, duration: float
) -> list[Trial]:
    """Returns ``count`` trials of each Motion file in a folder, or of one file.

    They start at places of the motion that are evenly spread and leave ``duration`` s,
    where it is that long; otherwise, up to its middle.

    Raises:
        InputError: as :func:`.references.read_motions`, or if the file is of another
            robot.
    """
    if folder.is_file():
        motions = {folder: load_motion(folder)}
        check_robot(robot, motions)
    else:
        motions = read_motions(robot, folder)
    trials = []
    for path, motion in motions.items():
        last = len(motion) - 1 - round(duration / PLAN_DT)
        last = last if last >= 0 else (len(motion) - 1) // 2
        starts = np.linspace(0, last, count + 1)[:count].round().astype(int)
        same = Trial(
            str(motion.label), 0, duration, ground=motion.grounded, motion=path
        )
        trials += [
            replace(same, seed=seed, start=int(start))
            for seed, start in enumerate(starts)
        ]
    return trials


def run_trials(
    scenario: Scenario,
    trials: Sequence[Trial],
    executor: Executor = LOCAL,
    randomization: RandomizationConfig | None = None,
    mujoco: MujocoConfig | None = None,
) -> Iterator[Episode]:
    """Simulates trials and yields their results in order.

    Args:
        scenario: scenario with a generated reference, or a PlanReference if the trials
            have segments or motions.
        trials: trials, all of one kind.
        executor: simulates the trials.
        randomization: distribution of each trial's world, by its label and seed.
        mujoco: simulates in MuJoCo, where nothing is randomized, instead of Drake.
    """
    randomization = randomization or RandomizationConfig()
    randomization.check(get_simulated(scenario.robot), scenario.plant)
    scenario = replace(scenario, disturbances=randomization.disturbances)
    recorded = isinstance(scenario.reference, PlanReference)
    if any(trial.generated == recorded for trial in trials):
        raise ValueError("the trials are not of the scenario's kind of reference")
    if mujoco is not None and not randomization.is_off:
        raise ValueError("worlds are randomized in Drake only")
    make = partial(_Runner, scenario, randomization, mujoco)
    return executor.map(make, trials)


def summarize(episodes: Sequence[Episode]) -> dict[str, Any]:
    """Returns ``{"labels": {LABEL: figures}, "all": figures, "real_time_factor"}``."""
    by_label: dict[str, list[Episode]] = {}
    for episode in episodes:
        by_label.setdefault(episode.trial.label, []).append(episode)
    simulated = sum((episode.samples - 1) * PLAN_DT for episode in episodes)
    return {
        "labels": {label: figures(own) for label, own in by_label.items()},
        "all": figures(episodes),
        "real_time_factor": simulated / sum(episode.wall for episode in episodes),
    }


def figures(episodes: Sequence[Episode]) -> dict[str, Any]:
    """Returns the aggregated figures of at least one episode."""

    def values(name: str) -> Array:
        return np.array([episode.figures[name] for episode in episodes])

    samples = np.array([episode.samples for episode in episodes])
    slip = np.concatenate([episode.slip for episode in episodes])
    result: dict[str, Any] = {
        "normalized_return": float(values("normalized_return").mean()),
        "normalized_return_worst": float(values("normalized_return").min()),
        "fall_rate": float(np.mean([episode.fell for episode in episodes])),
    }
    for name in _POOLED:
        squares = values(name) ** 2
        result[name] = float(np.sqrt(squares @ samples / samples.sum()))
    result["stance_slip_median_mps"] = median(slip)
    for name in _MEANS:
        result[name] = float(values(name).mean())
    result["episodes"] = len(episodes)
    if not len(slip):
        result["reason"] = "no toe ever stands"
    return result
