import json

import pytest
import tyro

from loco_drake.cli.data import DataInspect, DataList
from loco_drake.errors import InputError


def test_list_counts_clips_frames_seconds_and_names_the_licence(
    made_data, tmp_path, capsys
):
    """Three clips of 240 frames at 60 Hz: 720 frames, 12 s."""
    path = tmp_path / "a.json"
    listing = tyro.cli(
        DataList, args=["--data-dir", str(made_data), "--json", str(path)]
    )
    assert listing.run() == 0
    dog = json.loads(path.read_text())["dog"]
    assert (dog["clips"], dog["frames"], dog["seconds"]) == (3, 720, 12.0)
    assert dog["gaits"] == {"pace": 1, "trot": 1, "gallop": 1}
    assert dog["licence"] == "CC BY-NC 4.0"
    assert "CC BY-NC 4.0" in capsys.readouterr().out


def test_inspect_draws_a_stretch_and_prints_its_gait(made_data, tmp_path, capsys):
    file = made_data / "dog_mann" / "keypoints" / "made_trot.txt"
    arguments = [str(file), "--start", "20", "--out", str(tmp_path / "a.png")]
    arguments += ["--json", str(tmp_path / "a.json")]
    assert tyro.cli(DataInspect, args=arguments).run() == 0
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    figures = json.loads((tmp_path / "a.json").read_text())
    assert figures["frames"] == 220
    assert figures["speed_mean_mps"] == pytest.approx(1.8, rel=1e-3)
    assert "stride period" in capsys.readouterr().out


def test_inspect_of_a_file_of_another_format_leaves_no_picture(tmp_path):
    (tmp_path / "horse.txt").write_text("1,2,3\n4,5,6\n")
    inspect = DataInspect(file=tmp_path / "horse.txt", out=tmp_path / "a.png")
    with pytest.raises(InputError, match="3 comma-separated columns instead of 81"):
        inspect.run()
    assert not (tmp_path / "a.png").exists()
