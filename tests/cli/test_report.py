"""The command ``report``: what its page says, and where."""

import html
import json
import re

import pytest

from loco_drake.cli.main import main
from loco_drake.evaluation.report.results import results_dir
from tests.report_results import (
    learning,
    retargeting,
    robustness,
    steering,
    tokenizer,
    tracking,
    write_results,
)


def make(folder, *options):
    """Runs the command; returns the page and the figures."""
    page, figures = folder / "page.html", folder / "figures.json"
    line = ["report", "--html", str(page), "--json", str(figures), *map(str, options)]
    assert main(line) == 0
    return page.read_text(encoding="utf-8"), json.loads(figures.read_text())


def section(page, name):
    (found,) = re.findall(rf'<section id="{name}">(.*?)</section>', page, re.DOTALL)
    return found


def row(part, title, place=0):
    """The text of a row, entries apart, by the beginning of its title."""
    rows = [
        [text(cell) for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", found, re.S)]
        for found in re.findall(r"<tr.*?</tr>", part, re.DOTALL)
    ]
    return [cells for cells in rows if cells and cells[0].startswith(title)][place]


def text(markup):
    return html.unescape(" ".join(re.sub(r"<[^>]+>", " ", markup).split()))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Page and figures of a few results, of the A1 nothing but its retargeting."""
    folder = tmp_path_factory.mktemp("report")
    robots = {"go2": retargeting(), "a1": retargeting(correction_rmse_m=0.0311)}
    results = write_results(
        folder / "results",
        retargeting={"robots": robots},
        tokenizer={"robots": {"go2": tokenizer()}},
        tracking_go2_generated=tracking(),
        tracking_go2_lagged=tracking(normalized_return=55.5, stretch=1.0),
        tracking_go2_randomized=tracking(normalized_return=44.4, fall_rate=0.25),
        learning_go2=learning(),
        steering_go2=steering(),
        robustness_go2=robustness(),
    )
    return make(folder, "--results", results, "--labels", "none")


def test_goals_met_and_missed_are_marked_beside_what_is_known(made):
    page, _ = made
    glance = section(page, "glance")
    slip = row(glance, "slip of feet in stance")
    assert slip[1:3] == [
        "paper's clips .087",
        "≤ .03, targets moved by ≤ 30 mm RMS dream ≤ .01",
    ]
    assert slip[3:] == [
        "0.0123 moved 4.2 mm RMS", "✓ met",
        "0.0123 moved 31.1 mm RMS", "✗ missed",
    ]  # fmt: skip
    toes = row(glance, "toe error")
    assert toes[1:] == [
        "not published",
        "≤ 15 dream ≤ 7",
        "16.3",
        "✗ missed",
        "–",
        "not measured",
    ]
    worst = row(glance, "normalized return, worst gait")
    assert worst[3:5] == ["60.0 dog-trot", "✗ missed"]


def test_figures_by_gait_are_in_their_sections_and_units(made):
    page, _ = made
    assert row(section(page, "retargeting"), "dog-trot")[1:4] == ["12.30", "4.2", "–"]
    assert row(section(page, "retargeting"), "all", 1)[2] == "31.1"
    assert row(section(page, "tokenizer"), "solo8-wave")[1:3] == ["0.027", "16.3"]
    assert row(section(page, "tracking"), "solo8-wave")[1:4] == ["94.0", "1.021", "2"]
    lagged = row(section(page, "robustness"), "Go2, lagged")
    assert lagged[1:3] == ["55.5", "1.000"]
    assert lagged[7] == "60.0 dog-trot"


def test_a_policy_is_shown_in_both_worlds_side_by_side(made):
    page, _ = made
    cells = row(section(page, "robustness"), "Go2, as shipped")
    assert cells[1:4] == ["77.0", "1.021", "2"]
    assert cells[7:10] == ["44.4", "1.021", "25"]


def test_steering_shows_errors_beside_the_ranges_and_a_map(made):
    page, _ = made
    part = section(page, "steering")
    assert row(part, "mpc-trot")[1:3] == ["0.100", "0.050"]
    assert row(part, "mpc-trot", 1)[1:7] == [
        "-0.50", "2.00", "-0.30", "0.30", "-1.00", "0.90"
    ]  # fmt: skip
    assert "off the command at each point of the grid, for 2 gaits" in part
    assert "loco-drake evaluate steering --robot go2" in part
    assert "--robot a1" not in part


def test_disturbances_show_what_is_survived(made):
    page, _ = made
    part = section(page, "disturbances")
    assert row(part, "dog-trot")[1:7] == ["12.3", "9.9", "15.6", "0.46", "100", "50"]
    assert "Success of go2 against the size of each kind" in part
    assert "loco-drake evaluate robustness --robot go2 --seeds 3" in part


def test_pictures_say_what_they_show(made):
    page, _ = made
    pictures = re.findall(r'<svg[^>]*role="img"[^>]*>', page)
    assert len(pictures) == len(re.findall("<svg", page)) == 6
    assert "at the end go2 dog 61, go2 solo8 93" in section(page, "figure-3")
    strips = section(page, "gaits")
    assert strips.count("solo8-wave") >= 1
    assert "Outlines of go2 and a1" in strips


def test_missing_results_are_named_with_their_commands(made):
    page, figures = made
    missing = figures["missing"]
    assert set(missing) >= {"generation.json", "learning-a1.json"}
    assert "retargeting.json" not in missing
    (listed,) = re.findall(r'<details class="missing">(.*?)</details>', page, re.S)
    for name, command in missing.items():
        assert f"{name} : {command}" in text(listed)
    assert "tokenizer.json has nothing on the A1" in text(listed)
    assert missing["retargeted-dog-pace.webp"] in text(section(page, "figure-1"))
    for name in ("table-1", "realism"):
        assert "Not measured yet. It takes loco-drake evaluate generation" in text(
            section(page, name)
        )


def test_counts_are_those_of_the_page(made):
    page, figures = made
    for robot, title in (("go2", "Go2"), ("a1", "A1")):
        count = figures["goals"][robot]
        assert f"{count['met']} of {count['goals']} goals met by the {title}" in text(
            page
        )
    # Five of retargeting, but for the A1's slip.
    assert figures["goals"]["a1"]["met"] == 4
    glance = section(page, "glance")
    met = sum(figures["goals"][robot]["met"] for robot in figures["goals"])
    assert glance.count('class="badge met"') == met
    measured = sum(figures["goals"][robot]["measured"] for robot in figures["goals"])
    assert glance.count('class="badge missed"') == measured - met


def test_the_page_needs_nothing_else(made):
    page, figures = made
    assert not re.findall(r'(?:src|href)="(?!#|data:)', page)
    assert not re.findall(r"@import|url\((?!#)", page)
    assert figures["replays"] == []
    assert figures["bytes"] == len(page.encode())


def test_every_link_in_the_page_leads_somewhere(made):
    page, _ = made
    for target in re.findall(r'href="#([^"]+)"', page):
        assert f'id="{target}"' in page


@pytest.fixture(scope="module")
def shipped(tmp_path_factory):
    """Page and figures of the results that come with the package, with one replay."""
    folder = tmp_path_factory.mktemp("shipped")
    return make(folder, "--labels", "dog-trot", "--duration", 1)


@pytest.mark.slow
def test_shipped_results_are_on_the_page(shipped):
    page, figures = shipped
    generation = json.loads((results_dir() / "generation.json").read_text())
    go2 = generation["robots"]["go2"]
    quality = go2["classifiers"]["transformer"]["real_to_generated"]["horse"]
    table_1 = row(section(page, "table-1"), "Horse")
    assert "0.708 0.568–0.818" in table_1
    ours = f"{quality['mean']:.3f} {quality['low']:.3f}–{quality['high']:.3f}"
    assert ours in table_1
    told = row(section(page, "realism"), "told from recordings, linear")
    assert told[1] == "0.852"
    assert told[2].startswith(f"{go2['two_sample_accuracy']['mean']:.3f} ")
    tracked = json.loads((results_dir() / "tracking-go2-generated.json").read_text())
    returns = row(section(page, "tracking"), "all")
    assert returns[1] == f"{tracked['all']['normalized_return']:.1f}"
    assert figures["goals"]["go2"]["measured"] == figures["goals"]["go2"]["goals"]


@pytest.mark.slow
def test_a_replay_can_be_put_together_from_the_page(shipped):
    page, figures = shipped
    assert "go2 dog-trot" in figures["replays"]
    assert 2e6 < figures["bytes"] < 25e6
    (data,) = re.findall(r'id="replay-data">(.*?)</script>', page, re.DOTALL)
    shared = json.loads(data)
    assert len(shared["pages"]) == len(figures["replays"])
    replay = "".join(shared["pieces"][i] for i in shared["pages"][0])
    assert replay.startswith("<!DOCTYPE html>")
    assert replay.rstrip().endswith("</html>")
    assert "MeshCat.Viewer" in replay
    assert "of dog-pace, beside those of the plan" in section(page, "figure-3")
    button = re.search(r"<button[^>]*data-replay=\"0\".*?</button>", page, re.DOTALL)
    assert re.search(r"Go2, dog-trot return \d+ of 100, 1\.\d\d m/s$", text(button[0]))


def test_damaged_results_leave_an_older_page_alone(tmp_path, capsys):
    results = write_results(tmp_path / "results", tokenizer={"robots": {"go2": {}}})
    (tmp_path / "results" / "tracking-go2-generated.json").write_text('{"robot"')
    page = tmp_path / "page.html"
    page.write_text("older")
    line = ["report", "--results", str(results), "--html", str(page)]
    assert main(line) == 2
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 1
    assert "tracking-go2-generated.json is damaged" in printed.err
    assert page.read_text() == "older"
    assert {path.name for path in tmp_path.iterdir()} == {"results", "page.html"}
