"""The wheel holds what the library needs, and works outside the checkout."""

import shutil
import subprocess
import tarfile
import zipfile
from pathlib import Path

import pytest

from loco_drake import __version__
from loco_drake.models.robots import get_robot
from tests.process import run_python

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built as pip builds it, but without an environment of its own."""
    folder = tmp_path_factory.mktemp("dist")
    run_python("-m", "hatchling", "build", "-t", "wheel", "-d", folder, cwd=ROOT)
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """A folder into which the wheel is installed.

    A wheel of pure Python with nothing in a .data folder is installed by unpacking it;
    not every virtual environment has pip.
    """
    folder = tmp_path_factory.mktemp("installed")
    with zipfile.ZipFile(wheel) as archive:
        assert not [name for name in archive.namelist() if ".data/" in name]
        archive.extractall(folder)
    return folder


def test_wheel_has_code_models_weights_and_configuration(wheel):
    """All that is committed below the three source folders is in it."""
    if not (shutil.which("git") and (ROOT / ".git").exists()):
        pytest.skip("needs git, and a checkout")
    committed = subprocess.run(
        ["git", "ls-files", "loco_drake", "systems", "models"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    links = {"loco_drake/systems", "loco_drake/models"}
    expected = {
        name if name.startswith("loco_drake/") else f"loco_drake/{name}"
        for name in committed
        if name not in links and (ROOT / name).is_file()
    }
    with zipfile.ZipFile(wheel) as archive:
        found = set(archive.namelist())
    assert found >= expected
    for name in (
        "py.typed",
        "datasets/manifest.csv",
        "datasets/segments.csv",
        "retargeting/sources/dog.yaml",
        "models/package.xml",
        "models/go2/go2.urdf",
        "models/go2/go2.yaml",
        "models/a1/a1.urdf",
        "models/a1/a1.yaml",
        "models/pretrained/MODEL_CARD.md",
        "models/pretrained/tokenizer.safetensors",
        "models/pretrained/generator.safetensors",
        "models/pretrained/policy_go2.safetensors",
        "models/pretrained/results/generation.json",
        "models/pretrained/results/retargeted-dog-pace.webp",
        "models/pretrained/results/tracking-go2-generated.json",
        "evaluation/report/templates/page.html",
        "evaluation/report/templates/style.css",
        "systems/diagram.py",
    ):
        assert f"loco_drake/{name}" in found


def test_wheel_has_one_package_its_licence_and_no_recordings(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        size = sum(info.file_size for info in archive.infolist())
    info = f"loco_drake-{__version__}.dist-info"
    assert {name.split("/")[0] for name in names} == {"loco_drake", info}
    assert f"{info}/licenses/LICENSE" in names
    suffixes = {Path(name).suffix for name in names if not name.startswith(info)}
    data = {".urdf", ".xml", ".yaml", ".md", ".safetensors", ".json"}
    page = {".html", ".css", ".js", ".svg", ".webp"}
    assert suffixes <= {".py", ".typed", ".csv", *data, *page}
    results = {str(Path(name).parent) for name in names if name.endswith(".json")}
    assert results == {"loco_drake/models/pretrained/results"}
    tables = {name for name in names if name.endswith(".csv")}
    assert tables == {f"loco_drake/datasets/{t}.csv" for t in ("manifest", "segments")}
    assert size < 20e6


def test_source_distribution_holds_the_linked_folders(tmp_path):
    """From it a wheel can be built: its links were followed."""
    run_python("-m", "hatchling", "build", "-t", "sdist", "-d", tmp_path, cwd=ROOT)
    (path,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        names = archive.getnames()
    top = f"loco_drake-{__version__}"
    for name in (
        "loco_drake/systems/diagram.py",
        "loco_drake/models/go2/go2.urdf",
        "examples/simulate.py",
        "tests/test_packaging.py",
        "pyproject.toml",
        "README.md",
        "LICENSE",
    ):
        assert f"{top}/{name}" in names


STEP = """
import numpy as np

import loco_drake as ld

scenario = ld.LoadScenario(
    data="{reference: !PlanReference {}, policy: !ExternalAction {}}"
)
diagram = ld.MakeLocomotionDiagram(scenario)
simulator = ld.MakeSimulator(diagram, scenario)
diagram.GetInputPort("action").FixValue(simulator.get_mutable_context(), np.zeros(12))
ld.StartEpisode(simulator)
simulator.AdvanceTo(0.5)
state = diagram.GetOutputPort("state").Eval(simulator.get_context())
print(ld.__file__)
print(ld.get_robot("go2").mass, state[6])
"""

COMMAND = """
from importlib.metadata import entry_points

(script,) = entry_points(group="console_scripts", name="loco-drake")
print(script.load()(["--version"]), script.load().__code__.co_filename)
"""

GYMNASIUM = """
import gymnasium

name = "loco_drake:loco_drake/Tracking-v0"
env = gymnasium.make(name, labels=["dog-trot"], count=1, seconds=2.0)
print(env.reset(seed=0)[0].shape == env.observation_space.shape, env.spec.id)
"""


@pytest.mark.slow
def test_installed_wheel_simulates_the_go2_outside_the_checkout(installed, tmp_path):
    """The Go2 has its mass, and stands to within a centimetre after half a second."""
    printed = run_python("-c", STEP, cwd=tmp_path, PYTHONPATH=str(installed))
    file, numbers = printed.splitlines()
    assert Path(file) == installed / "loco_drake" / "__init__.py"
    mass, height = map(float, numbers.split())
    robot = get_robot("go2")
    assert mass == robot.mass
    assert height == pytest.approx(robot.stand_height, abs=0.01)


def test_installed_wheel_has_the_command(installed, tmp_path):
    printed = run_python("-c", COMMAND, cwd=tmp_path, PYTHONPATH=str(installed))
    file = installed / "loco_drake" / "cli" / "main.py"
    assert printed == f"{__version__}\n0 {file}\n"


REPORT = """
from loco_drake.cli.main import main

raise SystemExit(main(["report", "--labels", "none"]))
"""


@pytest.mark.slow
def test_installed_wheel_makes_the_report_of_its_own_results(installed, tmp_path):
    run_python("-c", REPORT, cwd=tmp_path, PYTHONPATH=str(installed))
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Table 1: quality and diversity" in page
    assert "Outlines of go2 and a1" in page


@pytest.mark.slow
def test_gymnasium_finds_the_environment_of_the_installed_wheel(installed, tmp_path):
    """In a process that has not imported loco_drake."""
    printed = run_python("-c", GYMNASIUM, cwd=tmp_path, PYTHONPATH=str(installed))
    assert printed == "True loco_drake/Tracking-v0\n"
