"""Fixtures for all tests."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from loco_drake.control.plan import Plan, plan_from_motion
from loco_drake.datasets.registry import DATASETS
from loco_drake.models.robots import Robot, get_robot
from tests.synthetic import write_data_folder
from tests.synthetic_motion import synthetic_motion


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks tests that need real recordings: ``-m recordings`` chooses them."""
    for item in items:
        if "real_data" in getattr(item, "fixturenames", ()):
            item.add_marker("recordings")


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of the real recordings; without one the test is skipped."""
    folder = os.environ.get("LOCO_DRAKE_DATA")
    if not folder:
        pytest.skip("needs real recordings: LOCO_DRAKE_DATA names no folder")
    assert Path(folder).is_dir(), f"LOCO_DRAKE_DATA: there is no folder {folder!r}"
    return Path(folder)


@pytest.fixture
def only_known_sources() -> Iterator[None]:
    """Sources that a test loads are gone after it."""
    before = dict(DATASETS)
    yield
    DATASETS.clear()
    DATASETS.update(before)


@pytest.fixture(scope="session")
def ray_cluster() -> Iterator[None]:
    """A Ray cluster of two cores on this machine; without Ray the test is skipped.

    Where RAY_ADDRESS names a cluster it is that one.
    """
    ray = pytest.importorskip("ray")
    own = {} if "RAY_ADDRESS" in os.environ else {"num_cpus": 2}
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    ray.init(
        os.environ.get("RAY_ADDRESS", "local"),
        log_to_driver=False,
        logging_level="ERROR",
        **own,
    )
    yield
    ray.shutdown()


@pytest.fixture(scope="session")
def made_data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data folder with made recordings of a dog: pace, trot and gallop, 4 s each."""
    folder = tmp_path_factory.mktemp("made_data")
    return write_data_folder(folder, gaits=("pace", "trot", "gallop"))


@pytest.fixture(scope="session")
def go2() -> Robot:
    return get_robot("go2")


@pytest.fixture(scope="session")
def trot(go2: Robot) -> Plan:
    """Four seconds of a slow trot that turns."""
    return plan_from_motion(go2, synthetic_motion("dog-trot", 4.0, 0.5, 0.2))
