"""The engines give the same files, to the last bit."""

import json
import sys

import pytest

from loco_drake.cli.main import main
from loco_drake.common.files import figures_sha256

RAY = ("--engine", "ray", "--workers", "2")


def files(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*.npz")}


def figures(path):
    return figures_sha256(json.loads(path.read_text()))


def run(*arguments):
    return main([str(x) for x in arguments])


def test_retarget(ray_cluster, made_data, tmp_path, capsys):
    for name, engine in (("local", ()), ("ray", RAY)):
        out, path = tmp_path / name / "go2", tmp_path / f"{name}.json"
        options = ("--data-dir", made_data, "--trajectories", 1, "--steer", 1)
        assert run("retarget", *options, "--out", out, "--json", path, *engine) == 0
    local = files(tmp_path / "local")
    assert len(local) == 9
    assert files(tmp_path / "ray") == local


def test_generate(ray_cluster, tmp_path, capsys, monkeypatch):
    """Each batch in a worker; relative paths are those of the command."""
    monkeypatch.chdir(tmp_path)
    for name, engine in (("local", ()), ("ray", RAY), ("two", ("--workers", 2))):
        options = ("--duration", 1, "--count", 34, "--steer", "--out", name)
        assert run("generate", *options, *engine) == 0
    local = files(tmp_path / "local")
    assert len(local) == 34
    assert files(tmp_path / "ray") == local
    assert files(tmp_path / "two") == local


@pytest.mark.parametrize(
    "command",
    [
        "retargeting --robot all",
        "tracking --labels dog-trot --seeds 3 --duration .4",
    ],
)
def test_evaluate(ray_cluster, made_data, tmp_path, capsys, command):
    options = command.split()
    if options[0] == "retargeting":
        options += ["--data-dir", str(made_data)]
    for name, engine in (("local", ()), ("ray", RAY)):
        path = tmp_path / f"{name}.json"
        assert run("evaluate", *options, "--json", path, *engine) == 0
    assert figures(tmp_path / "ray.json") == figures(tmp_path / "local.json")


@pytest.mark.parametrize("command", ["retarget", "generate", "evaluate tracking"])
def test_without_ray_one_sentence_says_so(command, monkeypatch, capsys):
    monkeypatch.delitem(sys.modules, "loco_drake.engine.cluster", raising=False)
    monkeypatch.setitem(sys.modules, "ray", None)
    assert run(*command.split(), "--engine", "ray") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "install the package ray, the extra 'ray'" in line


def test_a_cluster_that_is_not_there_is_named(monkeypatch, capsys):
    pytest.importorskip("ray")
    from loco_drake.engine import cluster

    monkeypatch.setattr(cluster.ray, "is_initialized", lambda: False)
    assert run("generate", *RAY, "--ray-address", "127.0.0.1:1") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("loco-drake: There is no Ray cluster at '127.0.0.1:1' (")
    assert "refused); begin one there with `ray start --head`" in line
