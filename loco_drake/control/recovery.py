"""How far a robot is from its plan, and which network acts there.

One network follows the plan exactly, a second one returns to it after a push. A single
network that learns both does each of them worse.
"""

from collections.abc import Mapping

import torch
from torch import Tensor

from loco_drake.control.observation import PLACES
from loco_drake.control.plan import PLAN_DT

# At which velocity (m/s) and distance (m) in the plane, and at which angle (rad), the
# second network begins to act.
RECOVERY = [0.25, 0.12, 0.25]


def share_of_recovery(
    observation: Tensor,
    recovery: list[float],
    places: Mapping[str, slice] = PLACES,
) -> Tensor:
    """Returns the share of the second network in the action, 0 to 1, shape (..., 1).

    With the errors e of the base at the plan's next sample, should the robot keep its
    velocity until then, and the thresholds r, it is

        d = |e_v|^2 / r_v^2 + |e_p|^2 / r_p^2 + |e_R|^2 / r_R^2 - 1

    between 0 and 1. It is the same for a mirrored observation.

    Args:
        observation: as of :func:`.observe`, not normalized, shape (..., N).
        recovery: the thresholds, as RECOVERY.
        places: where the parts of the observation are.
    """
    # Of the plan, that of the next sample.
    v, w, plan_v, plan_p, plan_R = (
        observation[..., places[name]]
        for name in ("v_WB_H", "w_WB_B", "plan_v_H", "plan_p_H", "plan_R_B")
    )
    off_v = plan_v[..., :2] - v[..., :2]
    off_p = plan_p[..., :2] - PLAN_DT * v[..., :2]
    off_R = plan_R[..., :3] - PLAN_DT * w
    squares = [
        (off / threshold).square().sum(dim=-1, keepdim=True)
        for off, threshold in zip((off_v, off_p, off_R), recovery, strict=True)
    ]
    return (torch.cat(squares, dim=-1).sum(dim=-1, keepdim=True) - 1).clamp(0, 1)
