"""What the shipped networks are, read from their weights."""

from loco_drake.common.errors import InputError
from loco_drake.common.weights import load_weights
from loco_drake.control.actor import load_actor
from loco_drake.evaluation.report.published import SIZES
from loco_drake.evaluation.report.tables import Cell, Row, Table
from loco_drake.evaluation.report.words import robot_title
from loco_drake.models.robots import ROBOTS, get_robot
from loco_drake.models.shipped import policy_path, pretrained_path
from loco_drake.motion.motion import FPS


def networks_table() -> Table:
    """Returns the parts of the pipeline, the paper's beside ours.

    Raises:
        InputError: if shipped weights are damaged.
    """
    _, tokenizer = load_weights(pretrained_path("tokenizer"), "tokenizer")
    _, generator = load_weights(pretrained_path("generator"), "generator")
    fields = {**tokenizer["network"], **generator["network"], **_policy()}
    fields["books"] = tokenizer["network"]["books"]
    fields["tokens_per_second"] = FPS / tokenizer["network"]["frames_per_token"]
    fields["robots"] = " and ".join(map(robot_title, tokenizer["network"]["robots"]))
    rows = tuple(
        Row(size.part, (Cell(size.paper), Cell(size.ours.format(**fields))))
        for size in SIZES
    )
    return Table("The parts", "part", ("paper's release", "ours"), rows)


def _policy() -> dict[str, object]:
    for name in ROBOTS:
        robot = get_robot(name)
        try:
            config = load_actor(policy_path(robot), robot).config
        except InputError:
            continue
        return {
            "hidden": "-".join(str(width) for width in config.hidden),
            "observations": sum(size for _, size in config.observation_layout),
            "action_scale": config.action_scale,
        }
    raise InputError("No policy weights come with this package.")
