"""A tokenizer whose decoder learns on while its codes are held."""

import numpy as np
import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.generation.features import JOINTS
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.generation.motion_model import MotionModel
from loco_drake.generation.tokenizer import load_tokenizer
from loco_drake.generation.train_bodies import train_bodies
from loco_drake.generation.train_decoder import train_decoder
from loco_drake.generation.training_motions import (
    Library,
    read_training_record,
)
from loco_drake.models.robots import get_robot
from tests.generation.one_clip import clip
from tests.robot_files import OWN


@pytest.fixture(scope="module")
def library():
    return Library((clip(), clip(mirrored=True)), ())


@pytest.fixture(scope="module")
def tuned(library, base, tmp_path_factory):
    out = tmp_path_factory.mktemp("tuned")
    train_decoder(library, base, LoopSettings(out, 150, 1e-2, log_every=50))
    return out / "tokenizer.safetensors"


def test_codes_are_the_same_to_the_last_bit(library, base, tuned):
    before, after = load_tokenizer(base), load_tokenizer(tuned)
    kept = dict(after.state_dict())
    changed = {
        name.split(".")[0]
        for name, value in before.half().float().state_dict().items()
        if not torch.equal(kept[name], value)
    }
    assert "decoder" in changed
    assert changed <= {
        "decoder",
        "decoder_in",
        "decoder_out",
        "decoder_robot",
        "expand",
        "smooth",
    }


def test_the_generator_stays(model, base, tuned):
    """What it writes has the same codes, and is decoded otherwise."""
    tokenizer = load_tokenizer(tuned)
    assert tokenizer.fingerprint == model.tokenizer.fingerprint
    start = np.array([1])
    written = []
    for one in (load_tokenizer(base), tokenizer):
        writer = MotionModel(one, model.generator, "go2")
        written.append(writer.extend(writer.start(start), start))
    (first, before), (second, after) = written
    assert np.array_equal(first.tokens, second.tokens)
    assert np.isfinite(after.q).all()
    assert not np.array_equal(before.q, after.q)


def test_motion_is_decoded_better(library, base, tuned):
    target = torch.tensor(library.train[0].features[None, :100], dtype=torch.float32)
    robot = torch.tensor([0])
    errors = []
    for path in (base, tuned):
        tokenizer = load_tokenizer(path)
        output = tokenizer.decode(tokenizer.encode(target, robot), robot)
        errors.append((output - target)[..., JOINTS].square().mean().sqrt().item())
    assert errors[1] < 0.95 * errors[0]


def test_the_file_says_what_both_trainings_learned_from(tuned):
    recordings = read_training_record(tuned, "tokenizer")["recordings"]
    assert recordings["dog-other"] == {"go2": 3.0}
    assert len(recordings) == 2


def test_it_can_be_fine_tuned_again(library, model, tuned, tmp_path):
    again, _ = train_decoder(library, tuned, LoopSettings(tmp_path / "out", 2, 1e-3))
    assert again.fingerprint == model.tokenizer.fingerprint


def test_robots_must_be_known(base, tmp_path):
    get_robot(str(OWN["anymal"]))
    other = Library((clip("anymal"), clip("anymal", mirrored=True)), ())
    settings = LoopSettings(tmp_path / "out", 3, 1e-3)
    with pytest.raises(InputError, match="does not know anymal, but go2"):
        train_decoder(other, base, settings)
    assert not settings.out.exists()


def test_robots_that_were_added_would_be_decoded_otherwise(base, tmp_path):
    get_robot(str(OWN["anymal"]))
    both = Library(tuple(clip(r, m) for m in (0, 1) for r in ("go2", "anymal")), ())
    train_bodies(both, base, LoopSettings(tmp_path / "grown", 2, 1e-3))
    settings = LoopSettings(tmp_path / "out", 3, 1e-3)
    with pytest.raises(InputError, match="anymal was added to the tokenizer"):
        train_decoder(both, tmp_path / "grown" / "tokenizer.safetensors", settings)
    assert not settings.out.exists()
