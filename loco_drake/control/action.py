"""From the policy's action to the set-points of the joints' PD controllers."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ACTION_SCALE = 0.15  # rad per unit of action: 15 Nm on both robots


def joint_targets(set_points: Array, action: Array) -> Array:
    """Returns what the PD is sent, [q_d, v_d], shape (..., 2 J).

    They are q_d = set_points + ACTION_SCALE * action and v_d = 0: the desired velocity
    is within the set-points, since Drake's CENIC integrator (1.51) takes it with the
    wrong sign; the torque kp (q_d - q) - kd v is the same either way.

    Args:
        set_points: of the plan for the end of the control period, rad, shape (..., J).
        action: the policy's, shape (..., J).
    """
    q_d = set_points + ACTION_SCALE * action
    return np.concatenate((q_d, np.zeros_like(q_d)), axis=-1)
