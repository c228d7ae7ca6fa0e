from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from loco_drake.common.errors import InputError
from loco_drake.datasets.registry import read_clip
from loco_drake.datasets.segments import read_segments
from loco_drake.models.robots import get_robot
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.retargeting.contacts import frames_on_feet, on_feet, stance_height
from loco_drake.retargeting.scaling import RetargetConfig, resample, scale_to_robot
from tests.synthetic import make_dog


def clip_of(withers, hip, toes, fps=50.0):
    arrays = [np.asarray(points, dtype=float) for points in (withers, hip, toes)]
    return KeypointClip("dog", "trot", fps, *arrays, provenance={})


def random_clip(frames=20, seed=0):
    """A trunk that turns and pitches, toes all around it, some below the ground."""
    rng = np.random.default_rng(seed)
    hip = rng.uniform(-1, 1, (frames, 3)) + np.array([0, 0, 1.5])
    withers = hip + rng.uniform(-0.3, 0.3, (frames, 3)) + [0.1, 0.4, 0]
    toes = rng.uniform(-0.5, 0.5, (frames, 4, 3)) + hip[:, None]
    toes[..., 2] = rng.uniform(-0.02, 0.2, (frames, 4))
    return clip_of(withers, hip, toes)


def test_level_dog_by_hand():
    """Go2, animal twice as tall: every length is halved, worked out on paper."""
    robot = get_robot("go2")
    height = 2 * robot.stand_height
    toes = [[0.5, 0.1, 0], [0.4, -0.1, 0.2], [-0.6, 0.0, 0], [-0.4, 0.0, -0.1]]
    clip = clip_of([[0.4, 0, height]], [[-0.4, 0, height]], [toes])
    targets = scale_to_robot(clip, height, robot, RetargetConfig())
    np.testing.assert_allclose(targets.p_WB, [[0, 0, robot.stand_height]])
    np.testing.assert_allclose(targets.q_WB, [[1, 0, 0, 0]], atol=1e-12)
    hip_x, hip_y = 0.1934, 0.0465 + 0.0955  # Go2's hip joint and abduction offset
    radius = robot.foot_radius
    expected = [
        [hip_x + 0.05, hip_y + 0.05, radius],
        [hip_x + 0.0, -hip_y - 0.05, radius + 0.1],
        [-hip_x - 0.1, hip_y, radius],
        [-hip_x - 0.0, -hip_y, radius],  # a sunk toe is put on the ground
    ]
    np.testing.assert_allclose(targets.p_WF[0], expected, atol=1e-12)


@pytest.mark.parametrize("name", ["go2", "a1"])
def test_formula_against_scipy_frame_by_frame(name):
    """Same targets from unit vectors and scipy rotations, written out independently."""
    robot, clip, height = get_robot(name), random_clip(), 0.5
    config = RetargetConfig(
        front_hip=0.05,
        rear_hip=-0.11,
        base_height_offset=-0.02,
        hip_spread=0.06,
        swing_height=1.2,
    )
    targets = scale_to_robot(clip, height, robot, config)
    alpha = robot.stand_height / height
    for k in range(len(clip)):
        w, h = clip.withers[k], clip.hip[k]
        along = (w - h) / np.linalg.norm(w - h)
        yaw = np.arctan2(along[1], along[0])
        pitch = np.arcsin(-along[2])
        R_WB = Rotation.from_euler("ZYX", [yaw, pitch, 0.0])
        # Heading and pitch from hip to withers: the trunk's x axis is that line.
        np.testing.assert_allclose(R_WB.apply([1, 0, 0]), along, atol=1e-12)
        q_WB = R_WB.as_quat(scalar_first=True)
        assert abs(targets.q_WB[k] @ q_WB) == pytest.approx(1.0)
        p_WB = alpha * (w + h) / 2 + [0, 0, -0.02]
        np.testing.assert_allclose(targets.p_WB[k], p_WB, atol=1e-12)
        for leg in range(4):
            left = 1 if leg % 2 == 0 else -1
            start = w + 0.05 * height * along if leg < 2 else h - 0.11 * height * along
            # .06 of .5 m to the left of the horizontal direction of the trunk.
            start = start + left * 0.03 * np.array([-np.sin(yaw), np.cos(yaw), 0.0])
            leg_vector = clip.toes[k, leg] - start
            length = np.linalg.norm(leg_vector)
            side = robot.abduction_offset[leg]
            p_WV = p_WB + R_WB.apply(robot.p_BHip[leg] + [0, side, 0])
            p_WF = p_WV + alpha * length * (leg_vector / length)
            np.testing.assert_allclose(targets.p_WF[k, leg, :2], p_WF[:2], atol=1e-12)
            lift = max(clip.toes[k, leg, 2], 0) * alpha * 1.2
            assert targets.p_WF[k, leg, 2] == pytest.approx(robot.foot_radius + lift)


