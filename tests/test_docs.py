"""What the documentation says is so."""

import re
from pathlib import Path

import pytest

from loco_drake.cli.main import _COMMANDS
from loco_drake.systems.diagram import MakeLocomotionDiagram
from loco_drake.systems.scenario import ExternalAction, PlanReference, Scenario

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("*/*.md"), *ROOT.glob("models/*/*.md")])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files(page):
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text()):
        if not target.startswith("https://"):
            assert (page.parent / target).is_file(), target


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
    assert systems == set(re.findall(r"<b>(\w+)</b>", page)) - {"policy"}
    ports = [
        diagram.get_output_port(i).get_name() for i in range(diagram.num_output_ports())
    ]
    assert sorted(ports) == sorted(re.findall(r" p\d\(\[(\w+)\]\)", page))


def test_retargeting_shows_the_robot_file_as_it_is():
    page = (ROOT / "docs" / "retargeting.md").read_text()
    (block,) = re.findall(r"^```yaml\n(.*?)^```$", page, re.M | re.S)
    assert block == (ROOT / "examples" / "solo8.yaml").read_text()


def readme():
    return (ROOT / "README.md").read_text()
