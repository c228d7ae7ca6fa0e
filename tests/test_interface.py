"""``import loco_drake`` is cheap, and has what scripts need."""

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import loco_drake

HEAVY = ("torch", "pydrake", "stable_baselines3", "scipy", "toppra", "matplotlib")


def test_importing_the_package_imports_nothing_heavy():
    code = f"import sys, loco_drake; print([m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", loco_drake.__all__)
def test_every_name_is_there_and_is_that_of_its_module(name):
    value = getattr(loco_drake, name)
    assert value.__module__.startswith("loco_drake.")
    assert getattr(import_module(value.__module__), value.__name__) is value
    assert name in dir(loco_drake)


def test_type_checkers_see_the_same_names():
    """Those imported under TYPE_CHECKING, one line each."""
    source = Path(loco_drake.__file__).read_text()
    block = source[source.index("if TYPE_CHECKING") : source.index("__version__")]
    for name in loco_drake.__all__:
        assert (
            f" as {name}\n" in block
            or f" as {name}," in block
            or (f" as {name}  # noqa" in block)
        )


def test_another_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'Simulate'"):
        loco_drake.Simulate  # noqa: B018
    assert not hasattr(loco_drake, "__wrapped__")


def test_files_of_motion_are_read_and_written_by_the_room():
    """``from loco_drake.motion import ...`` gives the functions of its modules."""
    from loco_drake import motion
    from loco_drake.motion import motion_file

    assert motion.load_motion is motion_file.load_motion
    assert motion.save_motion is motion_file.save_motion
    with pytest.raises(AttributeError, match="no attribute 'load'"):
        _ = motion.load
