"""Tests of loco_drake.datasets."""
