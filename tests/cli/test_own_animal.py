"""A file of an animal that is in no part of the project, by YAML alone."""

import json
import re
import shlex
import shutil
from pathlib import Path

import pytest
import yaml

from loco_drake.cli.main import main
from loco_drake.models.robots import get_robot
from loco_drake.motion.gait_timing import gait_timing, motion_track
from loco_drake.motion.motion_file import load_motion
from tests.synthetic import write_dog_recording
from tests.synthetic_animals import (
    CAT,
    EXAMPLE,
    FAST,
    HORSE,
    SCHEDULE,
    write_bvh,
)

pytestmark = pytest.mark.usefixtures("only_known_sources")

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("animal", "gait", "heading"), [(CAT, "walk", 0.8), (HORSE, "trot", -2.0)]
)
def test_proposed_file_makes_go2_motion_with_the_numbers_it_was_made_of(
    animal, gait, heading, tmp_path, capsys
):
    """A cat in m, z up, and a horse in inches, y up: speed, period, feet and bounds."""
    bvh, file = tmp_path / "a.bvh", tmp_path / "animal.yaml"
    write_bvh(bvh, animal, heading=heading)
    assert main(["data", "inspect", str(bvh), "--skeleton", "--save", str(file)]) == 0
    if animal is HORSE:
        assert "1.5 m high in in" in file.read_text()
        file.write_text(file.read_text().replace("units: cm", "units: in"))
    lines = [x for x in file.read_text().splitlines() if not x.startswith("#")]
    assert len(lines) <= 20
    figures = tmp_path / "a.json"
    options = ["--source", str(file), "--gait", gait, "--out", str(tmp_path / "out")]
    assert (
        main(["retarget", str(bvh), *options, "--strict", "--json", str(figures)]) == 0
    )
    (report,) = json.loads(figures.read_text()).values()
    assert report["warnings"] == []  # inside all bounds of retargeting
    assert report["stance_slip_median_mps"] < 0.002
    assert report["penetration_max_m"] < 1e-4
    assert report["joint_limit_violations"] == 0
    assert report["joint_speed_ratio_max"] < 1
    go2 = get_robot("go2")
    scale = go2.stand_height / animal.height
    assert report["scale"] == pytest.approx(scale, rel=1e-3)

    motion = load_motion(Path(report["path"]))
    assert str(motion.label) == f"animal-{gait}"
    x, y, _ = (motion.base_position[-1] - motion.base_position[0]).T
    seconds = (len(motion) - 1) / motion.fps
    assert x / seconds == pytest.approx(scale * animal.gait.speed, rel=0.01)
    assert abs(y) < 0.01
    timing = gait_timing(motion_track(motion, go2))
    assert timing.stride_period == pytest.approx(animal.gait.period, rel=0.01)
    lags = (timing.phase_lags - animal.gait.lags + 0.5) % 1 - 0.5
    assert abs(lags).max() < 0.03
    soles = motion_track(motion, go2).soles
    assert (soles[:, 0::2, 1] > 0).all()
    assert (soles[:, 1::2, 1] < 0).all()


@pytest.mark.slow
def test_data_folder_and_worker_processes_know_the_source(tmp_path):
    """Rows of segments.csv in the folder named like the source."""
    for name in ("a", "b"):
        write_bvh(tmp_path / "cat" / f"{name}.bvh", CAT)
    rows = [f"cat,{name}.bvh,walk,0,401,100" for name in ("a", "b")]
    table = "\n".join(["dataset,file,gait,start_frame,end_frame,fps", *rows])
    (tmp_path / "segments.csv").write_text(table + "\n")
    file = tmp_path / "cat.yaml"
    command = f"data inspect {tmp_path}/cat/a.bvh --skeleton --save {file}"
    assert main(shlex.split(command)) == 0
    command = f"retarget --source {file} --gait walk --data-dir {tmp_path} --workers 2"
    assert main(shlex.split(f"{command} --trajectories 0 --out {tmp_path}/out")) == 0
    assert len(list((tmp_path / "out").glob("cat-walk-*.npz"))) == 2


