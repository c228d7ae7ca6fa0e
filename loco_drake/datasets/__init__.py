"""Readers of recorded and simulated motion: files -> :class:`KeypointClip`.

One module per source, and :mod:`loco_drake.datasets.registry`, which knows them all.
"""
