"""Order of legs and joints, and left-right mirroring."""

import numpy as np

# Feet in the order of every array with a leg axis; left is +y.
LEGS = ("FL", "FR", "RL", "RR")

# Mirroring left-right, in the plane y = 0: swap FL<->FR and RL<->RR, turn y.
MIRROR_LEGS = np.array([1, 0, 3, 2])
MIRROR_POLAR = np.array([1.0, -1.0, 1.0])  # positions, velocities
# Mirroring left-right, of robots with three joints a leg: turn the hips' signs.
MIRROR_JOINTS = np.array([3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8])
MIRROR_JOINT_SIGNS = np.tile([-1.0, 1.0, 1.0], 4)
MIRROR_AXIAL = np.array([-1.0, 1.0, -1.0])  # angular velocities
MIRROR_QUATERNION = np.array([1.0, -1.0, 1.0, -1.0])
