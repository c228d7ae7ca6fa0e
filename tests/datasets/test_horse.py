import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.registry import read_clip
from loco_drake.datasets.segments import read_segments
from tests.synthetic_horse import (
    GAITS,
    make_horse,
    write_raw_recording,
    write_world_recording,
)

# (frames per second, name that says so)
DAYS = [(60.0, "Horse1_M1_x"), (120.0, "Horse1_M2_x"), (120.0, "Horse14_M3_x")]


def speed_of(clip):
    """Mean speed of the withers from the first frame to the last, m/s."""
    way = np.linalg.norm((clip.withers[-1] - clip.withers[0])[:2])
    return way * clip.fps / (len(clip) - 1)


def stance_slide(clip, contacts):
    """Median horizontal speed in m/s of hooves well within stance."""
    inner = contacts.copy()
    for shift in (1, 2, 3):
        inner[shift:] &= contacts[:-shift]
        inner[:-shift] &= contacts[shift:]
    speed = np.linalg.norm(
        np.gradient(clip.toes[..., :2], 1 / clip.fps, axis=0), axis=-1
    )
    return np.median(speed[inner])


@pytest.mark.parametrize("gait", GAITS)
@pytest.mark.parametrize(("fps", "name"), DAYS)
@pytest.mark.parametrize("form", ["raw", "world"])
def test_treadmill_is_undone(tmp_path, gait, fps, name, form):
    """Speed within 1 %, trunk within 3 cm of its true way (4 in trot), hooves still."""
    horse = make_horse(gait, fps)
    path = tmp_path / f"{name}.txt"
    (write_raw_recording if form == "raw" else write_world_recording)(path, horse)
    clip = read_clip("horse", path, gait=gait)
    assert (clip.source, clip.gait, clip.fps) == ("horse", gait, fps)
    assert speed_of(clip) == pytest.approx(horse.gait.speed, rel=0.01)
    assert stance_slide(clip, horse.contacts) < 0.03
    origin = (horse.withers + horse.hip)[0] / 2 * (1, 1, 0)
    truth = horse.withers - origin
    drift = np.linspace(0, 1, len(clip)) * (clip.withers - truth)[-1, 0]
    assert np.abs(clip.withers[:, 0] - truth[:, 0] - drift).max() < 0.04
    np.testing.assert_allclose(clip.withers[:, 1:], truth[:, 1:], atol=0.005)
    np.testing.assert_allclose(clip.toes[..., 2], horse.toes[..., 2], atol=1e-4)
    # Positions to each other are those of the file, whatever the treadmill did.
    np.testing.assert_allclose(
        (clip.toes - clip.withers[:, None])[..., :2],
        (horse.toes - horse.withers[:, None])[..., :2],
        atol=1e-5,
    )


def test_both_forms_of_a_recording_give_the_same_clip(tmp_path):
    horse = make_horse("trot", 120.0)
    write_raw_recording(tmp_path / "a.csv", horse)
    write_world_recording(tmp_path / "Horse1_M2_trot.txt", horse)
    raw = read_clip("horse", tmp_path / "a.csv", gait="trot", start=100, end=500)
    world = read_clip(
        "horse", tmp_path / "Horse1_M2_trot.txt", gait="trot", start=100, end=500
    )
    np.testing.assert_allclose(raw.withers, world.withers, atol=1e-4)
    np.testing.assert_allclose(raw.toes, world.toes, atol=1e-4)


@pytest.mark.parametrize("swapped", [(0,), (1,), (0, 1)])
@pytest.mark.parametrize("form", ["raw", "world"])
def test_swapped_hooves_are_swapped_back_and_it_is_said(tmp_path, swapped, form):
    horse = make_horse("trot", 120.0)
    path = tmp_path / "horse.txt"
    write = write_raw_recording if form == "raw" else write_world_recording
    write(path, horse, swapped)
    clip = read_clip("horse", path, gait="trot")
    said = " and ".join(("front", "rear")[pair] for pair in swapped)
    assert clip.provenance["swapped"] == f"left and right {said} toes exchanged"
    np.testing.assert_allclose(clip.toes[..., 2], horse.toes[..., 2], atol=1e-4)
    assert (clip.toes[:, [0, 2], 1] > 0).all()
    write(path, horse)
    assert "swapped" not in read_clip("horse", path, gait="trot").provenance


