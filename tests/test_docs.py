"""What the documentation says is so."""

import importlib.util
import json
import re
from pathlib import Path

import pytest
import yaml

from loco_drake import __version__
from loco_drake.cli.main import _COMMANDS
from loco_drake.evaluation.report.results import results_dir
from loco_drake.systems.diagram import MakeLocomotionDiagram
from loco_drake.systems.scenario import ExternalAction, PlanReference, Scenario

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("*/*.md"), *ROOT.glob("models/*/*.md")])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files(page):
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text()):
        if not target.startswith("https://"):
            assert (page.parent / target).is_file(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_modules_that_pages_name_exist(page):
    """Or the modules that they name something in."""
    for name in re.findall(r"loco_drake((?:\.[A-Za-z_0-9]+)+)`", page.read_text()):
        path = ROOT / "loco_drake" / name[1:].replace(".", "/")
        module = path.parent.with_suffix(".py")
        if not (path.is_dir() or path.with_suffix(".py").exists()):
            assert module.exists(), name
            assert re.search(rf"^(def|class) {path.name}\b", module.read_text(), re.M)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_line_is_lost_as_a_comment(page):
    """Sphinx leaves out a line that begins with a percent sign."""
    assert re.findall(r"^ *%.*", page.read_text(), re.M) == []


def test_readme_lists_every_command():
    table = re.findall(r"^\| `loco-drake ([a-z ]+)` \|", readme(), flags=re.MULTILINE)
    assert table == list(_COMMANDS)


def test_readme_starts_with_the_two_commands_and_ci_runs_the_second():
    install, test, *_ = re.findall(r"^```sh\n(.*?)\n```$", readme(), re.M | re.S)
    assert install == "pip install . && loco-drake simulate"
    assert test == 'pip install -e ".[test]" && python -m pytest'
    script = (ROOT / ".ci" / "run").read_text()
    assert all(command in script for command in test.split(" && "))


def test_architecture_names_every_system_and_port_of_the_diagram():
    page = (ROOT / "docs" / "architecture.md").read_text()
    diagram = MakeLocomotionDiagram(
        Scenario(reference=PlanReference(), policy=ExternalAction())
    )
    systems = {system.get_name() for system in diagram.GetSystems()}
    # The scenario has neither a policy nor a generated reference.
    absent = {"policy", "gait_selector"}
    assert systems == set(re.findall(r"<b>(\w+)</b>", page)) - absent
    ports = [
        diagram.get_output_port(i).get_name() for i in range(diagram.num_output_ports())
    ]
    assert sorted(ports) == sorted(re.findall(r" p\d+\(\[(\w+)\]\)", page))


@pytest.mark.parametrize(
    ("way", "bound"),
    [
        ("One clip, from file to torque", 25),
        ("One token, to torque", 15),
        ("One training step", 12),
    ],
)
def test_architecture_lists_files_that_exist_each_once_and_few(way, bound):
    page = (ROOT / "docs" / "architecture.md").read_text()
    section = page.split(f"### {way}\n")[1].split("\n#")[0]
    files = re.findall(r"^\d+\. `(.+?)`: ", section, re.M)
    assert 10 <= len(files) == len(set(files)) <= bound
    assert [path for path in files if not (ROOT / path).is_file()] == []


def test_own_robot_shows_the_robot_file_as_it_is():
    page = (ROOT / "docs" / "own_robot.md").read_text()
    (block,) = re.findall(r"^```yaml\n(.*?)^```$", page, re.M | re.S)
    assert block == (ROOT / "examples" / "b1.yaml").read_text()


def readme():
    return (ROOT / "README.md").read_text()


@pytest.mark.parametrize(
    "name",
    [
        "tracking_results.md",
        "generation_results.md",
        "steering.md",
        "robustness.md",
        "results.md",
        "../models/pretrained/MODEL_CARD.md",
    ],
)
def test_pages_show_the_committed_results(name):
    page = (ROOT / "docs" / name).read_text()
    assert tables().with_results(name, page) == page


def test_other_results_change_the_pages():
    """Each number is where its column says; a table with other columns is refused."""
    path = results_dir() / "tracking-go2-generated.json"
    results = json.loads(path.read_text())
    shown = dict(enumerate(tables().tracking_rows(results)[0]))
    assert shown[0] == next(iter(results["labels"]))
    results["labels"][shown[0]]["fall_rate"] = 0.123
    results["labels"][shown[0]]["speed_mps"] = None
    other = dict(enumerate(tables().tracking_rows(results)[0]))
    assert dict(other.items() - shown.items()) == {3: "12", 9: "–"}
    with pytest.raises(ValueError, match="has 2 columns"):
        tables()._replaced("Go2:\n\n| a | b |\n|---|---|\n| 1 | 2 |\n", "Go2:", [["1"]])


def tables():
    """The module docs/tables.py."""
    spec = importlib.util.spec_from_file_location("tables", ROOT / "docs" / "tables.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_citation_says_what_the_package_is():
    """What version 1.2.0 of the format requires, and nothing that is not known."""
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert cited["cff-version"] == "1.2.0"
    assert cited["message"]
    assert (cited["title"], str(cited["version"])) == ("loco_drake", __version__)
    assert cited["license"] == "BSD-3-Clause"
    for work in (cited, *cited["references"]):
        assert work["title"]
        assert all(set(author) == {"name"} for author in work["authors"])
    (paper,) = cited["references"]
    assert paper["type"] == "generic"
    entries = re.findall(r"^```bibtex\n(.*?)^```$", readme(), re.M | re.S)
    for text in (paper["title"], __version__, cited["authors"][0]["name"]):
        assert f"{{{text}}}" in entries[0]
