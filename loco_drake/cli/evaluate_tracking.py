"""The command ``evaluate tracking``."""

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from loco_drake.cli.evaluation import SimulatedEvaluation, print_by_label
from loco_drake.cli.options import Policy, TrainedLabels, option
from loco_drake.cli.output import tracked
from loco_drake.common.errors import InputError, check_choice, quoted
from loco_drake.motion.gaits import any_label, parse_label
from loco_drake.tracking.randomization import RandomizationConfig

if TYPE_CHECKING:
    from loco_drake.evaluation.tracking_table import Trial
    from loco_drake.models.mujoco_plant import MujocoConfig
    from loco_drake.models.plant import PlantConfig
    from loco_drake.systems.scenario import Scenario

_REFERENCES = ("generated", "retargeted", "grounded")


@dataclass(kw_only=True)
class EvaluateTracking(SimulatedEvaluation):
    """Simulate many episodes and measure how well a policy tracks its references."""

    labels: TrainedLabels = ()
    # What is tracked: generated, during the simulation; retargeted, from stretches of
    # the recordings; or grounded, from these made to obey physics; or a Motion file, or
    # a folder of them, which is all that the humanoid g1 can follow.
    reference: Annotated[str, option(metavar="NAME|FILE|DIR")] = "generated"
    # Number of seeds, counted up from --seed: each gives an episode of each label; of
    # recordings, there are at most as many as they are; of Motion files, as many
    # episodes each, which start at different places.
    seeds: int = 20
    # Duration in s: of each episode, at most that of a recording.
    duration: float = 10.0
    policy: Policy = None
    # Simulator: drake, or mujoco, which needs the extra 'mujoco'; see docs/mujoco.md.
    simulator: Annotated[str, option(metavar="NAME")] = "drake"
    # With --simulator mujoco: MJCF file of another model of the robot.
    mjcf: Annotated[Path | None, option(name="mujoco-model", metavar="FILE")] = None
    # Contact solver: similar, lagged, sap or cenic. They are Drake's.
    contact: Annotated[str, option(metavar="NAME")] = "similar"
    time_step: Annotated[
        float | None,
        option("Time step of the physics, s.", default="0.01; with mujoco 0.002"),
    ] = None
    # Accuracy of the integrator of cenic.
    accuracy: float = 1e-4
    # Coulomb friction coefficient of the ground.
    friction: float = 0.8
    # Push the trunk repeatedly in random directions.
    pushes: bool = False
    # Change of the robot's velocity by one push, m/s: with --pushes. The force lasts a
    # tenth of a second.
    push_size: float = 1.0
    # Time from the start to the first push and between pushes, s: with --pushes.
    push_interval: float = 2.0
    # Randomize the world of each episode: as `train tracker --randomize` does.
    randomize: bool = False
    # Ranges of single parts; a range is two numbers.
    randomization: RandomizationConfig = field(default_factory=RandomizationConfig)
    # Seed: of the first generated reference of each label.
    seed: int = 0

    def check(self) -> None:
        """Raises InputError if an option is wrong."""
        from loco_drake.generation.generate import check_duration

        super().check()
        if self.reference not in _REFERENCES and not self._of_files:
            raise InputError(
                f"Unknown reference {quoted(self.reference)}; the choices are "
                f"{', '.join(_REFERENCES)}, a Motion file or a folder of them."
            )
        if self._of_files and self.labels:
            raise InputError("--labels are not of Motion files, which have their own.")
        check_choice("simulator", self.simulator, ("drake", "mujoco"))
        check_duration(self.duration)
        if self.pushes:
            self.randomization = replace(
                self.randomization,
                push=(self.push_size, self.push_size),
                push_interval=(self.push_interval, self.push_interval),
            )
        if self.randomize:
            self.randomization = self.randomization.with_standard()
        self.randomization.check()
        if self.simulator == "mujoco":
            self._mujoco().check()
        elif self.mjcf is not None:
            raise InputError("--mujoco-model is for MuJoCo: add --simulator mujoco.")

    @property
    def _of_files(self) -> bool:
        """Whether Motion files are tracked."""
        return self.reference not in _REFERENCES and Path(self.reference).exists()

    def robots(self) -> list[str]:
        """Returns the names of the robots; raises InputError if they are unknown."""
        from loco_drake.models.biped_file import is_biped_file

        if not is_biped_file(self.robot):
            return super().robots()
        if not self._of_files or self.simulator != "drake":
            raise InputError(
                "A humanoid tracks Motion files in Drake: name them with --reference."
            )
        return [self.robot]

    def _mujoco(self) -> "MujocoConfig":
        """Returns the configuration of MuJoCo."""
        from loco_drake.models.mujoco_plant import MujocoConfig

        if self.contact != "similar" or not self.randomization.is_off:
            raise InputError(
                "--contact, --pushes and --randomize change Drake's world, and cannot "
                "be used with --simulator mujoco."
            )
        config = MujocoConfig(friction=self.friction, mjcf=self.mjcf)
        if self.time_step is not None:
            config.time_step = self.time_step
        return config

    def _plant(self) -> "PlantConfig":
        """Returns the configuration of Drake's plant."""
        from loco_drake.models.plant import PlantConfig

        config = PlantConfig(
            contact=self.contact, accuracy=self.accuracy, friction=self.friction
        )
        if self.time_step is not None and self.simulator == "drake":
            config.time_step = self.time_step
        return config

    def prepare(self, name: str) -> "tuple[Scenario, list[Trial]]":
        """Returns what to simulate for a robot."""
        from loco_drake.control.actor_file import load_actor
        from loco_drake.control.retiming import fall_limit
        from loco_drake.datasets.registry import data_dir
        from loco_drake.datasets.segments import read_segments
        from loco_drake.evaluation import tracking_table
        from loco_drake.models.plant import plant_damping
        from loco_drake.models.robots import get_simulated
        from loco_drake.models.shipped import policy_path
        from loco_drake.systems import scenario as systems

        robot = get_simulated(name)
        weights = policy_path(robot, self.policy)
        trained = load_actor(weights, robot).config.labels
        parse = parse_label if self.reference == "generated" else any_label
        labels = [str(parse(label)) for label in self.labels or trained]
        plant = self._plant()
        plant.check()
        plant_damping(robot, plant)
        policy = systems.TrainedPolicy(weights=weights)
        scenario = systems.Scenario(robot=robot.definition, plant=plant, policy=policy)
        if self._of_files:
            scenario.reference = systems.PlanReference()
            trials = tracking_table.motion_trials(
                robot, Path(self.reference), self.seeds, self.duration
            )
            grounded = fall_limit(all(trial.ground for trial in trials))
            scenario.smoother = systems.SmootherConfig(fall=grounded)
            return scenario, trials
        if self.reference != "generated":
            ground = self.reference == "grounded"
            scenario.reference = systems.PlanReference()
            scenario.smoother = systems.SmootherConfig(fall=fall_limit(ground))
            segments = read_segments(data_dir(self.data_dir))
            return scenario, tracking_table.retargeted_trials(
                segments, labels, self.seeds, self.duration, ground
            )
        scenario.reference = systems.GeneratedReference(
            gait=labels[0], duration=self.duration
        )
        seeds = range(self.seed, self.seed + self.seeds)
        return scenario, tracking_table.generated_trials(labels, seeds, self.duration)

    def evaluate(
        self, name: str, scenario: "Scenario", trials: "list[Trial]"
    ) -> dict[str, Any]:
        """Returns the figures of one robot."""
        from loco_drake.control.plan import PLAN_DT
        from loco_drake.evaluation.tracking_table import run_trials, summarize

        mujoco = self._mujoco() if self.simulator == "mujoco" else None
        simulated = run_trials(
            scenario, trials, self.executor, self.randomization, mujoco
        )
        episodes = list(tracked(simulated, f"Simulating {name}", len(trials)))
        survived = [(episode.samples - 1) * PLAN_DT for episode in episodes]
        return {
            "robot": name,
            "reference": self.reference,
            "simulator": self.simulator,
            "mjcf": self.mjcf and self.mjcf.name,
            "contact": self.contact if mujoco is None else "elliptic",
            "time_step_s": (mujoco or scenario.plant).time_step,
            "friction": self.friction,
            "duration_s": self.duration,
            "randomization": asdict(self.randomization),
            **summarize(episodes),
            **({"survived_s": survived} if self._of_files else {}),
        }

    def show(self, name: str, figures: dict[str, Any]) -> int:
        """Prints a table of all labels; returns 0."""
        world = "" if self.randomization.is_off else ", randomized"
        title = (
            f"{name}, {self.reference}, {figures['simulator']}, {figures['contact']}"
            f"{world}: "
            f"{figures['real_time_factor']:.1f} times real time"
        )
        rows = {**figures["labels"], "all of these": figures["all"]}
        print_by_label(title, ["tracking", "tracking_more"], rows)
        return 0
