"""What a Ray cluster is refused for."""

import os
import re

import pytest

pytest.importorskip("ray")

from loco_drake.common.errors import InputError
from loco_drake.engine import cluster


def make_square():
    return lambda x: x * x


def test_more_workers_than_cores_are_refused(ray_cluster):
    import ray

    cores = int(ray.cluster_resources()["CPU"])
    text = f"--workers must be at most {cores}, the cores of the Ray cluster, not 999."
    executor = cluster.Ray(999)
    with pytest.raises(InputError, match=re.escape(text)):
        list(executor.map(make_square, range(1000)))
    with pytest.raises(InputError, match=re.escape(text)):
        executor.crew(make_square, range(999))
    # No more workers than tasks are started.
    assert list(executor.map(make_square, range(2))) == [0, 1]


def test_machines_with_other_packages_are_refused(ray_cluster, monkeypatch):
    found = cluster._versions() | {"numpy": "0.1"}
    monkeypatch.setattr(cluster, "_versions", lambda: found)
    text = r"^The machine .* has numpy .*, not 0.1; results are the same with the same"
    with pytest.raises(InputError, match=text):
        list(cluster.Ray(2).map(make_square, range(3)))


def test_machines_without_the_present_folder_are_refused(tmp_path):
    here = os.getcwd()
    with pytest.raises(InputError, match=r"^The machine .* has no folder .*nowhere"):
        cluster._check_machine(cluster._versions(), str(tmp_path / "nowhere"))
    assert os.getcwd() == here


def test_a_crew_waits_no_longer_than_it_has_patience(ray_cluster, monkeypatch):
    """All cores are another crew's."""
    import ray

    cores = int(ray.cluster_resources()["CPU"])
    first = cluster.Ray().crew(lambda _: str, range(cores))
    try:
        first.send(0, 3)
        assert first.receive(0) == "3"
        monkeypatch.setattr(cluster, "PATIENCE", 1.0)
        text = "has started 0 of 1 workers in 1 s; its other cores may be taken"
        with pytest.raises(ChildProcessError, match=text):
            cluster.Ray().crew(lambda _: str, [0])
    finally:
        first.close()


@pytest.mark.parametrize("address", ["127.0.0.1:1", "nowhere.invalid:6379"])
def test_an_address_without_a_cluster_is_named_at_once(address, monkeypatch):
    monkeypatch.setattr(cluster.ray, "is_initialized", lambda: False)
    with pytest.raises(InputError, match=f"There is no Ray cluster at '{address}' "):
        list(cluster.Ray(1, address).map(make_square, [1]))


def test_a_cluster_of_ones_own_that_does_not_start_is_no_ones_input(monkeypatch):
    def refuse(*arguments, **options):
        raise Exception("The node timed out.")

    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setattr(cluster.ray, "is_initialized", lambda: False)
    monkeypatch.setattr(cluster.ray, "init", refuse)
    with pytest.raises(OSError, match=r"^Ray does not start on this machine: The node"):
        list(cluster.Ray(1).map(make_square, [1]))
