"""Clips in a file are those in memory, and what learns from them learns the same."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.interpolate import CubicSpline

from loco_drake.generation import clips as clips_module
from loco_drake.generation import stitching, windows
from loco_drake.generation.clips import Chosen, Clip, ClipFile, evenly, in_parts
from loco_drake.generation.features import CONTACTS, SIZE
from loco_drake.generation.loop_settings import LoopSettings
from loco_drake.generation.tokenizer import TokenizerConfig
from loco_drake.generation.train_generator import stitched_clips
from loco_drake.generation.train_tokenizer import Scales, statistics, train_tokenizer
from loco_drake.generation.training_motions import (
    Library,
    clip_probabilities,
    load_library,
    motion_clip,
)
from loco_drake.generation.windows import PairedWindows, cut_window, draw_cut
from loco_drake.motion.gaits import parse_label
from loco_drake.motion.motion_file import save_motion
from loco_drake.motion.packing import pack
from tests.synthetic_motion import synthetic_motion

ROBOTS = ("a1", "go2")


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """A folder for each of two robots, which do the same, but for one motion."""
    folder = tmp_path_factory.mktemp("two")
    for robot in ROBOTS:
        for i, label in enumerate(("dog-trot", "dog-pace", "dog-trot")):
            motion = synthetic_motion(
                label,
                1.6 + 0.3 * i,
                0.6 + 0.1 * i,
                0.2 * i,
                name=robot,
                recording=f"r{i}",
                split="validation" if i == 2 else "train",
            )
            origin = {**motion.provenance, "file": f"{i}", "frames": "0-100"}
            save_motion(replace(motion, provenance=origin), folder / robot / f"{i}.npz")
    extra = synthetic_motion("dog-pace", 2.0, 0.9, name="go2", recording="r3")
    save_motion(extra, folder / "go2" / "3.npz")
    return folder


@pytest.fixture(scope="module")
def library(two):
    return load_library(two / "a1", two / "go2")


@pytest.fixture(scope="module")
def eager(library):
    """The same clips, all in memory."""
    return Library(tuple(map(copied, library.train)), tuple(library.held_out))


def copied(clip):
    return replace(clip, features=clip.features.copy())


def assert_same(a, b):
    for name in ("robot", "label", "recording", "performance", "grounded"):
        assert getattr(a, name) == getattr(b, name)
    assert len(a) == len(b)
    np.testing.assert_array_equal(a.features, b.features)


def test_clips_come_out_of_the_file_as_they_went_in(tmp_path):
    motion = synthetic_motion("dog-pace", turn=0.4)
    origin = {**motion.provenance, "file": "a", "frames": "0-9"}
    known = replace(motion, provenance=origin)
    grounded = replace(known, provenance={**origin, "momentum_error": "0.01"})
    put = [motion_clip(m, "a.npz") for m in (motion, known, known.mirrored(), grounded)]
    file = ClipFile(tmp_path)
    for clip in put:
        file.append(clip)
    assert list(tmp_path.iterdir()) == []  # it has no name
    for clip, found in zip(put, file, strict=True):
        assert_same(clip, found)
    assert len({clip.performance for clip in file}) == 3
    assert_same(file[1:][-1], put[-1])
    assert_same(Chosen(file, [3, 0])[1:][0], put[0])
    with pytest.raises(IndexError):
        file[4]


def test_memory_holds_an_index_of_the_clips(tmp_path):
    """Of each clip some bytes, and none of its features, 17,600."""
    file, label = ClipFile(tmp_path), parse_label("dog-trot")
    clip = Clip("go2", label, "r", np.ones((100, SIZE)), "0123456789abcdef")
    file.append(clip)
    tracemalloc.start()
    for _ in range(2000):
        file.append(clip)
    chosen = Chosen(file, range(2000))
    assert sum(map(len, chosen)) == 200_000
    size, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert size < 100 * 2000
    assert peak < 300 * 2000


def test_a_library_of_packed_motion_is_that_of_the_files(two, library, tmp_path):
    pack([two / "a1", two / "go2"], tmp_path / "packed")
    packed = load_library(tmp_path / "packed")
    assert (packed.summary, packed.robots, packed.labels) == (
        library.summary,
        library.robots,
        library.labels,
    )
    for side in ("train", "held_out"):
        both = zip(getattr(packed, side), getattr(library, side), strict=True)
        for a, b in both:
            assert_same(a, b)
    assert len(packed.held_out) == 2


def test_training_on_packed_motion_is_the_same_to_the_last_bit(
    two, eager, library, tmp_path
):
    pack([two / "a1", two / "go2"], tmp_path / "packed")
    tiny = TokenizerConfig(
        robots=ROBOTS,
        width=16,
        depth=1,
        frame_width=8,
        codebooks=2,
        codebook_size=8,
    )
    weights = []
    packed = load_library(tmp_path / "packed", scratch=tmp_path)
    for number, one in enumerate((eager, library, packed)):
        settings = LoopSettings(tmp_path / str(number), 2, 3e-3)
        tokenizer, _ = train_tokenizer(one, tiny, settings)
        weights.append(tokenizer.state_dict())
    for other in weights[1:]:
        assert all(torch.equal(weights[0][name], other[name]) for name in other)


def simple_batch(clips, robots, random, count):
    """What PairedWindows draws, one step after the other, with all in memory."""
    drawn = random.choice(len(clips), size=count, p=clip_probabilities(clips))
    chosen = [clips[i] for i in drawn]
    cuts = [draw_cut(len(clip), random) for clip in chosen]
    others = []
    for clip in chosen:
        same = [c for c in clips if c.performance and c.performance == clip.performance]
        among = [c for c in same if c.robot != clip.robot] or [clip]
        others.append(among[random.integers(len(among))])
    curves = [CubicSpline(np.arange(len(c)), c.features) for c in chosen + others]
    rows = [cut_window(c, *cut) for c, cut in zip(curves, cuts * 2, strict=True)]
    robot = [robots.index(c.robot) for c in chosen + others]
    return np.stack(rows).astype(np.float32), robot


@pytest.mark.parametrize("held", [1, 250, 2**18])
def test_batches_are_those_of_clips_in_memory(held, library, eager, monkeypatch):
    """However many curves are kept."""
    monkeypatch.setattr(windows, "HELD_FRAMES", held)
    made = PairedWindows(library.train, ROBOTS)
    random, same = np.random.default_rng(3), np.random.default_rng(3)
    for _ in range(4):
        frames, robot, _ = made(random, 8)
        wanted, of = simple_batch(list(eager.train), ROBOTS, same, 8)
        np.testing.assert_array_equal(frames.numpy(), wanted)
        assert robot.tolist() == of
    assert made._curve._frames <= max(held, max(map(len, eager.train)))


def test_steered_variants_are_not_taken_for_the_same(tmp_path):
    """The commands of another robot differ, since its pace does."""
    clips = []
    for robot in ROBOTS:
        motion = synthetic_motion(name=robot)
        origin = {**motion.provenance, "file": "a", "frames": "0-9"}
        for own in ({}, {"steered": f"by {robot}"}):
            variant = replace(motion, provenance={**origin, **own})
            clips += [motion_clip(variant)]
    made = PairedWindows(clips, ROBOTS)
    others = [made._others(row).tolist() for row in range(4)]
    assert others == [[2], [1], [0], [3]]


def test_statistics_are_those_of_all_frames_at_once(library, eager):
    frames = np.concatenate([clip.features for clip in eager.train])
    rows = torch.tensor(frames, dtype=torch.float32)
    mean, std = statistics(library.train)
    assert torch.equal(mean, rows.mean(dim=0))
    assert torch.equal(std, rows.std(dim=0))


def test_statistics_in_parts_are_those_of_the_whole(library, eager, monkeypatch):
    whole, scales = statistics(library.train), Scales(eager.train)._scales
    monkeypatch.setattr(clips_module, "HELD_FRAMES", 200)  # clips have 80 to 100
    assert sum(1 for _ in in_parts(library.train)) > 3
    for found, wanted in zip(statistics(library.train), whole, strict=True):
        torch.testing.assert_close(found, wanted, rtol=1e-5, atol=1e-6)
    torch.testing.assert_close(
        Scales(library.train)._scales, scales, rtol=1e-5, atol=1e-7
    )


def test_scales_are_those_of_clips_in_memory(library):
    """Computed here as a formula of all frames of a label."""
    label = parse_label("dog-pace").index
    own = [
        c.features[:, : CONTACTS.start] for c in library.train if c.label.index == label
    ]
    step = np.concatenate([np.diff(x, axis=0) for x in own])
    change = np.sqrt(np.square(step).mean(axis=0))
    found = Scales(library.train)(torch.tensor([label]))[1][0, 0].numpy()
    np.testing.assert_array_equal(np.maximum(found, change.astype(np.float32)), found)
    assert (found == change.astype(np.float32)).sum() > 8  # the others hardly vary


def test_parts_hold_so_many_frames(monkeypatch):
    monkeypatch.setattr(clips_module, "HELD_FRAMES", 7)
    label = parse_label("dog-trot")
    made = [Clip("go2", label, "r", np.zeros((n, SIZE))) for n in (3, 4, 9, 1, 1)]
    assert [list(map(len, part)) for part in in_parts(made)] == [[3, 4], [9], [1, 1]]
    assert list(in_parts([])) == []


def test_many_clips_are_stitched_in_pools(library, eager, monkeypatch):
    """All in one pool it is the same as of clips in memory; in many all are used."""
    one, other = (
        list(stitched_clips(clips, 2, 0)) for clips in (library.train, eager.train)
    )
    for a, b in zip(one, other, strict=True):
        assert_same(a, b)
    monkeypatch.setattr(stitching, "POOL", 150)
    random = np.random.default_rng(0)
    pools = stitching.pools(library.train, random)
    used = [clip.features.tobytes() for pool in pools for clip in pool]
    assert sorted(used) == sorted(clip.features.tobytes() for clip in library.train)
    assert all(sum(map(len, pool)) <= 150 + 100 for pool in pools)
    assert len(pools) > 3
    several = list(stitched_clips(library.train, 2, 0))
    assert [(c.robot, c.label, len(c)) for c in several] == [
        (c.robot, c.label, len(c)) for c in one
    ]


def test_clips_are_picked_evenly():
    label = parse_label("dog-trot")
    made = [Clip("go2", label, str(n), np.zeros((1, SIZE))) for n in range(7)]
    assert evenly(made, 7) is made
    assert [clip.recording for clip in evenly(made, 3)] == ["0", "2", "4"]
