"""Tests of loco_drake.retargeting."""
