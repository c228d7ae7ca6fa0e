"""Export of the policy as ONNX, for use without torch and this package."""

import json
import logging
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from loco_drake import __version__
from loco_drake.common.errors import InputError
from loco_drake.common.files import atomic_path
from loco_drake.control.action import velocity_gain
from loco_drake.control.actor import Actor
from loco_drake.control.observation import OBSERVATION_SIZE
from loco_drake.datasets.registry import DATASETS
from loco_drake.models.robots import Robot
from loco_drake.motion.gaits import any_label
from loco_drake.tracking.deployment import deployment, ignored_parts

SET_POINTS = (
    "every 1 / rate s: q_d = q + (velocity_gain v + tau) / kp + action_scale * action, "
    "v_d = 0; q is the plan's one period later, v and the feed-forward torques tau "
    "are means of that period; the motors give kp (q_d - q_measured) - kd v_measured"
)


def policy_metadata(actor: Actor, robot: Robot) -> dict[str, str]:
    """Returns what is needed to run a policy, as ONNX metadata: strings, or JSON.

    - kind, robot, labels; rate in Hz
    - observation_layout: names and sizes of the parts of the observation, in order;
      :mod:`loco_drake.control.observation` says what they are; ignored_parts: those
      that make no difference to this policy
    - joint_names in the order of the action; standing_joints (rad), which joint
      positions are observed from; kp (Nm/rad) and kd (Nm s/rad) of the joints' PD
    - action_scale (rad), velocity_gain (Nm s/rad) and set_points: what becomes of an
      action and of the plan
    - licence: of the recordings that the policy was learned from
    - deployment: all of this in one JSON object, with the definition of the
      observation, limits and test vectors, see :mod:`.deployment`
    """
    config = actor.config
    sources = dict.fromkeys(any_label(label).source for label in config.labels)
    licences = "; ".join(
        f"{source}: {DATASETS[source].licence}, {DATASETS[source].attribution}"
        if source in DATASETS
        else f"{source}: not known"
        for source in sources
    )
    values: dict[str, Any] = {
        "kind": "loco_drake policy",
        "version": __version__,
        "robot": robot.name,
        "labels": config.labels,
        "rate": config.rate,
        "observation_layout": config.observation_layout,
        "ignored_parts": list(ignored_parts(actor)),
        "joint_names": list(robot.joint_names),
        "standing_joints": robot.stand_joints.tolist(),
        "kp": robot.kp.tolist(),
        "kd": robot.kd.tolist(),
        "velocity_gain": velocity_gain(robot).tolist(),
        "action_scale": config.action_scale,
        "set_points": SET_POINTS,
        "licence": "The weights are under the conditions of the recordings that they "
        f"were learned from, not under the code's licence. {licences}",
        "deployment": deployment(actor, robot),
    }
    return {
        name: value if isinstance(value, str) else json.dumps(value)
        for name, value in values.items()
    }


class _Step(nn.Module):
    """:meth:`Actor.step` as a module."""

    def __init__(self, actor: Actor) -> None:
        super().__init__()
        self._actor = actor

    def forward(self, observation: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        return self._actor.step(observation, memory)


def export_onnx(actor: Actor, robot: Robot, path: Path) -> dict[str, str]:
    """Writes a policy as ONNX and returns its metadata.

    The network maps raw observations "observation" (N, OBSERVATION_SIZE) to "action"
    (N, 12), in 32 bits, for any N. Normalization, clipping and mirror symmetry are
    included. A policy with a history has the input "memory" and the output
    "next_memory", too, (N, memory_size) each.

    Raises:
        InputError: if the packages of the extra ``onnx`` are not installed.
    """
    try:
        import onnx
        import onnxscript  # noqa: F401 (torch exports with it)
    except ImportError:
        raise InputError(
            "To export to ONNX, install the packages onnx and onnxscript, the extra "
            "'onnx' of loco_drake."
        ) from None
    # It tells of operators of packages that are not installed.
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)
    sizes, outputs = {"observation": OBSERVATION_SIZE}, ["action"]
    dimensions = {"observation": {0: torch.export.Dim("robots")}}
    network: nn.Module = actor
    if actor.memory_size:
        sizes["memory"] = actor.memory_size
        dimensions["memory"] = {0: torch.export.Dim.AUTO}  # the same number
        outputs.append("next_memory")
        network = _Step(actor)
    program = torch.onnx.export(
        network.eval(),
        tuple(torch.zeros(2, size) for size in sizes.values()),
        dynamo=True,
        verbose=False,
        input_names=list(sizes),
        output_names=outputs,
        dynamic_shapes=dimensions,
    )
    assert program is not None
    model = program.model_proto
    metadata = policy_metadata(actor, robot)
    onnx.helper.set_model_props(model, metadata)
    onnx.checker.check_model(model)
    with atomic_path(Path(path)) as temporary:
        onnx.save(model, temporary)
    return metadata