def test_toes_in_the_trunk_frame_and_back():
    robot, clip = get_robot("go2"), random_clip(seed=3)
    targets = scale_to_robot(clip, 0.5, robot, RetargetConfig())
    R_WB = Rotation.from_quat(targets.q_WB, scalar_first=True)
    for leg in range(4):
        p_WF = targets.p_WB + R_WB.apply(targets.p_BF[:, leg])
        np.testing.assert_allclose(p_WF, targets.p_WF[:, leg], atol=1e-12)


def test_heading_has_no_jumps_when_the_animal_turns_round():
    angle = np.linspace(0, 4 * np.pi, 100)
    half = 0.2 * np.stack((np.cos(angle), np.sin(angle), 0 * angle), axis=-1)
    up = np.array([0, 0, 0.4])
    clip = clip_of(up + half, up - half, np.zeros((100, 4, 3)))
    targets = scale_to_robot(clip, 0.4, get_robot("go2"), RetargetConfig())
    np.testing.assert_allclose(targets.yaw, angle, atol=1e-9)


def test_stance_height_is_the_percentile_of_the_middle_or_that_of_the_source():
    under = [[0, 0.1, 0], [0, -0.1, 0], [-1, 0.1, 0], [-1, -0.1, 0]]
    clip = clip_of([[0, 0, 0.7], [0, 0, 0.8]], [[-1, 0, 0.5]] * 2, [under] * 2)
    lowest = RetargetConfig(stance_height_percentile=0.0)
    assert stance_height(clip, lowest) == pytest.approx(0.60)
    assert stance_height(clip, RetargetConfig()) == pytest.approx(0.625)
    assert stance_height(clip, RetargetConfig(stance_height=0.3)) == 0.3
    sunk = clip_of([[0, 0, -1]], [[-1, 0, 0.3]], np.zeros((1, 4, 3)))
    with pytest.raises(InputError, match="does not stand on its feet"):
        stance_height(sunk, RetargetConfig(stance_height=0.3))


def walk_after(pose, frames):
    """The made dog's trot, .44 m high, after so many frames of another pose at 60 Hz.

    Args:
        pose: changes withers, hip and toes, (T, 3), (T, 3) and (T, 4, 3), in place.
        frames: how many.
    """
    dog = make_dog("trot", seconds=2.0)
    walks = (dog.withers, dog.hip, dog.toes)
    arrays = [np.repeat(points[:1], frames, axis=0) for points in walks]
    pose(*arrays)
    joined = (np.concatenate(pair) for pair in zip(arrays, walks, strict=True))
    return clip_of(*joined, fps=60.0)


def lies(withers, hip, toes):
    withers[:, 2], hip[:, 2] = 0.10, 0.12


def lies_on_folded_legs(withers, hip, toes):
    """Toes right below: legs are as high as they are long, but short."""
    lies(withers, hip, toes)
    toes[:, :2, 0], toes[:, 2:, 0] = withers[:, :1], hip[:, :1]


