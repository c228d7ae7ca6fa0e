"""How things are called on the page."""

_ROBOTS = {"go2": "Go2", "a1": "A1"}


def robot_title(name: str) -> str:
    """Returns the name of a robot as its maker writes it."""
    return _ROBOTS.get(name, name)
