"""The contract of the command line: what it refuses, how, and with which status."""

import json
import os
import re
import stat
from itertools import pairwise

import numpy as np
import pytest
import torch

from loco_drake import __version__
from loco_drake.cli.main import _COMMANDS, main
from loco_drake.common.weights import save_network
from loco_drake.control.actor import Actor, ActorConfig
from loco_drake.control.actor_file import save_actor
from loco_drake.models.shipped import pretrained_path
from loco_drake.motion.gaits import LABELS
from loco_drake.motion.motion_file import save_motion
from tests.synthetic_motion import synthetic_motion
from tests.tiny_model import make_tiny_model


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Files that are wrong, each in its own way."""
    folder = tmp_path_factory.mktemp("files")
    (folder / "text.npz").write_text("not an archive")
    (folder / "empty").mkdir()
    (folder / "results").mkdir()
    (folder / "results" / "tokenizer.json").write_text('{"robots": {"go2": ')
    motion = synthetic_motion(seconds=0.5)
    whole = folder / "motions" / "whole.npz"
    save_motion(motion, whole)
    with np.load(whole) as archive:
        arrays = dict(archive)
    header = json.loads(str(arrays["header"]))

    def write(name, **changes):
        np.savez(folder / name, **{**arrays, **changes})

    def with_header(**changes):
        changes = {"content_sha256": None, **changes}
        return json.dumps({k: v for k, v in {**header, **changes}.items() if v})

    nan = arrays["base_position"].copy()
    nan[3, 1] = np.nan
    write("nan.npz", base_position=nan)
    write("joints.npz", joint_positions=arrays["joint_positions"][:, :8])
    write("no_rate.npz", header=with_header(fps=None))
    write("future.npz", header=with_header(schema_version=99))
    save_motion(synthetic_motion(seconds=0.5, name="a1"), folder / "a1.npz")
    write("as_a1.npz", header=with_header(robot="a1"))

    policy = folder / "policy.safetensors"
    save_policy(policy, "go2")
    save_policy(folder / "policy_of_a1.safetensors", "a1")
    (folder / "cut.safetensors").write_bytes(policy.read_bytes()[:-100])
    tokenizer = pretrained_path("tokenizer").read_bytes()
    (folder / "cut_tokenizer.safetensors").write_bytes(tokenizer[:-100])
    newer = tokenizer.replace(b'\\"format_version\\": 1', b'\\"format_version\\": 2')
    (folder / "next_tokenizer.safetensors").write_bytes(newer)
    other = folder / "other_tokenizer.safetensors"
    save_network(other, "tokenizer", make_tiny_model().tokenizer, half=True)
    return folder


def save_policy(path, robot):
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        save_actor(Actor(ActorConfig(robot=robot, labels=["dog-trot"])), path)


GAITS = ", ".join(str(label) for label in LABELS)
DURATION = "The duration must be above 0"

# Arguments, in which FILES/ stands for the folder above, and what is said of them.
WRONG = {
    "fly": "Unknown command 'fly'; the choices are simulate, drive, .*train tracker",
    "train": "Name a subcommand: train tokenizer, train generator, train tracker",
    "train fly": "'train fly'; the choices are train tokenizer, train generator",
    "data": "Name a subcommand: data list, data fetch, data inspect",
    "simulate --robot spot": "Unknown robot 'spot'; the choices are go2, a1",
    "simulate --gait dog-fly": f"Unknown gait 'dog-fly'; the choices are any, {GAITS}",
    "simulate --gait dog-pace,dog-trot": "the time in s at which it begins",
    "simulate --gait dog-pace,dog-trot@12": "before the end, at 10 s",
    "simulate --duration 0": DURATION,
    "simulate --duration -1": DURATION,
    "simulate --duration nan": DURATION,
    "simulate --duration inf": DURATION,
    "simulate --duration 1e9": DURATION,
    "simulate --seed -1": "The seed must be 0 or more, not -1",
    "simulate --contact tamsi": "'tamsi'; the choices are similar, lagged, sap, cenic",
    "simulate --time-step 0": "time_step must be a number from 1e-05 to 0.05, not",
    "simulate --friction nan": "friction must be a number from 1e-06 to 1000, not",
    "simulate --port 80 --meshcat": "The port must be from 1024 to 65535, not 80",
    "simulate --reference FILES/none.npz": "must be generated or a Motion file",
    "simulate --reference FILES/text.npz": "is not a Motion file",
    "simulate --reference FILES/nan.npz": "base_position of this motion hold NaN",
    "simulate --reference FILES/joints.npz": r"must have shape \(26, 12\), not",
    "simulate --reference FILES/no_rate.npz": "lacks fps",
    "simulate --reference FILES/future.npz": "has Motion schema 99",
    "simulate --reference FILES/a1.npz": "is a motion of a1, not of go2",
    "simulate --reference FILES/as_a1.npz": "feet move as those of go2, not a1",
    "simulate --policy FILES/none.safetensors": "There are no policy weights at",
    "simulate --policy FILES/cut.safetensors": "cut.safetensors is damaged",
    "simulate --policy FILES/cut_tokenizer.safetensors": "is damaged",
    "simulate --policy FILES/policy_of_a1.safetensors": "another robot: a1, not go2",
    "export --robot spot": "Unknown robot 'spot'; the choices are go2, a1",
    "export --onnx policy.txt": "--onnx must end in .onnx, not 'policy.txt'",
    "export --mjcf go2.urdf": "--mjcf must end in .xml, not 'go2.urdf'",
    "export --mjcf go2.xml --policy robust": "are of a policy: add --onnx",
    "export --plans plans.csv": "--plans must end in .npz, not 'plans.csv'",
    "export --plans a.npz --json b.json": "are of a policy: add --onnx",
    "export --gait dog-trot": "are of a plan: add --plans",
    "export --plans a.npz --gait fly": f"Unknown gait 'fly'; the choices are {GAITS}",
    "export --plans a.npz --gait dog-pace,dog-trot@12": "before the end, at 10 s",
    "export --plans a.npz --duration 0": DURATION,
    "export --plans a.npz --duration nan": DURATION,
    "export --plans a.npz --duration 7200": "above 0 and at most 600 s, not 7200",
    "export --plans a.npz --seed -1": "--seed must be 0 or more, not -1",
    "export --policy FILES/none.safetensors": "There are no policy weights at",
    "export --robot go2 --policy robust": "no shipped policy of go2 has that name",
    "export --policy FILES/policy_of_a1.safetensors": "another robot: a1, not go2",
    "generate --robot spot": "Unknown robot 'spot'; the choices are go2, a1",
    "generate --gait fly": f"Unknown gait 'fly'; the choices are {GAITS}",
    "generate --gait dog-pace,fly@2": f"Unknown gait 'fly'; the choices are {GAITS}",
    "generate --gait dog-pace,dog-trot": "the time in s at which it begins, such as",
    "generate --gait dog-pace,dog-trot@4,dog-pace@2": "rising times above 0 s",
    "generate --gait dog-pace,dog-trot@12": "before the end, at 10 s",
    "generate --duration nan": DURATION,
    "generate --duration 0": DURATION,
    "generate --duration -2": DURATION,
    "generate --duration 0.01": "The duration must be 0.04 s or more, not 0.01",
    "generate --duration 7200": "above 0 and at most 600 s, not 7200",
    "generate --temperature -1": "temperature must be 0 or more",
    "generate --top-p 0": "top_p must be above 0 and at most 1",
    "generate --count 0": "--count must be 1 or more, not 0",
    "generate --seed -1": "--seed must be 0 or more, not -1",
    "generate --tokenizer FILES/cut_tokenizer.safetensors": "is damaged",
    "generate --tokenizer FILES/policy.safetensors": "holds policy weights",
    "generate --tokenizer FILES/other_tokenizer.safetensors": "are for the tokenizer",
    "generate --tokenizer FILES/next_tokenizer.safetensors": "format 2; .* reads 1",
    "generate --generator FILES/none.safetensors": "There are no generator weights at",
    "evaluate tokenizer --robot spot": "'spot'; the choices are go2, a1, all",
    "evaluate tokenizer --labels fly": f"Unknown gait 'fly'; the choices are {GAITS}",
    "evaluate tokenizer --data-dir FILES/none": "There is no data folder",
    "evaluate tokenizer --seeds 0": "--seeds must be 1 or more, not 0",
    "evaluate tokenizer --data-dir FILES/motions --books 99": "from 1 to",
    "evaluate generation --robot spot": "'spot'; the choices are go2, a1, all",
    "evaluate generation --labels fly": f"Unknown gait 'fly'; the choices are {GAITS}",
    "evaluate generation --trajectories 0": "--trajectories must be 1 or more, not 0",
    "evaluate generation --minutes -1": "--minutes must be 0 or more, not -1",
    "evaluate generation --data-dir FILES/none": "There is no data folder",
    "evaluate generation --data-dir FILES/empty --motions FILES/empty": "Motion files",
    "retarget --robot spot": "Unknown robot 'spot'; the choices are go2, a1",
    "retarget --source cat": "Unknown source 'cat'; the choices are dog",
    "retarget --workers 0": "--workers must be 1 or more, not 0",
    "retarget --trajectories -1": "--trajectories must be 0 or more, not -1",
    "evaluate retargeting --robot spot": "'spot'; the choices are go2, a1, all",
    "evaluate retargeting --workers 0": "--workers must be 1 or more, not 0",
    "evaluate tracking --robot spot": "'spot'; the choices are go2, a1, all",
    "evaluate tracking --reference own": "the choices are generated, retargeted",
    "evaluate tracking --workers 0": "--workers must be 1 or more, not 0",
    "retarget --data-dir FILES/none": "There is no data folder .*LOCO_DRAKE_DATA",
    "data list --data-dir FILES/none": "There is no data folder .*LOCO_DRAKE_DATA",
    "data fetch --source cat": "Unknown source 'cat'; the choices are dog",
    "data fetch --source dog cat": "Unknown source 'cat'; the choices are dog",
    "data fetch --from FILES/none": "no mirror folder .* a folder, or an address",
    "data fetch --data-dir FILES/text.npz": "is a file, not a folder",
    "data inspect FILES/none.txt": "There is no file",
    "data inspect FILES/none.txt --source cat": "'cat'; the choices are dog",
    "data pack --motions FILES/none": "There is no folder of Motion files",
    "data pack --motions FILES/empty": r"no Motion files \(\*.npz\) in",
    "data pack --motions FILES/motions --resume": "nothing to resume .* leave out",
    "data pack --motions FILES/motions FILES/motions": "Two folders are called 'mot",
    "train tokenizer --motions FILES/empty": r"no Motion files",
    "train tokenizer --motions FILES/none": "There is no folder of Motion files",
    "train tokenizer --steps 0": "--steps must be 1 or more, not 0",
    "train generator --motions FILES/empty": "no Motion files",
    "train generator --stitched 0": "--stitched must be 1 or more, not 0",
    "train classifier --motions FILES/empty": "Motion files",
    "train generator --motions FILES/motions --tokenizer FILES/no": "no tokenizer",
    "train tracker --motions FILES/empty": r"no Motion files \(\*.npz\)",
    "report --results FILES/none": "There is no folder of results .*generation.json",
    "report --results FILES/empty": "no results in .*one or more of retargeting.json",
    "report --results FILES/results": "tokenizer.json is damaged: it is not JSON",
    "report --labels dog-fly": f"Unknown gait 'dog-fly'; the choices are {GAITS}",
    "report --labels none dog-trot": "none, or gait labels, not both",
    "report --duration 0": DURATION,
    "report --seed -1": "--seed must be 0 or more, not -1",
    "train tracker --motions FILES/empty --robot spot": "the choices are go2, a1",
    "train tracker --motions FILES/empty --minibatch 0": "--minibatch must be",
    "train tracker --motions FILES/empty --batch 9": "--batch must be at least 32",
    "train tracker --motions FILES/empty --steps 0": "--steps must be 1 or more",
    "train tracker --motions FILES/empty --termination.position 0": (
        "position must be above 0, not 0"
    ),
    "train tracker --motions FILES/empty --homing=-1": (
        "--position-penalty must be 0 or more, not -1"
    ),
    "train tracker --motions FILES/empty --fall-cost=-2": (
        "--fall-cost must be 0 or more, not -2"
    ),
}


@pytest.mark.parametrize("line", WRONG)
def test_wrong_input_is_one_sentence_and_status_2(
    line, files, tmp_path, monkeypatch, capsys
):
    """Nothing else is printed, and nothing is left on disk."""
    monkeypatch.chdir(tmp_path)
    arguments = line.replace("FILES", str(files)).split()
    if arguments[0] == "simulate" and "--meshcat" not in arguments:
        arguments.append("--no-meshcat")
    if " ".join(arguments[:2]) in _COMMANDS or arguments[0] in _COMMANDS:
        arguments += ["--json", "figures.json"]
    assert main(arguments) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert re.fullmatch(r"loco-drake: [^\n]+\.\n", printed.err), printed.err
    assert re.search(WRONG[line], printed.err), printed.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "line", ["simulate --walk", "simulate --duration x", "generate --count 1.5"]
)
def test_options_that_cannot_be_read_are_status_2(line, capsys):
    with pytest.raises(SystemExit) as exit_info:
        main(line.split())
    assert exit_info.value.code == 2
    assert line.split()[1] in capsys.readouterr().err


def test_help_lists_every_command_and_version_is_the_package_s(capsys):
    assert main([]) == main(["--help"]) == 0
    printed = capsys.readouterr().out
    assert all(printed.count(f"loco-drake {name} ") == 2 for name in _COMMANDS)
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"{__version__}\n"


def test_help_of_a_group_lists_its_commands_only(capsys):
    assert main(["train", "--help"]) == 0
    printed = capsys.readouterr().out
    assert "train tracker" in printed
    assert "loco-drake simulate" not in printed


@pytest.mark.parametrize("name", _COMMANDS)
def test_help_of_each_command_has_seed_and_json(name, capsys):
    with pytest.raises(SystemExit) as exit_info:
        main([*name.split(), "--help"])
    assert exit_info.value.code == 0
    printed = capsys.readouterr().out
    for option in ("--seed INT", "--json"):
        assert option in printed


@pytest.mark.parametrize("name", _COMMANDS)
def test_help_of_each_option_is_one_paragraph(name, capsys, monkeypatch):
    """A line ends only where the first word of the next has no place."""
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit):
        main([*name.split(), "--help"])
    printed = capsys.readouterr().out
    options = printed[printed.index(" options  ") :].splitlines()
    lines = [line.rstrip() for line in options if line.startswith("  ")]
    assert len(lines) > 4
    for line, after in pairwise(lines):
        only_a_name = line.strip().startswith("-") and "  " not in line.strip()
        if after.startswith(" " * 10) and not only_a_name:
            assert len(line) + 1 + len(after.split()[0]) > 78, line


def test_help_of_simulate_has_units_and_defaults(capsys):
    with pytest.raises(SystemExit):
        main(["simulate", "--help"])
    # Each option with what is said of it, on one line.
    printed = re.sub(r"[\s│]+", " ", capsys.readouterr().out)
    assert re.search(
        r"--robot ROBOT.FILE [^(]*go2, a1, or[^(]* \(default: go2\)", printed
    )
    assert re.search(r"--gait GAIT [^(]* \(default: dog-trot\)", printed)
    assert re.search(r"--duration FLOAT Duration in s[^(]* \(default: 10.0\)", printed)
    assert re.search(r"--time-step FLOAT [^(]*, s. \(default: 0.01\)", printed)


def test_a_file_that_cannot_be_written_is_status_2(made_data, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    target = str(tmp_path / "file" / "a.json")
    assert main(["data", "list", "--data-dir", str(made_data), "--json", target]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""  # found out before the work
    assert printed.err == (
        f"loco-drake: {target!r} cannot be written: Not a folder: "
        f"{tmp_path / 'file'}.\n"
    )


@pytest.mark.parametrize(
    "line",
    [
        "data list --json FOLDER",
        "simulate --html FOLDER",
        "export --onnx FOLDER",
        "export --plans FOLDER",
        "report --html FOLDER",
    ],
)
def test_a_folder_where_a_file_is_to_be_written_is_status_2(line, tmp_path, capsys):
    assert main(line.replace("FOLDER", str(tmp_path)).split()) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "is a folder, not a file to be written" in printed.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("option", ["--out", "--json"])
def test_a_file_where_a_folder_is_needed_is_status_2_before_the_work(
    option, tmp_path, capsys
):
    (tmp_path / "file").write_text("kept")
    arguments = f"generate {option} {tmp_path / 'file' / 'a'}"
    assert main(arguments.split()) == 2
    assert "Not a folder" in capsys.readouterr().err
    assert (tmp_path / "file").read_text() == "kept"


def test_figures_can_go_to_a_device(made_data, capsys):
    """As root, replacing /dev/null by a file would break the machine."""
    device = "/dev/null"
    assert main(["data", "list", "--data-dir", str(made_data), "--json", device]) == 0
    assert stat.S_ISCHR(os.stat(device).st_mode)


def test_ctrl_c_is_status_1_without_traceback(monkeypatch, tmp_path, capsys):
    def interrupt(self):
        raise KeyboardInterrupt

    monkeypatch.setattr("loco_drake.cli.data.DataList.run", interrupt)
    assert main(["data", "list"]) == 1
    assert capsys.readouterr().err == "loco-drake: interrupted\n"
