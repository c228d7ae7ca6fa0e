"""Recordings whose axes, sides, ground or clock are not those of their format."""

import logging

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.registry import read_clip
from tests.synthetic import save_points, write_dog_recording
from tests.synthetic_bvh import write_dog_bvh
from tests.synthetic_horse import make_horse, write_raw_recording, write_world_recording
from tests.synthetic_robots import write_mpc_recording, write_solo8_recording

# How many points a line holds, and which are withers and hip, or their parts, and toes.
POINTS = {"dog": 27, "horse": 7, "mpc": 9, "solo8": 9}
TRUNK = {
    "dog": ([3], [0]),
    "horse": ([1], [2]),
    "mpc": ([5, 6], [7, 8]),
    "solo8": ([1, 2], [3, 4]),
}
TOES = {
    "dog": (10, 15, 19, 23),
    "horse": (3, 4, 5, 6),
    "mpc": (0, 1, 2, 3),
    "solo8": (5, 6, 7, 8),
}
SOURCES = list(POINTS)


def write(source, path):
    """Writes a right recording; returns its points (T, N, 3) in the file's axes."""
    match source:
        case "dog":
            write_dog_recording(path, "trot", seconds=3.0)
        case "horse":
            write_world_recording(path, make_horse("trot", 120.0, 4.0))
        case "mpc":
            write_mpc_recording(path, "trot", seconds=3.0)
        case "solo8":
            write_solo8_recording(path)
    return np.loadtxt(path, delimiter=",").reshape(-1, POINTS[source], 3)


def read_changed(source, path, change):
    """The clip as it should be, and that of the points as ``change`` returns them."""
    points = write(source, path)
    right = read_clip(source, path, gait="trot")
    save_points(path, change(points.copy()))
    return right, read_clip(source, path, gait="trot")


def points_of(clip):
    return np.concatenate((clip.withers[:, None], clip.hip[:, None], clip.toes), axis=1)


def reordered(source, order):
    """Exchanges toes; ``order`` is that of FL, FR, RL, RR."""

    def change(points):
        toes = list(TOES[source])
        points[:, toes] = points[:, [toes[k] for k in order]]
        return points

    return change


def turned_trunk(source):
    def change(points):
        withers, hip = TRUNK[source]
        points[:, withers + hip] = points[:, hip + withers]
        return points

    return change


@pytest.mark.parametrize("source", SOURCES)
def test_right_recording_is_left_as_it_is(source, tmp_path, caplog):
    write(source, tmp_path / "a.txt")
    clip = read_clip(source, tmp_path / "a.txt", gait="trot")
    notes = {"file", "frames", "licence", "attribution"}
    assert set(clip.provenance) == notes
    assert not caplog.records


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(
    "order",
    [(1, 0, 2, 3), (0, 1, 3, 2), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0)],
    ids=["front pair", "rear pair", "right first", "rear first", "reversed"],
)
def test_toes_are_named_by_where_they_are(source, order, tmp_path, caplog):
    """The clip is that of the right order, and its provenance and stderr say it."""
    path = tmp_path / f"{source}{order}.txt"
    with caplog.at_level(logging.WARNING):
        right, mended = read_changed(source, path, reordered(source, order))
    np.testing.assert_allclose(points_of(mended), points_of(right), atol=1e-9)
    said = {k for k in ("swapped", "turned") if k in mended.provenance}
    assert said
    assert all(f"{path.name}: {k}: " in caplog.text for k in said)


@pytest.mark.parametrize("source", SOURCES)
def test_withers_and_hip_exchanged_are_exchanged_back(source, tmp_path):
    path = tmp_path / "a.txt"
    right, mended = read_changed(source, path, turned_trunk(source))
    np.testing.assert_allclose(points_of(mended), points_of(right), atol=1e-9)
    assert mended.provenance["turned"] == "front and rear of trunk exchanged"


@pytest.mark.parametrize("source", ["dog", "mpc", "solo8"])
def test_trunk_and_toes_back_to_front_are_turned_to_go_ahead(source, tmp_path):
    """Both exchanged: left is right, and the animal would go backward."""

    def change(points):
        return reordered(source, (2, 3, 0, 1))(turned_trunk(source)(points))

    right, mended = read_changed(source, tmp_path / "a.txt", change)
    np.testing.assert_allclose(points_of(mended), points_of(right), atol=1e-9)


@pytest.mark.parametrize("source", SOURCES)
def test_mirrored_recording_is_a_mirrored_animal_with_its_left_on_the_left(
    source, tmp_path
):
    mirror = np.array([1.0, 1.0, -1.0] if source == "dog" else [1.0, -1.0, 1.0])
    right, mended = read_changed(source, tmp_path / "a.txt", lambda p: p * mirror)
    assert mended.provenance["swapped"].startswith("left and right front and rear")
    atol = 1e-4 if source == "horse" else 1e-9
    expected = points_of(right.mirrored())
    np.testing.assert_allclose(points_of(mended), expected, atol=atol)


