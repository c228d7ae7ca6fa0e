"""Which results a report is made of, and the command that writes each."""

from dataclasses import dataclass

from loco_drake.models.robots import ROBOTS


@dataclass(frozen=True)
class ResultFile:
    """A file of results.

    Attributes:
        name: without robot and suffix.
        robots: whose figures it is to hold; its own, or all of them.
        command: writes it, but for ``--json``.
        holds: a key that all figures of a robot have; null where there are none.
    """

    name: str
    robots: tuple[str, ...]
    command: str
    holds: str = "labels"

    @property
    def path(self) -> str:
        """Its name in the folder of results."""
        if len(self.robots) > 1:
            return f"{self.name}.json"
        kind, _, condition = self.name.partition("-")
        return "-".join(filter(None, (kind, *self.robots, condition))) + ".json"


# Conditions of tracking: title, what it asks, and options of evaluate tracking.
CONDITIONS = {
    "generated": (
        "as trained",
        "references that the generator writes, the contact of the training",
        "--seeds 20",
    ),
    "retargeted": (
        "recorded references",
        "stretches of recordings instead of generated motion",
        "--reference retargeted",
    ),
    "cenic": (
        "CENIC",
        "Drake's integrator with error control, at accuracy 1e-4",
        "--contact cenic --seeds 2 --duration 4",
    ),
    "lagged": (
        "lagged, 1 ms",
        "another contact solver, at a tenth of the step",
        "--contact lagged --time-step 0.001 --seeds 2 --duration 4",
    ),
    "randomized": (
        "randomized worlds",
        "friction, masses, motors, delays and sensors drawn anew for each episode",
        "--randomize --seeds 5",
    ),
    "pushes": (
        "pushes",
        "the robot is pushed from random sides, by 1 m/s every 2 s",
        "--pushes --seeds 5",
    ),
}

EXPECTED = (
    ResultFile("retargeting", ROBOTS, "loco-drake evaluate retargeting --robot all"),
    ResultFile("tokenizer", ROBOTS, "loco-drake evaluate tokenizer --robot all"),
    ResultFile("generation", ROBOTS, "loco-drake evaluate generation --robot all"),
    *(
        ResultFile(
            f"tracking-{condition}",
            (robot,),
            f"loco-drake evaluate tracking --robot {robot} {options}",
        )
        for robot in ROBOTS
        for condition, (_, _, options) in CONDITIONS.items()
    ),
    *(
        ResultFile(
            "learning",
            (robot,),
            f"loco-drake train tracker --robot {robot} --references FOLDER",
            holds="learning",
        )
        for robot in ROBOTS
    ),
)
