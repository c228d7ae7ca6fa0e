import numpy as np
import pytest

from loco_drake.errors import InputError
from loco_drake.gaits import parse_label
from loco_drake.generation.features import SIZE
from loco_drake.generation.library import (
    Clip,
    Sampler,
    choose_held_out,
    load_library,
)
from loco_drake.motion import save_motion


def clip(label, recording, frames):
    return Clip("go2", parse_label(label), recording, np.zeros((frames, SIZE)))


def test_recordings_are_never_on_both_sides(motions):
    library = load_library(motions, 0.2, seed=0)
    train = {c.recording for c in library.train}
    held = {c.recording for c in library.held_out}
    assert held
    assert not train & held
    assert {str(label) for label in library.labels} == {"dog-pace", "dog-trot"}
    # Eight clips: each that is trained on comes with its mirror image.
    assert len(library.train) / 2 + len(library.held_out) == 8


def test_mirror_images_turn_the_other_way(motions):
    library = load_library(motions, 0.0, seed=0)
    assert library.held_out == ()
    half = len(library.train) // 2
    for plain, mirror in zip(library.train[:half], library.train[half:], strict=True):
        assert plain.recording == mirror.recording
        np.testing.assert_allclose(plain.features[:, 2], -mirror.features[:, 2])
        np.testing.assert_allclose(plain.features[:, 0], mirror.features[:, 0])
        np.testing.assert_array_equal(
            plain.features[:, 18:], mirror.features[:, [19, 18, 21, 20]]
        )


def test_every_label_has_its_share_held_out_and_keeps_a_recording():
    clips = [clip("dog-pace", f"p{i}", 100) for i in range(10)]
    clips += [clip("dog-trot", f"t{i}", 100) for i in range(2)]
    clips += [clip("dog-gallop", "g", 100)]
    for seed in range(5):
        held = choose_held_out(clips, 0.25, seed)
        assert len([r for r in held if r[0] == "p"]) == 3
        assert len([r for r in held if r[0] == "t"]) == 1
        assert "g" not in held


def test_a_recording_of_two_labels_counts_for_both():
    clips = [clip("dog-pace", "both", 100), clip("dog-trot", "both", 100)]
    clips += [clip("dog-pace", "p", 100), clip("dog-trot", "t", 100)]
    for seed in range(5):
        held = choose_held_out(clips, 0.5, seed)
        assert held == {"both"} or held == {"p", "t"}


def test_labels_are_drawn_by_the_square_root_of_their_time():
    """900 frames against 100: 3 to 1. Within a label by length: 2 to 1."""
    clips = [clip("dog-pace", "a", 600), clip("dog-pace", "b", 300)]
    clips += [clip("dog-trot", "c", 100)]
    probabilities = Sampler(clips).probabilities
    np.testing.assert_allclose(probabilities, [0.5, 0.25, 0.25])


def test_a_folder_without_motions_is_refused(tmp_path, make_synthetic):
    with pytest.raises(InputError, match="no Motion files"):
        load_library(tmp_path / "missing", 0.1, 0)
    with pytest.raises(InputError, match="no Motion files"):
        load_library(tmp_path, 0.1, 0)
    (tmp_path / "bad.npz").write_bytes(b"nothing")
    with pytest.raises(InputError, match="not a Motion file"):
        load_library(tmp_path, 0.1, 0)


def test_motions_without_one_of_the_labels_are_left_out(tmp_path, make_synthetic):
    from dataclasses import replace

    save_motion(make_synthetic(), tmp_path / "a.npz")
    save_motion(replace(make_synthetic(), gait="turn_left"), tmp_path / "b.npz")
    assert len(load_library(tmp_path, 0.0, 0).train) == 2
