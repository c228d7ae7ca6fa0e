"""One vocabulary of options over all commands, and help that a newcomer can use.

Both are read off the help that is printed.
"""

import io
import re
from contextlib import redirect_stdout
from typing import NamedTuple

import pytest

from loco_drake.cli.main import _COMMANDS, command_class, main
from loco_drake.cli.options import outputs
from loco_drake.cli.parsing import FORMER, parse
from loco_drake.datasets.registry import DATASETS
from loco_drake.evaluation.disturbances import KINDS as DISTURBANCES
from loco_drake.models.plant import CONTACTS
from loco_drake.models.robots import ROBOTS
from loco_drake.models.shipped import shipped_policies
from loco_drake.motion.gaits import GAITS, LABELS

# What values are, besides numbers; never a type of Python.
KINDS = ["FILE", "DIR", "URL", "ROBOT", "GAIT", "LABEL", "SOURCE", "NAME", "POLICY"]
KINDS += ["TEXT", "VX", "VY", "WZ", "LOW", "HIGH", "INT", "FLOAT"]
# What a required argument may be, so that a command gets as far as its outputs.
REQUIRED = {"record": ["--motions", "a"], "data inspect": ["a.bvh"]}
REQUIRED["robot inspect"] = ["a.yaml"]
OUTPUT = re.compile(r"\bto write\b|^Folder for pictures\b")


class Option(NamedTuple):
    """An option as the help of a command shows it."""

    name: str  # with its dashes
    kind: str  # of its value; empty for a flag
    text: str

    @property
    def head(self):
        """The words with which its text begins in every command."""
        return re.split(r"[.:;](?:\s|$)", self.text)[0]


@pytest.fixture(scope="module")
def pages():
    """The help of each command."""
    printed = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "80")
        for name in _COMMANDS:
            # Such as a terminal, which can show the frames around the options.
            page = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
            with redirect_stdout(page), pytest.raises(SystemExit):
                main([*name.split(), "--help"])
            page.seek(0)
            printed[name] = page.read()
    return printed


@pytest.fixture(scope="module")
def options(pages):
    """The options of each command."""
    return {name: read_options(page) for name, page in pages.items()}


def read_options(page):
    """Returns the options of a page: "│ --name KIND   text │", and further lines."""
    rows = []
    for line in page.splitlines():
        if line.startswith("│ --"):
            rows.append([line.strip("│")])
        elif rows and line.startswith("│   "):
            rows[-1].append(line.strip("│"))
    found = []
    for first, *more in rows:
        names, _, text = first.strip().partition("  ")
        flags = re.findall(r"--\S+?(?=[ ,]|$)", names)
        kind = "" if len(flags) > 1 else names.removeprefix(flags[0]).strip()
        told = " ".join(part.strip() for part in (text, *more))
        found.append(Option(flags[0], kind, told.strip()))
    return found


def test_a_name_means_one_thing_in_all_commands(options):
    first = {}
    for command, listed in options.items():
        assert len(listed) > 1
        for option in listed:
            of, known = first.setdefault(option.name, (command, option))
            where = f"{option.name} of {command} and of {of}"
            kinds = [
                set(of.removesuffix(" ...").split("|"))
                for of in (option.kind, known.kind)
            ]
            assert kinds[0] <= kinds[1] or kinds[0] >= kinds[1], where
            assert option.head == known.head, where
    assert len(first) > 100


def test_one_thing_has_one_name(options):
    """Such as an output: folders of motion files, pictures and runs have one each."""
    names = {}
    for listed in options.values():
        for option in listed:
            names.setdefault(option.head, set()).add(option.name)
    several = {head: found for head, found in names.items() if len(found) > 1}
    # The world of a training has its options in groups.
    assert {h: f for h, f in several.items() if not any("." in n for n in f)} == {}


def test_values_are_told_by_what_they_are(options):
    for command, listed in options.items():
        for option in listed:
            words = re.findall(r"[A-Z]+", option.kind)
            # Those of a group are fields of a class of the library.
            assert "." in option.name or set(words) <= set(KINDS), (command, option)


def test_help_shows_no_internals(pages):
    for name, page in pages.items():
        for internal in ("None", "loco_drake.", "{", "Path(", "(default: )", "PATH"):
            assert internal not in page.replace("{accuracy", ""), (name, internal)


def test_help_lists_the_choices(options):
    labels = [str(label) for label in LABELS]
    variants = {name.partition("_")[2] for name in shipped_policies()} - {""}
    choices = {
        "--robot": ROBOTS,
        "--gait": labels,
        "--labels": labels,
        "--policy": variants,
        "--source": DATASETS,
        "--contact": CONTACTS,
        "--plant.contact": CONTACTS,
        "--kinds": DISTURBANCES,
        "--teacher": shipped_policies(),
        "--start-from": shipped_policies(),
        "--simulator": ("drake", "mujoco"),
    }
    listed = 0
    for command, of_command in options.items():
        for option in of_command:
            wanted = choices.get(option.name, ())
            if (command, option.name) == ("retarget", "--gait"):
                wanted = GAITS
            told = set(re.findall(r"[\w-]+", option.text))
            assert set(wanted) <= told, (command, option.name)
            listed += bool(wanted)
    assert listed > 40


@pytest.mark.parametrize("name", _COMMANDS)
def test_outputs_are_checked_before_the_work(
    name, options, tmp_path, monkeypatch, capsys
):
    """Each option that names one, whether a file or a folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("kept")
    made = parse(command_class(name), name, REQUIRED.get(name, []))
    writing = [option.name for option in options[name] if OUTPUT.search(option.text)]
    assert len(writing) == len(outputs(type(made))) > 0
    monkeypatch.setattr(type(made), "run", lambda self: pytest.fail("it worked"))
    for option in writing:
        line = [*name.split(), *REQUIRED.get(name, []), option, "file/deep/a"]
        assert main(line) == 2, option
        printed = capsys.readouterr()
        assert printed.out == ""
        assert printed.err == (
            "loco-drake: 'file/deep/a' cannot be written: Not a folder: "
            f"{tmp_path / 'file'}.\n"
        )
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "kept"


@pytest.mark.parametrize("name", FORMER)
def test_former_names_stay_valid_and_are_in_no_help(name, options, pages):
    values = {"INT": ["3"], "FLOAT": ["0.5"], "": []}
    kinds = {option.name: option.kind for option in options[name]}
    for former, present in FORMER[name].items():
        kind = kinds[present.replace("--no-", "--")]
        value = values.get(kind, ["dog-trot"])
        former_line = parse_line(name, former, value)
        assert former_line == parse_line(name, present, value)
        # The command draws --keypoints or not, by whichever comes last.
        if not former.startswith("--no-"):
            assert former_line != parse_line(name, "", [])
        assert f"{former} " not in pages[name]
        if value:
            assert parse_line(name, f"{former}={value[0]}", []) == former_line


def parse_line(name, option, value):
    line = REQUIRED.get(name, []) if option != "--references" else []
    if option.startswith("--no-"):
        line = [*line, option.replace("--no-", "--")]
    return parse(command_class(name), name, [*line, *filter(None, [option]), *value])
