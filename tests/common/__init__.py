"""Tests of loco_drake.cli."""