@pytest.mark.parametrize("gait", GAITS)
@pytest.mark.parametrize("fps", [60.0, 120.0])
def test_rate_is_told_by_the_strides_if_the_name_is_silent(tmp_path, gait, fps):
    """Also of 2.5 strides, and with swapped hooves; of one stride it is refused."""
    horse = make_horse(gait, fps)
    path = tmp_path / "unknown.txt"
    for swapped in ((), (0,), (1,)):
        write_world_recording(path, horse, swapped)
        assert read_clip("horse", path, gait="x").fps == fps
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[: round(2.5 * horse.gait.period * fps)]))
    assert read_clip("horse", path, gait="x").fps == fps
    path.write_text("".join(lines[: round(horse.gait.period * fps)]))
    with pytest.raises(InputError, match="--fps 60 or --fps 120"):
        read_clip("horse", path, gait="x")
    assert read_clip("horse", path, gait="x", fps=120.0).fps == 120.0


def test_short_gaps_are_bridged_and_those_of_the_head_do_not_matter(tmp_path):
    """10 frames at 120 Hz are 83 ms; a hoof in stance, withers, head for 1 s."""
    horse = make_horse("walk", 120.0)
    gaps = ((1, 200, 210), (5, 300, 304), (0, 400, 520))
    write_raw_recording(tmp_path / "gaps.csv", horse, gaps=gaps)
    write_raw_recording(tmp_path / "whole.csv", horse)
    clip = read_clip("horse", tmp_path / "gaps.csv", gait="walk")
    whole = read_clip("horse", tmp_path / "whole.csv", gait="walk")
    assert clip.provenance["gaps"] == "14 frames bridged"
    np.testing.assert_allclose(clip.withers, whole.withers, atol=0.003)
    np.testing.assert_allclose(clip.toes, whole.toes, atol=0.01)


def test_long_gap_limits_the_clip_to_its_longer_side(tmp_path):
    horse = make_horse("walk", 120.0)
    write_raw_recording(tmp_path / "a.csv", horse, gaps=((4, 150, 180),))
    clip = read_clip("horse", tmp_path / "a.csv", gait="walk")
    assert clip.provenance["frames"] == "180-720"
    assert (
        len(read_clip("horse", tmp_path / "a.csv", gait="walk", start=0, end=150))
        == 150
    )
    with pytest.raises(
        InputError, match=r"missing within frames 100 to 200 .* 180 to 720"
    ):
        read_clip("horse", tmp_path / "a.csv", gait="walk", start=100, end=200)


def test_names_of_columns_tell_their_order(tmp_path):
    """Hooves written in another order, and without quotes."""
    horse = make_horse("trot", 120.0)
    write_raw_recording(tmp_path / "a.csv", horse)
    rows = [line.split(",") for line in (tmp_path / "a.csv").read_text().splitlines()]
    order = [1, 0, *range(2, 11), *range(20, 23), *range(11, 20)]
    text = "\n".join(",".join(row[k] for k in order) for row in rows).replace('"', "")
    (tmp_path / "b.csv").write_text(text)
    a, b = (
        read_clip("horse", tmp_path / name, gait="trot") for name in ("a.csv", "b.csv")
    )
    np.testing.assert_array_equal(a.toes, b.toes)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("HHLX", "HHL", "header lacks HHLX"),
        ("\n3,0.033", "\n3,0.055", "line 4 the time steps are uneven"),
        ("\n3,0.033", "\n3,", "time column is incomplete"),
        ("\n3,0.033", "\n3,0.033,0.033", "line 4 has 24 columns"),
        ("\n3,0.033", "\n3,soon", "line 4 holds something that is not a number"),
    ],
)
def test_damaged_raw_file_is_refused_with_the_reason(tmp_path, old, new, reason):
    write_raw_recording(tmp_path / "a.csv", make_horse("trot", 60.0, 2.0))
    text = (tmp_path / "a.csv").read_text()
    assert old in text
    (tmp_path / "a.csv").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=reason):
        read_clip("horse", tmp_path / "a.csv", gait="trot")


