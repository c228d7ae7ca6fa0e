import json
import resource
import subprocess
import sys

import pytest

from loco_drake.cli.main import main
from loco_drake.control.actor_file import load_actor
from loco_drake.models.robots import get_robot

TEXT = """
robot: go2
environments: 2
references: {trot: {labels: [dog-trot], count: 200, seconds: 3}}
common: {ppo: {batch: 64, minibatch: 32, hidden: [16]}}
stages: [{name: one, steps: 6400}, {name: two, steps: 6400}]
evaluation: null
"""


@pytest.fixture
def recipe(tmp_path):
    path = tmp_path / "tiny.yaml"
    path.write_text(TEXT)
    return path


def train(*options):
    return main(["train", "recipe", *map(str, options)])


@pytest.mark.slow
def test_a_recipe_is_tried_at_a_small_scale(recipe, tmp_path, capsys):
    """One hundredth: two motions and a batch for each stage; then nothing is left."""
    out, figures = tmp_path / "run", tmp_path / "figures.json"
    options = ("--scale", 0.01, "--seed", 3, "--workers", 1, "--json", figures)
    assert train("--recipe", recipe, "--out", out, *options) == 0
    assert "128" in capsys.readouterr().out
    written = json.loads(figures.read_text())
    assert (written["robot"], written["steps"]) == ("go2", 128)
    assert load_actor(out / "policy.safetensors", get_robot("go2"))
    assert len(list(out.rglob("*.npz"))) == 2
    assert "seed: 3" in (out / "recipe.yaml").read_text()
    assert train("--out", out, "--resume", "--workers", 2) == 0
    again = ("--recipe", recipe, "--scale", 0.01)
    assert train(*again, "--out", out, "--resume") == 2
    assert "follows a recipe with other seed;" in capsys.readouterr().err


@pytest.mark.slow
def test_a_full_disk_is_one_sentence_and_it_goes_on(recipe, tmp_path):
    """No file may be larger than the first motion is: less than a checkpoint."""
    code = "from loco_drake.cli.main import main; raise SystemExit(main())"
    out = tmp_path / "run"
    options = ["--recipe", recipe, "--scale", "0.01", "--workers", "1", "--out", out]
    for limit in (2_000, 60_000):
        process = subprocess.run(
            [sys.executable, "-c", code, "train", "recipe", *map(str, options)],
            capture_output=True,
            text=True,
            check=False,
            preexec_fn=lambda limit=limit: resource.setrlimit(
                resource.RLIMIT_FSIZE, (limit, limit)
            ),
        )
        assert process.returncode == 1, process.stderr
        assert "File too large" in process.stderr
        assert len(process.stderr.splitlines()) == 1
        assert not list(out.rglob("policy.safetensors"))
        options = ["--resume", "--workers", "1", "--out", out]
    assert train("--resume", "--out", out) == 0
    assert load_actor(out / "policy.safetensors", get_robot("go2"))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("", "--recipe must name"),
        ("--recipe go3", "a shipped recipe: a1, go2"),
        ("--recipe go2 --workers 0", "--workers must be 1 or more"),
        ("--recipe go2 --workers 7", "--workers must divide"),
        ("--recipe go2 --scale 0", "--scale must be above 0 and at most 1"),
        ("--recipe go2 --seed -1", "--seed must be 0 or more"),
        ("--resume", "There is no recipe to resume in"),
        ("--resume --seed 2", "--seed and --scale go with --recipe"),
    ],
)
def test_bad_options_are_one_sentence(options, said, tmp_path, capsys):
    out = tmp_path / "run"
    assert train(*options.split(), "--out", out) == 2
    error = capsys.readouterr().err.strip()
    assert said in error
    assert len(error.splitlines()) == 1
    assert not out.exists()
