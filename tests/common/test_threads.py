"""One thread in the library's own processes, and none of a user's is touched."""

import pytest
import torch

from loco_drake.common.determinism import single_thread
from tests.process import run_python

pytestmark = pytest.mark.slow

# Each prints the threads of torch and of numpy's library.
SHOW = """
import numpy as np, torch
from threadpoolctl import threadpool_info
def show(x=None):
    pools = {pool["num_threads"] for pool in threadpool_info()}
    return torch.get_num_threads(), max(pools)
def make():
    return show
def show_as(argument):
    return show
"""
SCRIPTS = {
    "a user's process that imports everything": (
        "import loco_drake.tracking.train, loco_drake.generation.train_tokenizer\n"
        "import loco_drake.systems.diagram, loco_drake.cli.main\n"
        "print(*show())",
        2,
    ),
    "a command": (
        "from loco_drake.cli.main import main\nmain(['data', 'list'])\nprint(*show())",
        1,
    ),
    "what a command imports later": (
        "import os\n"
        "from loco_drake.cli.main import main\nmain(['data', 'list'])\n"
        "print(*(os.environ[f'{x}_NUM_THREADS'] for x in ('OMP', 'OPENBLAS')))",
        1,
    ),
    "workers": (
        "from loco_drake.engine.local import Local\n"
        "print(*max(Local(2).map(make, range(4))))",
        1,
    ),
    "workers of a training": (
        "from loco_drake.engine.local import Local\n"
        "crew = Local().crew(show_as, [None])\n"
        "crew.send(0, None)\n"
        "print(*crew.receive(0))\n"
        "crew.close()",
        1,
    ),
}


@pytest.mark.parametrize("where", SCRIPTS)
def test_threads(where, tmp_path):
    """Of a machine that asks for two."""
    script, threads = SCRIPTS[where]
    guarded = script.replace("\n", "\n    ")
    (tmp_path / "script.py").write_text(
        f"{SHOW}if __name__ == '__main__':\n    {guarded}\n"
    )
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    two = dict.fromkeys(names, "2")
    printed = run_python("script.py", cwd=tmp_path, **two).splitlines()[-1]
    assert printed == f"{threads} {threads}"


def test_a_single_thread_is_given_back():
    threads = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        with single_thread():
            assert torch.get_num_threads() == 1
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(threads)
