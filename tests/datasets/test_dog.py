import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.registry import read_clip
from tests.spoil import spoil
from tests.synthetic import write_dog_recording


@pytest.mark.parametrize("gait", ["pace", "trot", "gallop"])
def test_recording_reads_as_what_it_was_made_of(tmp_path, gait):
    """Z up, start at the origin along +x, toes of each foot on the ground in stance."""
    dog = write_dog_recording(tmp_path / "dog.txt", gait, heading=2.0)
    clip = read_clip("dog", tmp_path / "dog.txt", gait=gait)
    assert clip.fps == 60.0
    assert (clip.source, clip.gait) == ("dog", gait)
    np.testing.assert_allclose(clip.withers, dog.withers, atol=2e-5)
    np.testing.assert_allclose(clip.hip, dog.hip, atol=2e-5)
    np.testing.assert_allclose(clip.toes, dog.toes, atol=2e-5)


def test_stretch_starts_at_its_own_origin_with_the_offsets_of_the_whole_file(tmp_path):
    """Frames 30-34 hold no stance of FR, whose height is still that of the file."""
    dog = write_dog_recording(tmp_path / "dog.txt", "pace")
    clip = read_clip("dog", tmp_path / "dog.txt", gait="pace", start=5, end=15)
    assert not dog.contacts[5:15, 1].any()
    assert len(clip) == 10
    np.testing.assert_allclose(clip.toes[..., 2], dog.toes[5:15, :, 2], atol=2e-5)
    np.testing.assert_allclose((clip.withers + clip.hip)[0, :2], 0.0, atol=1e-9)
    assert (clip.provenance["file"], clip.provenance["frames"]) == ("dog.txt", "5-15")


@pytest.mark.parametrize(("start", "end"), [(-1, 5), (5, 5), (0, 10_000), (7, 3)])
def test_stretch_outside_the_file_is_refused(tmp_path, start, end):
    write_dog_recording(tmp_path / "dog.txt", seconds=1.0)
    with pytest.raises(InputError, match="which has 60 frames"):
        read_clip("dog", tmp_path / "dog.txt", gait="pace", start=start, end=end)


REASONS = {
    "empty": "is empty",
    "blank": "is empty",
    "cut within a line": "line 60 .* cut off",
    "cut within a number": "line 60 .* not a number",
    "nan": "line 8 holds NaN",
    "infinity": "line 8 holds NaN or infinity",
    "words": "line 4 holds something that is not a number",
    "column missing": "line 1 has 80 ",
    "blank line": "line 10 has 1 ",
    "shuffled": "out of order",
    "centimetres": "is the unit of length",
    "binary": "not plain text",
    "zeros": "not plain text",
}


@pytest.mark.parametrize("how", REASONS)
def test_spoilt_file_is_refused_in_one_sentence_that_says_why(tmp_path, how):
    path = tmp_path / "dog.txt"
    write_dog_recording(path, seconds=1.0)
    path.write_bytes(spoil(path.read_text(), how))
    with pytest.raises(InputError, match=REASONS[how]) as error:
        read_clip("dog", path, gait="pace")
    message = str(error.value)
    assert message.startswith(str(path))
    assert message.endswith(".")
    assert "\n" not in message


def test_files_cut_anywhere_are_refused_or_whole(tmp_path):
    """However many bytes survive: refused, or a clip of all lines that are left."""
    path = tmp_path / "dog.txt"
    write_dog_recording(path, seconds=0.2)
    whole = path.read_bytes()
    first = read_clip("dog", path, gait="pace").withers[0]
    for length in np.random.default_rng(2).integers(0, len(whole), 60):
        path.write_bytes(whole[:length])
        try:
            clip = read_clip("dog", path, gait="pace")
        except InputError:
            continue
        assert len(clip) == whole[:length].rstrip().count(b"\n") + 1
        np.testing.assert_allclose(clip.withers[0], first, atol=1e-3)


def test_huge_file_is_refused_without_being_read(tmp_path):
    with (tmp_path / "dog.txt").open("wb") as file:
        file.truncate(10**12)  # sparse
    with pytest.raises(InputError, match="larger than 50 MB"):
        read_clip("dog", tmp_path / "dog.txt", gait="pace")


def test_missing_file_and_folder_are_refused(tmp_path):
    for path in (tmp_path / "none.txt", tmp_path):
        with pytest.raises(InputError, match="There is no file"):
            read_clip("dog", path, gait="pace")


def test_real_trot_has_its_documented_speed_and_markers_on_the_ground(real_data):
    """1.87 m/s along the heading; a tenth of the time each toe is down within 1 cm."""
    path = real_data / "dog_mann" / "keypoints" / "dog_walk04.txt"
    clip = read_clip("dog", path, gait="trot", start=232, end=545)
    trunk = (clip.withers - clip.hip)[:, :2]
    heading = trunk / np.linalg.norm(trunk, axis=-1, keepdims=True)
    velocity = np.gradient((clip.withers + clip.hip)[:, :2] / 2, 1 / 60, axis=0)
    assert (velocity * heading).sum(axis=-1).mean() == pytest.approx(1.87, abs=0.02)
    assert np.abs(np.percentile(clip.toes[..., 2], 10, axis=0)).max() < 0.01
    assert clip.toes[..., 2].max() > 0.15
