import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.bvh import parse_bvh
from loco_drake.datasets.recording import read_lines
from loco_drake.datasets.registry import read_clip
from tests.synthetic_bvh import write_dog_bvh

ARM = """HIERARCHY
ROOT Base
{
  OFFSET 5 5 5
  CHANNELS 6 Xposition Yposition Zposition ORDER
  JOINT Elbow
  {
    OFFSET 2 0 0
    CHANNELS 1 Zrotation
    End Site
    {
      OFFSET 1 0 0
    }
  }
}
MOTION
Frames: 1
Frame Time: 0.01
10 20 30 ANGLES
"""


def arm(tmp_path, order="Zrotation Xrotation Yrotation", angles="0 0 0 0"):
    path = tmp_path / "arm.bvh"
    path.write_text(ARM.replace("ORDER", order).replace("ANGLES", angles))
    return path


@pytest.mark.parametrize(
    ("order", "angles", "elbow", "end"),
    [
        # No rotation: offsets add up; the root's position replaces its offset.
        ("Zrotation Xrotation Yrotation", "0 0 0 0", (12, 20, 30), (13, 20, 30)),
        # Root +90 about Z: its x axis is the world's y; elbow +90 more: -x.
        ("Zrotation Xrotation Yrotation", "90 0 0 90", (10, 22, 30), (9, 22, 30)),
        # Z, then X about the turned x axis (world y): the arm stays, the elbow's z axis
        # is now world x, so that it turns the arm from y to z.
        ("Zrotation Xrotation Yrotation", "90 90 0 90", (10, 22, 30), (10, 22, 31)),
        # X, then Z about the turned z axis (world -y): the arm points to world z; the
        # elbow's axis is world -y, so that it turns the arm from z to -x.
        ("Xrotation Zrotation Yrotation", "90 90 0 90", (10, 20, 32), (9, 20, 32)),
    ],
)
def test_forward_kinematics_by_hand(tmp_path, order, angles, elbow, end):
    bvh = parse_bvh(read_lines(arm(tmp_path, order, angles)))
    assert bvh.fps == 100.0
    assert [joint.name for joint in bvh.joints] == ["Base", "Elbow", "End Site"]
    expected = [[(10, 20, 30), elbow, end]]
    np.testing.assert_allclose(bvh.positions(), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("HIERARCHY", "HIER", "lacks HIERARCHY"),
        ("MOTION", "MOTIONS", "lacks HIERARCHY, or MOTION"),
        ("  }\n}\n", "  }\n", "HIERARCHY is damaged"),
        ("OFFSET 2 0 0", "OFFSET 2 0", "HIERARCHY is damaged"),
        ("CHANNELS 1", "CHANNELS 2", "HIERARCHY is damaged"),
        ("ROOT Base", "JOINT Base", "HIERARCHY is damaged"),
        ("Frames: 1", "Frames: 7", "holds 1 frames but says 7"),
        ("Frames: 1", "Rows: 1", "lacks 'Frames'"),
        ("0.01", "0", "lacks 'Frame Time'"),
        ("10 20 30", "10 20", "line 19 has 6 numbers instead of 7"),
        ("10 20 30", "10 x 30", "line 19 holds something that is not a number"),
        ("10 20 30", "10 nan 30", "line 19 holds NaN"),
    ],
)
def test_damaged_file_is_refused_with_the_reason(tmp_path, old, new, reason):
    path = arm(tmp_path)
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=reason):
        parse_bvh(read_lines(path))


@pytest.mark.parametrize("name", ["dog.bvh", "dog.txt"])
def test_dog_reads_as_what_it_was_made_of(tmp_path, name):
    """Turned, in centimetres, whatever the file's name: told by its first line."""
    dog = write_dog_bvh(tmp_path / name, "trot", heading=2.0)
    clip = read_clip("dog", tmp_path / name, gait="trot", start=30)
    assert clip.fps == 60.0
    origin = (dog.withers + dog.hip)[30] / 2 * (1, 1, 0)
    np.testing.assert_allclose(clip.withers, dog.withers[30:] - origin, atol=1e-5)
    np.testing.assert_allclose(clip.toes, dog.toes[30:] - origin, atol=2e-5)


def test_skeleton_of_another_animal_is_refused(tmp_path):
    with pytest.raises(
        InputError,
        match=r"skeleton is another, which lacks Hips .* Hips, Spine",
    ):
        read_clip("dog", arm(tmp_path), gait="trot")


@pytest.mark.parametrize(
    ("bvh", "text"),
    [
        ("D1_007_KAN01_001__dog_walk00.bvh", "dog_walk00.txt"),
        ("D1_009_KAN01_001__dog_walk03.bvh", "dog_walk03.txt"),
        ("D1_010_KAN01_003__dog_run02.bvh", "dog_run02.txt"),
    ],
)
def test_real_bvh_gives_the_clip_of_the_keypoints(real_data, bvh, text):
    """To .2 mm: both files are rounded, and the heading of the start turns all."""
    folder = real_data / "dog_mann"
    a = read_clip("dog", folder / "bvh" / bvh, gait="x")
    b = read_clip("dog", folder / "keypoints" / text, gait="x")
    assert a.fps == b.fps
    scale = np.linalg.norm(b.withers[:, :2], axis=-1).max()
    np.testing.assert_allclose(a.toes, b.toes, atol=1e-4 + 3e-4 * scale)
    # Distances within a frame do not depend on the heading.
    for p, q in ((a.withers, b.withers), (a.hip, b.hip)):
        lengths = [
            np.linalg.norm(c.toes - x[:, None], axis=-1) for c, x in ((a, p), (b, q))
        ]
        np.testing.assert_allclose(*lengths, atol=1.5e-4)
