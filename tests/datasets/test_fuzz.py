"""Damaged files and files of other sources: one sentence, whatever is wrong."""

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.registry import DATASETS, read_clip
from tests.spoil import spoil
from tests.synthetic import write_dog_recording
from tests.synthetic_bvh import write_dog_bvh
from tests.synthetic_horse import (
    make_horse,
    write_raw_recording,
    write_world_recording,
)
from tests.synthetic_robots import write_mpc_recording, write_solo8_recording

WAYS = ["empty", "blank", "cut within a line", "cut within a number", "nan"]
WAYS += ["infinity", "words", "column missing", "blank line", "shuffled"]
WAYS += ["centimetres", "binary", "zeros"]
FORMATS = ["semicolons", "spaces", "tabs", "utf-16"]


def write(form, path):
    """Writes a recording in one of the six forms; returns its source."""
    match form:
        case "dog":
            write_dog_recording(path, seconds=2.0)
        case "bvh":
            write_dog_bvh(path, seconds=1.0)
        case "horse":
            write_world_recording(path, make_horse("trot", 60.0, 3.0))
        case "raw horse":
            write_raw_recording(path, make_horse("walk", 60.0, 4.0))
        case "mpc":
            write_mpc_recording(path, "trot", seconds=2.0)
        case "solo8":
            write_solo8_recording(path)
    return {"bvh": "dog", "raw horse": "horse"}.get(form, form)


FORMS = ["dog", "bvh", "horse", "raw horse", "mpc", "solo8"]


def assert_one_sentence(error, path):
    message = str(error.value)
    assert str(path) in message
    assert message.endswith(".")
    assert "\n" not in message
    assert len(message) < 500


# What does no harm there, or strikes the header, which test_bvh and test_horse spoil.
HARMLESS = {
    "bvh": {"blank line"},
    "raw horse": {"nan"},
}
HEADER = {"nan", "infinity", "words", "column missing", "centimetres"}
CASES = [
    (form, how)
    for form in FORMS
    for how in WAYS
    if how not in HARMLESS.get(form, ())
    and not (form in ("bvh", "raw horse") and how in HEADER)
]


@pytest.mark.parametrize(("form", "how"), CASES)
def test_spoilt_file_is_refused_in_one_sentence(tmp_path, form, how):
    path = tmp_path / "recording"
    source = write(form, path)
    path.write_bytes(spoil(path.read_text(), how))
    with pytest.raises(InputError) as error:
        read_clip(source, path, gait="trot")
    assert_one_sentence(error, path)


@pytest.mark.parametrize("how", FORMATS)
@pytest.mark.parametrize("form", ["dog", "horse", "mpc", "solo8"])
def test_table_of_another_format_reads_the_same(tmp_path, form, how):
    path = tmp_path / "recording"
    source = write(form, path)
    right = read_clip(source, path, gait="trot")
    path.write_bytes(spoil(path.read_text(), how))
    clip = read_clip(source, path, gait="trot")
    np.testing.assert_array_equal(clip.toes, right.toes)


@pytest.mark.parametrize("form", FORMS)
def test_number_damaged_anywhere_is_refused_or_does_no_harm(tmp_path, form):
    """A digit, sign, point or exponent: no point is off by a fifth of the body."""
    path = tmp_path / "recording"
    source = write(form, path)
    whole = path.read_text()
    right = read_clip(source, path, gait="trot")
    size = max(right.withers[0, 2], np.linalg.norm(right.withers[0] - right.hip[0]))
    start = whole.index("\n", whole.find("Frame Time")) if form == "bvh" else 0
    rng = np.random.default_rng(7)
    digits = [k for k in range(start, len(whole)) if whole[k].isdigit()]
    outcomes = {"read": 0, "refused": 0}
    for _ in range(60):
        k = int(rng.choice(digits))
        new = (str(rng.integers(10)), f"{whole[k]}e{rng.integers(-3, 9)}", "-", "")
        damaged = whole[:k] + new[int(rng.integers(4))] + whole[k + 1 :]
        path.write_text(damaged)
        try:
            clip = read_clip(source, path, gait="trot")
        except InputError:
            outcomes["refused"] += 1
        else:
            assert clip.fps == right.fps
            assert len(clip) == len(right)
            for name in ("withers", "hip", "toes"):
                off = np.abs(getattr(clip, name) - getattr(right, name)).max()
                assert off < 0.2 * size, damaged[k - 20 : k + 20]
            outcomes["read"] += 1
    assert min(outcomes.values()) > 3


@pytest.mark.parametrize("form", FORMS)
def test_files_cut_or_changed_anywhere_are_read_or_refused(tmp_path, form):
    """Cut, a byte replaced, a block left out or doubled: a clip, or one sentence."""
    path = tmp_path / "recording"
    source = write(form, path)
    whole = path.read_bytes()
    rng = np.random.default_rng(5)
    outcomes = {"read": 0, "refused": 0}
    for _ in range(40):
        a, b = sorted(int(k) for k in rng.integers(0, len(whole), 2))
        byte = bytes([int(rng.integers(0, 256))])
        changed = (
            whole[:a],
            whole[:a] + byte + whole[a + 1 :],
            whole[:a] + whole[b:],
            whole[:b] + whole[a:],
        )[int(rng.integers(0, 4))]
        path.write_bytes(changed)
        try:
            clip = read_clip(source, path, gait="trot")
        except InputError:
            outcomes["refused"] += 1
        else:
            assert np.isfinite(clip.toes).all()
            outcomes["read"] += 1
    assert outcomes["refused"] > 10


@pytest.mark.parametrize("form", FORMS)
def test_file_of_another_source_is_refused_with_the_reason(tmp_path, form):
    path = tmp_path / "recording"
    own = write(form, path)
    for source in DATASETS:
        if source == own:
            assert read_clip(source, path, gait="trot").source == own
            continue
        with pytest.raises(
            InputError, match=r"cannot be read as a recording of \w+: "
        ) as error:
            read_clip(source, path, gait="trot")
        assert_one_sentence(error, path)


@pytest.mark.parametrize("source", DATASETS)
def test_huge_missing_and_unreadable_files_are_refused(tmp_path, source):
    with (tmp_path / "huge").open("wb") as file:
        file.truncate(10**12)  # sparse
    for path, reason in (
        (tmp_path / "huge", "larger than 50 MB"),
        (tmp_path / "none", "There is no file"),
        (tmp_path, "There is no file"),
    ):
        with pytest.raises(InputError, match=reason):
            read_clip(source, path, gait="trot")