def test_inspect_says_what_a_file_holds_and_proposes_yaml(tmp_path, capsys):
    write_bvh(tmp_path / "a.bvh", HORSE)
    command = ["data", "inspect", str(tmp_path / "a.bvh"), "--skeleton"]
    assert main([*command, "--json", str(tmp_path / "a.json")]) == 0
    printed = capsys.readouterr().out
    assert "a.bvh: BVH, 241 frames, 60 frames/s, 4.00 s, 18 joints and ends" in printed
    assert re.search(r"^Base  <- withers$", printed, re.M)
    assert re.search(r"^      End Site  <- FR$", printed, re.M)
    assert "Up axis: y" in printed
    assert "Stride period: 0.72 s" in printed
    figures = json.loads((tmp_path / "a.json").read_text())
    proposed = yaml.safe_load(printed[printed.index("# Check:") :])
    assert proposed == figures["skeleton"]
    assert len(figures["doubts"]) == 1


def test_inspect_proposes_cuts_in_table_picture_and_json(tmp_path, capsys):
    write_bvh(tmp_path / "a.bvh", EXAMPLE, 7.0, schedule=SCHEDULE)
    options = ["--source", str(ROOT / "examples" / "cat.yaml")]
    outputs = ["--save", str(tmp_path / "a.png"), "--json", str(tmp_path / "a.json")]
    assert main(["data", "inspect", str(tmp_path / "a.bvh"), *options, *outputs]) == 0
    printed = capsys.readouterr().out
    assert "It holds standing, walk, trot, and begins with" in printed
    cuts = json.loads((tmp_path / "a.json").read_text())["cuts"]
    assert [cut["guess"] for cut in cuts] == ["standing", "walk", "trot"]
    assert cuts[2]["stride_period_s"] == pytest.approx(FAST.period, rel=0.02)
    assert f"--start {cuts[1]['start']} --end {cuts[1]['end']}" in printed


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ("--source horse", "takes no --source, --start and --end"),
        ("--start 5", "takes no --source, --start and --end"),
        ("--save a.txt", "A skeleton's file ends in .yaml, unlike a.txt"),
        ("--fps 1", "1 frames/s is not plausible"),
    ],
)
def test_options_that_do_not_go_with_a_skeleton(
    options, reason, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    write_dog_recording(tmp_path / "dog.txt", seconds=1.0)
    assert main(["data", "inspect", "dog.txt", "--skeleton", *options.split()]) == 2
    assert reason in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["dog.txt"]


def test_dog_reader_points_to_the_skeleton_of_another_animal(tmp_path, capsys):
    write_bvh(tmp_path / "a.bvh", CAT, seconds=1.0)
    assert main(["data", "inspect", str(tmp_path / "a.bvh")]) == 2
    assert "data inspect FILE --skeleton proposes" in capsys.readouterr().err


def test_the_documentation_shows_the_example_file_and_the_cuts(tmp_path, capsys):
    page = (ROOT / "docs" / "own_animal.md").read_text()
    (block,) = re.findall(r"^```yaml\n(.*?)^```$", page, re.M | re.S)
    example = ROOT / "examples" / "cat.yaml"
    assert block == example.read_text()
    bvh, file = str(ROOT / "examples" / "cat.bvh"), tmp_path / "cat.yaml"
    assert main(["data", "inspect", bvh, "--skeleton", "--save", str(file)]) == 0
    assert file.read_text() == block.partition("\n")[2]  # behind a comment
    printed = {" ".join(line.split()) for line in capsys.readouterr().out.splitlines()}
    picture = str(tmp_path / "a.png")
    assert main(["data", "inspect", bvh, "--source", str(file), "--save", picture]) == 0
    printed |= {" ".join(line.split()) for line in capsys.readouterr().out.splitlines()}
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", page, re.M | re.S)
    shown = "".join(text for language, text in blocks if not language)
    lines = {" ".join(line.split()) for line in shown.splitlines()}
    assert len(lines) > 10
    assert {line for line in lines if line[0] not in "─."} <= printed


@pytest.mark.slow
def test_the_commands_of_the_documentation_run_as_written(tmp_path, monkeypatch):
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "own_animal.md").read_text()
    blocks = re.findall(r"^```sh\n(.*?)^```$", page, re.M | re.S)
    commands = [line for block in blocks for line in block.splitlines()]
    assert len(commands) == 4
    for command in commands:
        assert main(shlex.split(command)[1:]) == 0
    for name in ("cat.yaml", "cat.png", "cat.html"):
        assert Path(name).stat().st_size > 100


def test_the_example_is_what_its_generator_makes(tmp_path):
    write_bvh(tmp_path / "cat.bvh", EXAMPLE, 7.0, schedule=SCHEDULE)
    example = ROOT / "examples" / "cat.bvh"
    assert (tmp_path / "cat.bvh").read_text() == example.read_text()
