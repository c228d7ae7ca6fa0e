"""What the documentation says is so."""

import json
import re
from pathlib import Path

import pytest

from loco_drake.cli.main import _COMMANDS
from loco_drake.evaluation.report.results import results_dir
from loco_drake.evaluation.robustness_pictures import levels_table
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


def test_retargeting_shows_the_robot_file_as_it_is():
    page = (ROOT / "docs" / "retargeting.md").read_text()
    (block,) = re.findall(r"^```yaml\n(.*?)^```$", page, re.M | re.S)
    assert block == (ROOT / "examples" / "solo8.yaml").read_text()


def readme():
    return (ROOT / "README.md").read_text()


# Columns of the tables of docs/tracking.md: key of the figure, factor, digits.
TRACKING_COLUMNS = (
    ("normalized_return", 1, 1),
    ("normalized_return_worst", 1, 1),
    ("fall_rate", 100, 0),
    ("joint_rmse_rad", 1, 3),
    ("base_position_rmse_m", 1, 3),
    ("base_orientation_rmse_rad", 1, 3),
    ("stance_slip_median_mps", 1, 3),
    ("stretch", 1, 3),
    ("speed_mps", 1, 2),
    ("cost_of_transport", 1, 2),
)


@pytest.mark.parametrize(("robot", "title"), [("a1", "A1:"), ("go2", "Go2:")])
def test_tracking_shows_the_committed_results(robot, title):
    page = (ROOT / "docs" / "tracking.md").read_text()
    (table,) = re.findall(rf"{title}\n\n((?:\|.*\n)+)", page)
    rows = [line.strip("| ").split(" | ") for line in table.splitlines()[2:]]
    results = json.loads(
        (results_dir() / f"tracking-{robot}-generated.json").read_text()
    )
    figures = {**results["labels"], "all": results["all"]}
    assert [row[0] for row in rows] == list(figures)
    for name, *shown in rows:
        assert shown == [
            f"{factor * figures[name][key]:.{digits}f}"
            for key, factor, digits in TRACKING_COLUMNS
        ], name


# The same of docs/steering.md, behind the ranges and before the steps covered.
STEERING_COLUMNS = (
    ("velocity_rmse_mps", 1, 3),
    ("yaw_rate_rmse_radps", 1, 3),
    ("fall_rate", 100, 0),
    ("normalized_return", 1, 1),
    ("latency_reference_s", 1, 2),
    ("latency_robot_s", 1, 2),
)


def steering_row(figures):
    ranges, covered = ["–"] * 3, "–"  # of all labels together
    if "range" in figures:
        ends = figures["range"].values()
        ranges = [f"{low:.2f} to {high:.2f}" for low, high in ends]
        covered = f"{figures['steps_covered']} of {figures['steps']}"
    values = [
        "–" if figures[key] is None else f"{factor * figures[key]:.{digits}f}"
        for key, factor, digits in STEERING_COLUMNS
    ]
    return [*ranges, *values, covered]


@pytest.mark.parametrize(("robot", "title"), [("a1", "A1:"), ("go2", "Go2:")])
def test_steering_shows_the_committed_results(robot, title):
    page = (ROOT / "docs" / "steering.md").read_text()
    (table,) = re.findall(rf"{title}\n\n((?:\|.*\n)+)", page)
    rows = [line.strip("| ").split(" | ") for line in table.splitlines()[2:]]
    results = json.loads((results_dir() / f"steering-{robot}.json").read_text())
    figures = {**results["labels"], "all": results["all"]}
    assert rows == [[name, *steering_row(own)] for name, own in figures.items()]


@pytest.mark.parametrize("robot", ["go2", "a1"])
def test_robustness_shows_the_committed_results(robot):
    """The rows of all gaits; docs/draw.py prints the tables."""
    page = (ROOT / "docs" / "robustness.md").read_text()
    whole = json.loads((results_dir() / f"robustness-{robot}.json").read_text())["all"]
    low, high = whole["impulse_80_percent_interval_ns"]
    row = f"| all | {whole['impulse_80_percent_ns']:.1f} | {low:.1f} | {high:.1f} | "
    assert f"{row}{whole['recovery_s']:.2f} | " in page
    columns, rows = levels_table(whole)
    for cells in (columns, *rows):
        assert f"| {' | '.join(cells)} |" in page