TURNS = {
    "x up": [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
    "y up": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    "z up": [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
    "upside down": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
}


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("turn", TURNS)
def test_axis_that_points_up_is_found(source, turn, tmp_path):
    R = np.array(TURNS[turn], dtype=float)
    right, mended = read_changed(source, tmp_path / "a.txt", lambda p: p @ R)
    np.testing.assert_allclose(points_of(mended), points_of(right), atol=1e-6)
    assert "up" in mended.provenance


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("height", [-0.3, 0.1, 1.0, 20.0])
def test_ground_anywhere_gives_the_same_clip(source, height, tmp_path):
    """Trunk and toes move together; markers tell the ground to 1 % of the body."""
    up = np.array([0.0, 1.0, 0.0] if source == "dog" else [0.0, 0.0, 1.0])
    path = tmp_path / "a.txt"
    right, mended = read_changed(source, path, lambda p: p + height * up)
    np.testing.assert_allclose(mended.toes, right.toes, atol=1e-6)
    size = right.withers[0, 2]
    np.testing.assert_allclose(mended.withers, right.withers, atol=0.01 * size)
    told = float(mended.provenance["ground"].split()[4])
    assert told == pytest.approx(height, abs=0.01 * size)


@pytest.mark.parametrize("degrees", [25, 45, 70])
def test_tilted_axes_are_refused(degrees, tmp_path):
    a = np.radians(degrees)
    R = np.array([[1, 0, 0], [0, np.cos(a), np.sin(a)], [0, -np.sin(a), np.cos(a)]])
    with pytest.raises(InputError, match=r"slopes by|way is up|high over"):
        read_changed("dog", tmp_path / "a.txt", lambda points: points @ R)


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("factor", [1e3, 1e2, 1 / 0.0254, 1 / 0.3048, 1e-3])
def test_other_unit_of_length_is_refused(source, factor, tmp_path):
    with pytest.raises(InputError, match=r"unit of length|not metres"):
        read_changed(source, tmp_path / "a.txt", lambda points: points * factor)


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("fps", [1e9, 1000, 360, 12, 0.06, -60, float("nan")])
def test_rate_at_which_no_body_moves_is_refused(source, fps, tmp_path):
    write(source, tmp_path / "a.txt")
    with pytest.raises(InputError, match=r"not plausible|motion implies"):
        read_clip(source, tmp_path / "a.txt", gait="trot", fps=fps)


@pytest.mark.parametrize(
    ("source", "own", "wrong"), [("mpc", 100, 200), ("horse", 120, 60)]
)
def test_rate_that_the_motion_contradicts_is_refused(source, own, wrong, tmp_path):
    write(source, tmp_path / "a.txt")
    assert read_clip(source, tmp_path / "a.txt", gait="trot", fps=own).fps == own
    with pytest.raises(InputError, match=f"implies {own}"):
        read_clip(source, tmp_path / "a.txt", gait="trot", fps=wrong)


@pytest.mark.parametrize("step", ["16.6667", "0.0000166667", "1e-12", "166667"])
def test_bvh_with_another_unit_of_time_is_refused(step, tmp_path):
    path = tmp_path / "a.bvh"
    write_dog_bvh(path, "trot")
    path.write_text(path.read_text().replace("0.0166667", step))
    with pytest.raises(InputError, match="not plausible: a rate is 10 to 1000"):
        read_clip("dog", path, gait="trot")


def test_raw_time_in_milliseconds_is_refused(tmp_path):
    path = tmp_path / "a.csv"
    write_raw_recording(path, make_horse("walk", 60.0))
    header, *lines = path.read_text().splitlines()
    for k, line in enumerate(lines):
        frame, time, *rest = line.split(",")
        lines[k] = ",".join((frame, f"{1000 * float(time):.0f}", *rest))
    path.write_text("\n".join([header, *lines]))
    with pytest.raises(InputError, match="is a time in ms"):
        read_clip("horse", path, gait="walk")


def test_backward_walk_stays_one(tmp_path):
    """A dog that runs ahead, its frames in reverse."""
    right, back = read_changed("dog", tmp_path / "a.txt", lambda p: p[::-1])
    assert not {"turned", "swapped", "up", "ground"} & set(back.provenance)
    assert (back.withers - back.hip)[0, 0] > 0.4
    assert np.ptp(back.withers[:, 0]) == pytest.approx(np.ptp(right.withers[:, 0]))
    assert back.withers[-1, 0] < -4


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(
    ("far", "reason"), [(3.0, "jumps"), (300.0, "jumps"), (1e12, r"line \d+ holds")]
)
def test_single_point_far_off_is_refused(source, far, reason, tmp_path):
    def change(points):
        points[len(points) // 2, TOES[source][2], 1] += far
        return points

    with pytest.raises(InputError, match=reason):
        read_changed(source, tmp_path / "a.txt", change)


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("frames", [1, 3])
def test_fewer_than_four_frames_are_refused(source, frames, tmp_path):
    points = write(source, tmp_path / "a.txt")
    save_points(tmp_path / "a.txt", points[:frames])
    with pytest.raises(InputError, match=f"at least 4 frames, not {frames}"):
        read_clip(source, tmp_path / "a.txt", gait="trot")
