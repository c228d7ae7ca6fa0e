"""Commands of the pages run as written, one page after another in an empty folder.

Commands that run are in blocks of ``sh``; those in blocks of ``console`` wait for
people, or take hours. A block of data that follows its name is written before.
"""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from loco_drake.cli.main import main

pytestmark = pytest.mark.usefixtures("only_known_sources")

ROOT = Path(__file__).parents[1]
# What each page makes, and how many commands that takes; own_animal has its own test.
PAGES = {
    "quick_start": (4, "pace.html turn.json walk.html"),
    "driving": (2, "a.drive drive.html figures.json"),
    "own_clip": (5, "motions/change play.html bow.html bow.json"),
    "own_robot": (5, "motions/b1 b1.json motions/cat b1.html"),
    "fine_tune": (3, "runs/try/policy.safetensors cat.json"),
    "train": (4, "motions/try runs/try/policy.safetensors"),
    "deploy": (2, "policy.onnx plans.npz go2.xml"),
}
_DATA = r"`(\S+)`:\n\n```csv\n(.*?)^```$"


def commands(text):
    blocks = re.findall(r"^```sh\n(.*?)^```$", text, re.M | re.S)
    return [line for block in blocks for line in block.splitlines()]


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_commands_of_a_page_run_as_written(page, tmp_path, monkeypatch):
    if page == "deploy":
        pytest.importorskip("onnx", reason="needs the extra 'onnx'")
        pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")
    text = (ROOT / "docs" / f"{page}.md").read_text()
    count, made = PAGES[page]
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    # As in a clone, where the examples' weights are.
    (tmp_path / "loco_drake").symlink_to(ROOT / "loco_drake")
    monkeypatch.chdir(tmp_path)
    for name, data in re.findall(_DATA, text, re.M | re.S):
        Path(name).write_text(data)
    assert len(commands(text)) == count
    for command in commands(text):
        program, *arguments = shlex.split(command)
        if program == "python":
            run = subprocess.run(
                [sys.executable, *arguments],
                env={"PYTHONPATH": str(ROOT), "LOCO_DRAKE_CACHE": str(tmp_path)},
                check=False,
            )
            assert run.returncode == 0, command
        else:
            assert program == "loco-drake"
            assert main(arguments) == 0, command
    assert [name for name in made.split() if not Path(name).exists()] == []


def test_the_page_of_every_want_is_named_in_the_readme():
    readme = (ROOT / "README.md").read_text()
    for page in (*PAGES, "own_animal", "concepts", "results", "support"):
        assert f"(docs/{page}.md)" in readme, page
