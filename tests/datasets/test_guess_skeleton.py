import re
from dataclasses import replace

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.guess_skeleton import guess_skeleton
from loco_drake.datasets.named_points import read_points
from tests.synthetic import write_dog_recording
from tests.synthetic_animals import CAT, HORSE, STAND, WALK, Gait, write_bvh
from tests.synthetic_horse import make_horse, write_raw_recording

CAT_TOES = {
    "FL": "Paw_Fore.L",
    "FR": "Paw_Fore.R",
    "RL": "Paw_Hind.L",
    "RR": "Paw_Hind.R",
}
HORSE_TOES = {
    "FL": "NearForeCannon/End Site",
    "FR": "OffForeCannon/End Site",
    "RL": "NearHindCannon/End Site",
    "RR": "OffHindCannon/End Site",
}


def guess(path, fps=None):
    return guess_skeleton(read_points(path), fps)


@pytest.mark.parametrize("heading", [0.0, 1.0, 2.6, -1.7])
def test_a_walking_cat_is_told_without_doubt(heading, tmp_path):
    write_bvh(tmp_path / "a.bvh", CAT, heading=heading)
    found = guess(tmp_path / "a.bvh")
    assert found.doubts == ()
    skeleton = found.skeleton
    assert (skeleton.withers, skeleton.hip) == ("Chest", "Pelvis")
    assert skeleton.toes == CAT_TOES
    assert (skeleton.up, skeleton.units, skeleton.fps) == ("z", "m", None)
    assert found.height == pytest.approx(CAT.height, abs=1e-3)
    assert found.speed == pytest.approx(CAT.gait.speed, rel=1e-3)
    assert found.timing.stride_period == pytest.approx(CAT.gait.period, rel=1e-3)
    np.testing.assert_allclose(found.timing.phase_lags, WALK, atol=0.01)
    # Its toes stand under its withers and hip, .045 m to the side of .26.
    assert skeleton.retargeting == {"hip_spread": 0.17}


def test_a_horse_in_inches_is_told_but_not_from_a_dog_in_centimetres(tmp_path):
    write_bvh(tmp_path / "a.bvh", HORSE, heading=0.4)
    found = guess(tmp_path / "a.bvh")
    assert (found.skeleton.withers, found.skeleton.hip) == ("Base", "Croup")
    assert found.skeleton.toes == HORSE_TOES
    assert found.skeleton.up == "y"
    (doubt,) = found.doubts
    assert re.search(r"0\.57 m high in cm or 1\.5 m high in in", doubt)


@pytest.mark.parametrize("metres", [0.01, 0.001])
def test_unit_follows_from_the_strides(metres, tmp_path):
    write_bvh(tmp_path / "a.bvh", replace(CAT, unit=metres))
    assert guess(tmp_path / "a.bvh").skeleton.metres == metres


@pytest.mark.parametrize(
    ("R_FW", "up"),
    [
        ([[1, 0, 0], [0, 0, -1], [0, 1, 0]], "-y"),
        ([[0, 0, 1], [1, 0, 0], [0, 1, 0]], "x"),
        ([[1, 0, 0], [0, -1, 0], [0, 0, -1]], "-z"),
    ],
)
def test_up_may_be_any_axis(R_FW, up, tmp_path):
    write_bvh(tmp_path / "a.bvh", replace(CAT, R_FW=np.array(R_FW, dtype=float)))
    found = guess(tmp_path / "a.bvh")
    assert found.skeleton.up == up
    assert found.skeleton.toes == CAT_TOES
    assert found.doubts == ()


