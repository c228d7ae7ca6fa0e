"""Quadruped locomotion learned from diverse motion, simulated in Drake.

The parts, in the order in which motion flows through them: :mod:`datasets`,
:mod:`retargeting`, :mod:`generation`, :mod:`systems`, :mod:`tracking`,
:mod:`evaluation`; the robots are in :mod:`models`. Importing the package makes
``gymnasium.make("loco_drake/Tracking-v0")`` known.
"""

from loco_drake.tracking.registration import register

__version__ = "0.1.0"

register()