def test_horse_in_millimetres_without_a_header_is_refused(tmp_path):
    path = tmp_path / "Horse1_M1_trot1.txt"
    write_world_recording(path, make_horse("trot", 60.0, 2.0))
    np.savetxt(path, 1000 * np.loadtxt(path, delimiter=","), delimiter=",")
    with pytest.raises(InputError, match=r"740 m long, not .* \(is the unit of length"):
        read_clip("horse", path, gait="trot")


@pytest.mark.parametrize(
    ("name", "belt"),
    [("M1_walk1", 1.53), ("M1_trot1", 2.91), ("M2_walk1", 1.64), ("M2_trot2", 2.91)],
)
def test_real_horse_goes_at_the_speed_of_the_belt(real_data, name, belt):
    """Within 3 % of the documented belt, from either form, hooves as still as raw."""
    folder = real_data / "horse_vhdc"
    stem = f"Horse1_{name}_kinematics"
    raw = read_clip("horse", folder / "raw_csv" / f"{stem}.csv", gait="x")
    world = read_clip("horse", folder / "keypoints_world" / f"{stem}.txt", gait="x")
    assert raw.fps == world.fps == (60.0 if "M1" in name else 120.0)
    for clip in (raw, world):
        assert speed_of(clip) == pytest.approx(belt, rel=0.03)
    np.testing.assert_allclose(raw.withers, world.withers, atol=0.01)
    velocity = np.gradient(world.toes[..., :2], 1 / world.fps, axis=0)
    speed = np.linalg.norm(velocity, axis=-1)
    stance = (world.toes[..., 2] < 0.02) & (speed < 0.4)
    assert np.median(speed[stance]) < (0.03 if "walk" in name else 0.06)


def test_real_front_hooves_that_are_swapped_are_found_alone(real_data):
    """Horse1_M2_trot2, and none of the other 83."""
    folder = real_data / "horse_vhdc" / "keypoints_world"
    clips = {
        path.name: read_clip("horse", path, gait="x") for path in folder.glob("*.txt")
    }
    swapped = {name for name, clip in clips.items() if "swapped" in clip.provenance}
    assert swapped == {"Horse1_M2_trot2_kinematics.txt"}


def test_real_rates_are_those_of_the_strides(real_data, tmp_path):
    """Copies whose names say nothing; one horse strides alike on two days (8 %)."""
    periods = {}
    for segment in read_segments(real_data):
        if segment.source != "horse" or segment.path.suffix != ".txt":
            continue
        (tmp_path / "copy.txt").write_bytes(segment.path.read_bytes())
        clip = read_clip("horse", tmp_path / "copy.txt", gait="x")
        assert clip.fps == segment.fps
        if segment.path.stem.startswith("Horse1_"):
            x = clip.toes[:, 2, 0] - clip.hip[:, 0]
            x = np.pad(x - x.mean(), (0, 16 * len(x)))
            spectrum = np.abs(np.fft.rfft(x))
            peak = np.fft.rfftfreq(len(x), 1 / clip.fps)[spectrum.argmax()]
            day = segment.path.stem.split("_")[1]
            periods.setdefault((segment.gait, day), []).append(1 / peak)
    for gait in ("walk", "trot"):
        first, second = (np.mean(periods[gait, day]) for day in ("M1", "M2"))
        assert first == pytest.approx(second, rel=0.08)