def lies_flat(withers, hip, toes):
    withers[:, 2], hip[:, 2] = 0.05, 0.05
    toes[..., 1] *= 10


def sits(withers, hip, toes):
    """The hip at 8 cm, the withers as high as ever."""
    hip[:, 2] = 0.08
    toes[:, 2:, 0] += 0.2


def rears(withers, hip, toes):
    """Front toes off the ground, the withers above the hip."""
    withers[:, 2] += 0.4
    toes[:, :2] = withers[:, None] + [0.3, 0.0, -0.1]


@pytest.mark.parametrize("pose", [lies, lies_on_folded_legs, lies_flat, sits, rears])
def test_scale_is_that_of_the_animal_standing(pose):
    """Three seconds of another pose, two of a trot: its .44 m count."""
    clip = walk_after(pose, 180)
    standing = on_feet(clip)
    assert not standing[:180].any()
    assert standing[180:].all()
    assert frames_on_feet(clip, standing) == "180-300"
    assert stance_height(clip, RetargetConfig()) == pytest.approx(0.44)


@pytest.mark.parametrize("pose", [lies, lies_on_folded_legs, lies_flat, sits])
def test_animal_that_hardly_stands_is_refused_with_its_frames(pose):
    """Eleven frames at 60 Hz are less than .2 s, twelve are not."""
    for frames, reason in ((0, "in no frame, too"), (11, "no frames but 520-531, too")):
        clip = walk_after(pose, 20)
        keep = slice(0, 20 + frames)
        arrays = (points[keep] for points in (clip.withers, clip.hip, clip.toes))
        short = replace(clip_of(*arrays, fps=60.0), provenance={"frames": "500-531"})
        with pytest.raises(InputError, match=reason):
            stance_height(short, RetargetConfig())
        # A source that says how high its body stands is not asked.
        assert stance_height(short, RetargetConfig(stance_height=0.3)) == 0.3


def test_recorded_stretches_are_all_on_their_feet(real_data):
    """So their scale is that of all their frames, as it always was."""
    for segment in read_segments(real_data)[::5]:
        if segment.source in ("dog", "horse"):
            assert on_feet(segment.read()).all(), segment.name


def test_whole_recordings_have_the_scale_of_their_stretches(real_data):
    """In these the dog sits for most of the time: medians were .23 and .32 m."""
    for name, height in (("dog_run00", 0.454), ("dog_turn00", 0.442)):
        path = real_data / "dog_mann" / "keypoints" / f"{name}.txt"
        clip = read_clip("dog", path, gait="trot")
        found = stance_height(clip, RetargetConfig())
        assert found == pytest.approx(height, abs=0.002)


def test_resampling_keeps_a_cubic_exactly_and_the_last_whole_step():
    """61 frames at 60 Hz are 1 s: 51 frames at 50 Hz, on the same curve."""

    def curve(time):
        return np.stack((time**3 - time, 2 * time**2, 1 + time), axis=-1)

    old, new = np.arange(61) / 60, np.arange(51) / 50
    toes = np.repeat(curve(old)[:, None], 4, axis=1)
    clip = resample(clip_of(curve(old), 2 * curve(old), toes, fps=60.0), 50.0)
    assert clip.fps == 50.0
    np.testing.assert_allclose(clip.withers, curve(new), atol=1e-12)
    np.testing.assert_allclose(clip.hip, 2 * curve(new), atol=1e-12)
    np.testing.assert_allclose(clip.toes[:, 2], curve(new), atol=1e-12)


def test_clip_too_short_to_interpolate_is_refused():
    clip = clip_of(np.ones((3, 3)), np.zeros((3, 3)), np.zeros((3, 4, 3)))
    with pytest.raises(InputError, match="at least 4 frames, not 3"):
        resample(clip, 50.0)
