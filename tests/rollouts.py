"""Records of simulations, made by hand."""

import numpy as np

from loco_drake.evaluation.tracking import Rollout


def straight_ahead(steps):
    """Straight ahead at .7 m/s, all as planned, for so many steps of 20 ms."""
    time = 0.02 * np.arange(steps + 1)
    plan = np.zeros((steps + 1, 37))
    plan[:, 0] = 1.0
    plan[:, 4] = 0.7 * time
    plan[:, 6] = 0.3
    plan[:, 22] = 0.7
    return Rollout(
        state=plan.copy(),
        plan_state=plan,
        path_time=time,
        desired_joints=plan[:, 7:19].copy(),
        reward=np.ones(steps + 1),
        steps=steps,
        fell=False,
    )
