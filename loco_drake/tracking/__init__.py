"""The Gymnasium environment and the training of the tracking policy.

Importing it makes ``gymnasium.make("loco_drake/Tracking-v0")`` known.
"""

from loco_drake.tracking.registration import register

register()
