from dataclasses import replace

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.generation.clips import Clip
from loco_drake.generation.features import SIZE
from loco_drake.generation.training_motions import clip_probabilities, load_library
from loco_drake.motion.gaits import parse_label
from loco_drake.motion.motion_file import save_motion


def clip(label, recording, frames):
    return Clip("go2", parse_label(label), recording, np.zeros((frames, SIZE)))


def test_the_split_is_that_of_the_files(motions):
    library = load_library(motions)
    train = {c.recording for c in library.train}
    held = {c.recording for c in library.held_out}
    assert train == {"dog-dog-trot0", "dog-dog-pace0"}
    assert held == {"dog-dog-trot1", "dog-dog-pace1"}
    assert {str(label) for label in library.labels} == {"dog-pace", "dog-trot"}
    # Eight clips: each that is trained on comes with its mirror image.
    assert len(library.train) / 2 + len(library.held_out) == 8


def test_mirror_images_turn_the_other_way(motions):
    library = load_library(motions)
    half = len(library.train) // 2
    for plain, mirror in zip(library.train[:half], library.train[half:], strict=True):
        assert plain.recording == mirror.recording
        np.testing.assert_allclose(plain.features[:, 2], -mirror.features[:, 2])
        np.testing.assert_allclose(plain.features[:, 0], mirror.features[:, 0])
        np.testing.assert_array_equal(
            plain.features[:, 18:], mirror.features[:, [19, 18, 21, 20]]
        )


@pytest.mark.parametrize("origin", [{"recording": "r"}, {"animal": "Horse3"}])
def test_a_recording_on_both_sides_is_refused(tmp_path, make_synthetic, origin):
    for i, side in enumerate(("train", "validation")):
        provenance = {"recording": f"r{i}", **origin, "split": side}
        motion = replace(make_synthetic(), provenance=provenance)
        save_motion(motion, tmp_path / f"{i}.npz")
    with pytest.raises(InputError, match=r"dog-(r|Horse3) .* for training and for"):
        load_library(tmp_path)
    (tmp_path / "0.npz").unlink()
    with pytest.raises(InputError, match=r"All motions .* are for validation"):
        load_library(tmp_path)


def test_motions_without_a_split_are_for_training(tmp_path, make_synthetic):
    for i in range(2):
        motion = replace(make_synthetic(), provenance={})
        save_motion(motion, tmp_path / f"{i}.npz")
    library = load_library(tmp_path)
    assert len({clip.recording for clip in library.train}) == 2
    assert not library.held_out


def test_labels_are_drawn_by_the_square_root_of_their_time():
    """900 frames against 100: 3 to 1. Within a label by length: 2 to 1."""
    clips = [clip("dog-pace", "a", 600), clip("dog-pace", "b", 300)]
    clips += [clip("dog-trot", "c", 100)]
    probabilities = clip_probabilities(clips)
    np.testing.assert_allclose(probabilities, [0.5, 0.25, 0.25])


def test_a_folder_without_motions_is_refused(tmp_path, make_synthetic):
    with pytest.raises(InputError, match=r"no folder of Motion files '.*missing'"):
        load_library(tmp_path, tmp_path / "missing")
    with pytest.raises(InputError, match="no Motion files"):
        load_library(tmp_path)
    (tmp_path / "bad.npz").write_bytes(b"nothing")
    with pytest.raises(InputError, match="not a Motion file"):
        load_library(tmp_path)


def test_motions_without_one_of_the_labels_are_left_out(tmp_path, make_synthetic):
    save_motion(make_synthetic(), tmp_path / "a.npz")
    save_motion(replace(make_synthetic(), gait="turn_left"), tmp_path / "b.npz")
    assert len(load_library(tmp_path).train) == 2


def test_a_folder_for_each_robot(tmp_path, make_synthetic):
    for name in ("go2", "a1"):
        save_motion(make_synthetic(name=name), tmp_path / name / "a.npz")
    library = load_library(tmp_path / "go2", tmp_path / "a1")
    assert library.robots == ("a1", "go2")
    for name in ("empty", "other"):
        (tmp_path / name).mkdir()
    with pytest.raises(InputError, match=r"no Motion files .*empty', '.*other'"):
        load_library(tmp_path / "empty", tmp_path / "other")
