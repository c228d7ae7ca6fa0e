"""A robot and a plan for it, as the systems' tests have them."""

from tests.systems.conftest import go2, trot

__all__ = ["go2", "trot"]
