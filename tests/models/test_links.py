from pathlib import Path

import pytest

import loco_drake

PACKAGE = Path(loco_drake.__file__).parent
ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", ["models", "systems"])
def test_link_resolves(name):
    """loco_drake/models and loco_drake/systems lead to the folders at the root."""
    inside = PACKAGE / name
    assert (inside / "__init__.py").is_file(), (
        f"{inside} leads nowhere. In the repository it is a symbolic link to a folder "
        "at the root, so that its code is found there and imported from loco_drake. "
        "Unpacking with Python's zipfile, or checking out on Windows without the right "
        "to make links, turns it into a text file: replace that by a link to "
        f"../{name}."
    )
    if PACKAGE.parent == ROOT:  # not when an installed wheel is tested
        assert inside.resolve() == ROOT / name
