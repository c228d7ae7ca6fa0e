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
        flags: the part of ``command`` that figures of tracking do not tell.
        holds: a key that all figures of a robot have; null where there are none.
    """

    name: str
    robots: tuple[str, ...]
    command: str
    flags: str = ""
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
        "--contact cenic --seeds 5",
    ),
    "lagged": (
        "lagged, 1 ms",
        "another contact solver, at a tenth of the step",
        "--contact lagged --time-step 0.001 --seeds 5",
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

# Shipped policies, as evaluate tracking calls them: what they are.
POLICIES = {
    "": "as shipped",
    "randomized": "trained in randomized worlds",
    "unprivileged": "… and without privileged observations",
}
_HAVE_VARIANTS = ("a1",)
# Where they are compared: title, its name as a condition, options.
WORLDS = (
    ("world of the training", "generated", "--seeds 20"),
    ("randomized worlds", "randomized", "--randomize --seeds 5"),
)


def tracking_name(condition: str, policy: str = "") -> str:
    """Returns the name of the results of a shipped policy under a condition."""
    return "-".join(
        filter(None, ("tracking", policy and f"{policy}_policy", condition))
    )


def _tracking(robot: str, condition: str, options: str, policy: str = "") -> ResultFile:
    flags = [o for o in options.split() if o in ("--randomize", "--pushes")]
    if policy:
        flags.insert(0, f"--policy {policy}")
        options = f"--policy {policy} {options}"
    return ResultFile(
        tracking_name(condition, policy),
        (robot,),
        f"loco-drake evaluate tracking --robot {robot} {options}",
        " ".join(flags),
    )


EXPECTED = (
    ResultFile("retargeting", ROBOTS, "loco-drake evaluate retargeting --robot all"),
    ResultFile("tokenizer", ROBOTS, "loco-drake evaluate tokenizer --robot all"),
    ResultFile("generation", ROBOTS, "loco-drake evaluate generation --robot all"),
    *(_tracking(r, name, what[2]) for r in ROBOTS for name, what in CONDITIONS.items()),
    *(
        _tracking(robot, condition, options, policy)
        for robot in _HAVE_VARIANTS
        for policy in filter(None, POLICIES)
        for _, condition, options in WORLDS
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