def test_points_of_a_table_need_no_names(tmp_path):
    """The dog's 27: base of the neck and pelvis, or points at their places."""
    write_dog_recording(tmp_path / "a.txt", "trot")
    found = guess(tmp_path / "a.txt", 60.0)
    assert list(found.skeleton.toes.values()) == ["10", "15", "19", "23"]
    neck, pelvis = map(str, range(3, 10)), ("0", "1", "2")
    assert found.skeleton.withers in [*neck, "11", "12", "13", "14", "24", "25", "26"]
    assert found.skeleton.hip in [*pelvis, "16", "17", "18", "20", "21", "22"]
    assert (found.skeleton.up, found.skeleton.units) == ("y", "m")
    assert found.skeleton.fps == 60.0
    assert guess(tmp_path / "a.txt").doubts[-1].startswith("The file does not tell its")


def test_a_treadmill_is_told(tmp_path):
    write_raw_recording(tmp_path / "a.csv", make_horse("walk", 60.0))
    found = guess(tmp_path / "a.csv")
    assert found.skeleton.toes == {"FL": "HFL", "FR": "HFR", "RL": "HHL", "RR": "HHR"}
    assert (found.skeleton.withers, found.skeleton.hip) == ("Withers", "Sacrum")
    assert any("treadmill" in doubt for doubt in found.doubts)


def test_a_mirror_image_is_told(tmp_path):
    """Z to the right instead of the left: the names say left of right toes."""
    path = tmp_path / "a.bvh"
    write_bvh(path, CAT)
    swap = {".L": ".R", ".R": ".L"}
    path.write_text(re.sub(r"\.[LR]", lambda m: swap[m[0]], path.read_text()))
    found = guess(path)
    assert found.skeleton.toes["FL"] == "Paw_Fore.R"  # where it is
    assert any("left-handed, or it is a mirror image" in d for d in found.doubts)


def test_a_cat_that_walks_backward_is_told_by_its_names(tmp_path):
    back = replace(CAT, gait=Gait(-0.4, 0.6, 0.62, WALK))
    write_bvh(tmp_path / "a.bvh", back)
    found = guess(tmp_path / "a.bvh")
    assert found.skeleton.toes == CAT_TOES
    assert any("moves backward" in doubt for doubt in found.doubts)


def test_a_cat_that_stands_leaves_doubts(tmp_path):
    """Its names still tell front and rear; unit and, without names, front do not."""
    path = tmp_path / "a.bvh"
    write_bvh(path, CAT, schedule=((0.0, STAND), (90.0, CAT.gait)))
    found = guess(path)
    assert found.skeleton.toes == CAT_TOES
    assert any("Without three strides the unit" in doubt for doubt in found.doubts)
    nameless = re.sub(r"Paw_\w+|Humerus|Radius|Femur|Tibia", "Bone", path.read_text())
    path.write_text(nameless)
    assert any("Which legs are in front" in doubt for doubt in guess(path).doubts)


def test_what_has_no_four_legs_is_refused_with_its_names(tmp_path):
    path = tmp_path / "a.bvh"
    write_bvh(path, replace(CAT, tree=(("hip", ""), *CAT.tree[1:5])), seconds=1.0)
    with pytest.raises(InputError, match=r"no four legs .* it has Pelvis, Tail, Femur"):
        guess(path)


@pytest.mark.parametrize("name", ["walk03", "walk04", "run00", "sit02", "stepup_jump2"])
def test_real_dogs_are_told_by_27_nameless_points(real_data, name):
    """Also those that sit and lie for most of the time."""
    found = guess(real_data / "dog_mann" / "keypoints" / f"dog_{name}.txt", 60.0)
    assert list(found.skeleton.toes.values()) == ["10", "15", "19", "23"]
    assert (found.skeleton.up, found.skeleton.units) == ("y", "m")


def test_the_real_dogs_skeleton_is_the_one_of_its_reader(real_data):
    for path in (real_data / "dog_mann" / "bvh").glob("*.bvh"):
        skeleton = guess(path).skeleton
        assert (skeleton.withers, skeleton.hip) == ("Neck", "Hips")
        assert list(skeleton.toes.values()) == [
            f"{joint}/End Site"
            for joint in ("LeftHand", "RightHand", "LeftFoot", "RightFoot")
        ]
        assert (skeleton.up, skeleton.units) == ("y", "cm")
