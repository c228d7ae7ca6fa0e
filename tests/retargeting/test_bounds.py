"""Results are looked at: what is outside its bounds is said; what is good is not."""

import re
from dataclasses import asdict, fields, replace
from math import inf

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.registry import read_clip
from loco_drake.models.robots import get_robot, load_robot
from loco_drake.retargeting.bounds import BOUNDS, check_depth, outside_bounds
from loco_drake.retargeting.retarget import retarget_clip
from tests.robot_files import SOLO8
from tests.synthetic import write_dog_recording
from tests.synthetic_robots import write_mpc_recording


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    path = tmp_path_factory.mktemp("dog") / "dog.txt"
    write_dog_recording(path, "trot", seconds=2.0)
    return read_clip("dog", path, gait="trot")


def test_good_motion_has_no_warning(clip, robot, solver):
    motion, report = retarget_clip(clip, robot, solver=solver)
    assert report.warnings == ()
    assert "warnings" not in motion.provenance
    assert (report.on_feet_share, report.on_feet_frames) == (1.0, "0-120")
    assert report.toes_in_place_share == 1.0
    assert report.unsolved_frames == 0


@pytest.mark.parametrize("key", BOUNDS)
def test_each_figure_outside_its_bound_is_said_with_the_bound(clip, key):
    """At the bound nothing, a hair outside one sentence that names the figure."""
    robot = get_robot("go2")
    good = asdict(retarget_clip(clip, robot)[1])
    bound = BOUNDS[key]
    size = robot.stand_height if bound.stances else 1.0
    for edge, beyond in ((bound.low, -1e-3), (bound.high, 1e-3)):
        if (edge in (0, inf) and beyond < 0) or edge == inf:
            continue
        assert outside_bounds({**good, key: edge * size}, robot) == ()
        (sentence,) = outside_bounds({**good, key: edge * size + beyond}, robot)
        assert sentence.startswith(bound.name)
        assert ", not " in sentence
    (sentence,) = outside_bounds({**good, key: np.nan}, robot)
    assert "nan" in sentence


def test_toes_that_are_off_since_joints_are_too_slow_say_so(clip):
    figures = asdict(retarget_clip(clip, get_robot("go2"))[1])
    figures |= {"toe_error_rmse_m": 0.02, "time_scale": 1.0}
    off = "toe error 20 mm, not at most 2 mm"
    slow = f"{off}: joints are as fast as they can be"
    for ratio, scale, sentence in (
        (0.8, 1.5, off),
        (0.999, 0.5, slow),
        (0.999, 1.5, f"{slow}; --froude gives a robot that is larger more time"),
    ):
        figures |= {"joint_speed_ratio_max": ratio, "scale": scale}
        assert outside_bounds(figures, get_robot("go2")) == (sentence,)


def test_a_motion_too_deep_in_the_ground_to_be_read_is_no_motion(clip):
    """The bound is that of Motion files, a tenth of the robot's height."""
    robot = get_robot("go2")
    _, good = retarget_clip(clip, robot)
    depth = 0.1 * robot.stand_height
    check_depth(asdict(replace(good, penetration_max_m=depth - 1e-6)), robot)
    deep = replace(good, penetration_max_m=depth + 1e-3, joint_speed_ratio_max=0.999)
    with pytest.raises(InputError, match=r"be [\d.]+ mm in the ground: joints are as"):
        check_depth(asdict(deep), robot)


def test_legs_that_cannot_be_put_aside_may_slip(clip):
    """.3 m/s to the side is what Solo8's planar legs do on a bend; the Go2's do not."""
    figures = asdict(retarget_clip(clip, get_robot("go2"))[1])
    figures["stance_slip_median_mps"] = 0.3
    assert outside_bounds(figures, load_robot(str(SOLO8))) == ()
    assert outside_bounds(figures, get_robot("go2")) == (
        "slip 300 mm/s, not at most 30 mm/s",
    )


def exchanged(clip):
    """Left toes on the right and right ones on the left."""
    return replace(clip, toes=clip.toes[:, [1, 0, 3, 2]] + 0.0)


def wide_and_exchanged(clip):
    return exchanged(replace(clip, toes=clip.toes * [1.0, 10.0, 1.0]))


def swimming(clip):
    """Toes that go half a metre to and fro beside the trunk."""
    toes = clip.toes.copy()
    toes[..., 0] += 0.6 * np.sin(np.arange(len(clip)) / 10)[:, None]
    return replace(clip, toes=toes)


def frozen(clip):
    """One frame over and over, as of a tracker that stopped."""
    first = {
        field.name: np.repeat(value[:1], len(clip), axis=0)
        for field in fields(clip)
        if isinstance(value := getattr(clip, field.name), np.ndarray)
    }
    return replace(clip, **first)


def sits_at_first(clip):
    hip, toes = clip.hip.copy(), clip.toes.copy()
    hip[:60, 2] = 0.08
    return replace(clip, hip=hip, toes=toes)


def test_body_of_another_size_than_its_source_has_is_warned_of(tmp_path):
    """The MPC's robot twice as large, though its stance height is given as .2 m."""
    write_mpc_recording(tmp_path / "mpc.txt", "trot")
    clip = read_clip("mpc", tmp_path / "mpc.txt", gait="trot")
    assert retarget_clip(clip, get_robot("go2"))[1].warnings == ()
    arrays = {key: 2 * getattr(clip, key) for key in ("withers", "hip", "toes")}
    report = retarget_clip(replace(clip, **arrays), get_robot("go2"))[1]
    ratio = report.trunk_height_ratio
    sentence = f"trunk height over stance height {ratio:.3g}, not 0.45 to 1.35"
    assert 1.7 < ratio < 2.1
    assert sentence in report.warnings


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (exchanged, "left toes from its right ones -60 mm, not at least 0 mm"),
        (wide_and_exchanged, r"toes in their place 0 %, not at least 75 %"),
        (swimming, "correction"),
        (frozen, r"speed ratio 0, not 0\.01 to 1"),
        (sits_at_first, r"frames on its feet 50 % \(60-120\), not at least 95 %"),
    ],
)
def test_wrong_motion_is_warned_of_in_report_and_file(clip, spoil, reason):
    motion, report = retarget_clip(spoil(clip), get_robot("go2"))
    text = "; ".join(report.warnings)
    assert re.search(reason, text), text
    assert motion.provenance["warnings"] == text
