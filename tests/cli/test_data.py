import json

import pytest
import tyro

from loco_drake.cli.data import DataInspect, DataList
from loco_drake.cli.main import main
from loco_drake.common.errors import InputError
from tests.synthetic import write_dog_recording
from tests.synthetic_horse import make_horse, write_raw_recording
from tests.synthetic_robots import write_mpc_recording, write_solo8_recording


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
    arguments = [str(file), "--start", "20", "--save", str(tmp_path / "a.png")]
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
    with pytest.raises(InputError, match="3 columns instead of 81"):
        inspect.run()
    assert not (tmp_path / "a.png").exists()


@pytest.mark.parametrize("frames", [1, 3])
def test_inspect_of_fewer_than_four_frames_is_refused(frames, tmp_path, capsys):
    write_dog_recording(tmp_path / "a.txt")
    lines = (tmp_path / "a.txt").read_text().splitlines(keepends=True)
    (tmp_path / "a.txt").write_text("".join(lines[:frames]))
    out = ("--save", str(tmp_path / "a.png"))
    assert main(["data", "inspect", str(tmp_path / "a.txt"), *out]) == 2
    assert capsys.readouterr().err.endswith(
        "a.txt cannot be read as a recording of dog: it needs at least 4 frames, not "
        f"{frames}.\n"
    )
    assert not (tmp_path / "a.png").exists()


def test_list_and_inspect_know_all_sources(tmp_path, capsys):
    rows = ["dataset,file,gait,start_frame,end_frame,fps"]
    files = {
        "horse": tmp_path / "horse_vhdc" / "Horse1_M1_walk1.csv",
        "mpc": tmp_path / "mpc_rfmpc" / "bound.txt",
        "solo8": tmp_path / "solo8_cassi" / "walk" / "a.txt",
    }
    write_raw_recording(files["horse"], make_horse("walk", 60.0))
    write_mpc_recording(files["mpc"], "bound")
    write_solo8_recording(files["solo8"])
    rows.append("horse_vhdc,Horse1_M1_walk1.csv,walk,0,360,60")
    rows.append("mpc_rfmpc,bound.txt,bound,50,500,100")
    rows.append("solo8_cassi,walk/a.txt,walk,20,120,50")
    (tmp_path / "segments.csv").write_text("\n".join(rows) + "\n")
    listing = DataList(data_dir=tmp_path, json=tmp_path / "list.json")
    assert listing.run() == 0
    figures = json.loads((tmp_path / "list.json").read_text())
    assert {source: row["clips"] for source, row in figures.items()} == {
        "dog": 0,
        "horse": 1,
        "mpc": 1,
        "solo8": 1,
    }
    assert figures["horse"]["licence"].startswith("CC BY-SA")
    assert figures["mpc"]["seconds"] == 4.5
    speeds = {"horse": 1.55, "mpc": 0.7, "solo8": 0.4}
    for source, file in files.items():
        out, numbers = tmp_path / f"{source}.png", tmp_path / f"{source}.json"
        inspect = DataInspect(file=file, source=source, out=out, json=numbers)
        assert inspect.run() == 0
        assert out.read_bytes().startswith(b"\x89PNG")
        speed = json.loads(numbers.read_text())["speed_mean_mps"]
        assert speed == pytest.approx(speeds[source], rel=0.02)
    assert "CC BY-SA" in capsys.readouterr().out
