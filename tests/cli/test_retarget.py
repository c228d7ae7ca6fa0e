import json
from dataclasses import replace

import pytest
import tyro

from loco_drake.cli.main import main
from loco_drake.cli.retarget import Retarget
from loco_drake.common.errors import InputError
from loco_drake.models.robots import get_robot, load_robot
from loco_drake.motion.gaits import GaitLabel
from loco_drake.motion.momentum import momentum_error
from loco_drake.motion.motion_file import load_motion, save_motion
from loco_drake.retargeting.journal import JOURNAL
from tests.robot_files import SOLO8
from tests.synthetic import write_dog_recording, write_lying_dog
from tests.synthetic_horse import make_horse, write_world_recording
from tests.synthetic_motion import synthetic_motion
from tests.synthetic_robots import write_mpc_recording, write_solo8_recording

KEYS = {
    "frames",
    "frames_per_second",
    "toe_error_rmse_m",
    "stance_slip_median_mps",
    "penetration_max_m",
    "trunk_correction_rmse_m",
    "joint_limit_violations",
    "joint_speed_ratio_max",
    "correction_rmse_m",
}


def command(*arguments):
    return tyro.cli(Retarget, args=[str(argument) for argument in arguments])


def stop(*_):
    raise KeyboardInterrupt


def test_batch_writes_motions_json_and_table(made_data, tmp_path, capsys):
    arguments = ("--data-dir", made_data, "--out", tmp_path / "out")
    choice = ("--gait", "pace", "--gait", "trot", "--json", tmp_path / "a.json")
    assert command(*arguments, *choice).run() == 0
    figures = json.loads((tmp_path / "a.json").read_text())
    names = ["dog-pace-made_pace-0-240", "dog-trot-made_trot-0-240"]
    assert list(figures) == names
    for name in names:
        assert set(figures[name]) >= KEYS
        motion = load_motion(tmp_path / "out" / f"{name}.npz")
        assert len(motion) == figures[name]["frames"] == 200
    printed = capsys.readouterr().out
    assert all(name in printed for name in names)


def test_a_run_that_was_stopped_is_continued(made_data, tmp_path, monkeypatch):
    """Figures and files are those of a run in one go, of the same options."""
    out, json_file = tmp_path / "out", tmp_path / "a.json"
    line = ("--data-dir", made_data, "--out", out, "--json", json_file)
    gaits = ("--gait", "pace", "--gait", "trot")
    with pytest.raises(InputError, match=r"No run of retarget in .*--resume"):
        command(*line, *gaits, "--resume").run()
    assert not out.exists()
    assert command(*line, *gaits).run() == 0
    first = json.loads(json_file.read_text())
    motion = out / "dog-trot-made_trot-0-240.npz"
    content = motion.read_bytes()
    assert not (out / JOURNAL).exists()
    with monkeypatch.context() as patch:
        patch.setattr(Retarget, "_tell", stop)
        with pytest.raises(KeyboardInterrupt):
            command(*line, *gaits).run()
    motion.unlink()
    kept = out / "dog-pace-made_pace-0-240.npz"
    written = kept.stat().st_mtime_ns
    with pytest.raises(InputError, match="made with other mirror;"):
        command(*line, *gaits, "--resume", "--mirror").run()
    assert command(*line, *gaits, "--resume").run() == 0
    assert kept.stat().st_mtime_ns == written
    again = json.loads(json_file.read_text())
    for figures in (*first.values(), *again.values()):
        del figures["frames_per_second"]
    assert again == first
    assert motion.read_bytes() == content
    assert not (out / JOURNAL).exists()


def test_files_tell_their_side_and_trajectories_are_cut(made_data, tmp_path, capsys):
    """A pace of 4 s, 200 frames, holds two; both processes write the same split."""
    out = tmp_path / "go2"
    options = ("--data-dir", made_data, "--gait", "pace", "--workers", 2)
    assert command(*options, "--out", out).run() == 0
    motion = load_motion(out / "dog-pace-made_pace-0-240.npz")
    assert motion.provenance["split"] == "train"  # the only one of its label
    folder = tmp_path / "go2-trajectories"
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["dog-pace-0.npz", "dog-pace-1.npz"]
    cuts = [load_motion(folder / name) for name in names]
    assert sorted(c.provenance["frames"] for c in cuts) == ["0-120", "120-240"]
    assert {c.provenance["recording"] for c in cuts} == {"made_pace"}
    assert "Trajectories of 2 s" in capsys.readouterr().out
    none = ("--trajectories", 0, "--out", tmp_path / "a")
    assert command(*options[:4], *none).run() == 0
    assert not (tmp_path / "a-trajectories").exists()


def test_steered_variants_are_written_but_not_of_validation(
    made_data, tmp_path, capsys
):
    out = tmp_path / "out"
    arguments = ("--data-dir", made_data, "--out", out, "--trajectories", "0")
    assert (
        command(*arguments, "--gait", "pace", "--gait", "trot", "--steered", "2").run()
        == 0
    )
    plain = [path for path in out.glob("*.npz") if "steered" not in path.stem]
    sides = {path: load_motion(path).provenance["split"] for path in plain}
    for path, side in sides.items():
        variants = sorted(out.glob(f"{path.stem}-steered*.npz"))
        assert len(variants) == (0 if side == "validation" else 2)
        for variant in variants:
            steered = load_motion(variant)
            assert steered.provenance["split"] == side
            assert "m/s forward" in steered.provenance["steered_by"]
    count = 2 * sum(side != "validation" for side in sides.values())
    assert count > 0
    assert f"Steered variants: {count}." in capsys.readouterr().out
    with pytest.raises(InputError, match="three joints in each leg"):
        command(*arguments, "--robot", SOLO8, "--steered", "1").run()


def test_one_file_with_a_stretch_for_the_a1(made_data, tmp_path):
    file = made_data / "dog_mann" / "keypoints" / "made_trot.txt"
    options = ("--source", "dog", "--gait", "trot", "--robot", "a1", "--start", 60)
    assert command(file, *options, "--end", 180, "--out", tmp_path).run() == 0
    motion = load_motion(tmp_path / "dog-trot-made_trot-60-180.npz")
    assert motion.robot == "a1"
    assert len(motion) == 100  # 119 steps of 1/60 s are 99.2 of 20 ms


def test_mirrored_in_its_own_time_goes_to_a_folder_of_its_own(
    made_data, tmp_path, monkeypatch, capsys
):
    """The dog's .44 m to the Go2's height: the root of the ratio, in all outputs."""
    monkeypatch.chdir(tmp_path)
    options = ("--data-dir", made_data, "--gait", "trot", "--trajectories", 1)
    both = ("--mirror", "--froude", "--json", "a.json")
    assert command(*options, *both).run() == 0
    name = "dog-trot-made_trot-0-240"
    motion = load_motion(tmp_path / "motions" / "go2-mirrored-froude" / f"{name}.npz")
    (cut,) = (tmp_path / "motions" / "go2-mirrored-froude-trajectories").iterdir()
    time_scale = (get_robot("go2").stand_height / 0.44) ** 0.5
    figures = json.loads((tmp_path / "a.json").read_text())[name]
    assert figures["time_scale"] == pytest.approx(time_scale, rel=1e-3)
    assert figures["mirrored"] is True
    assert len(motion) == int(239 / 60 * time_scale * 50) + 1
    for part in (motion, load_motion(cut)):
        assert part.provenance["mirrored"] == "left-right"
        assert float(part.provenance["time_scale"]) == pytest.approx(
            time_scale, rel=1e-3
        )
    printed = capsys.readouterr().out
    assert "mirrored" in printed
    assert f" {time_scale:.2f} " in printed


def test_help_explains_the_options(capsys):
    with pytest.raises(SystemExit):
        command("--help")
    page = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "--mirror" in page
    assert "Exchange left and right" in page
    assert "--froude" in page
    assert "Scale time to keep the animal's Froude number" in page


def test_robot_that_is_only_a_file(made_data, tmp_path, monkeypatch, capsys):
    """By its path, in two processes, to a folder of its name; cut like any other."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_solo8.yaml").write_text(SOLO8.read_text())
    options = ("--data-dir", made_data, "--source", "dog", "--gait", "trot")
    robot = ("--robot", "my_solo8.yaml", "--workers", 2, "--json", "a.json")
    assert command(*options, *robot).run() == 0
    name = "dog-trot-made_trot-0-240"
    motion = load_motion(tmp_path / "motions" / "my_solo8" / f"{name}.npz")
    assert (motion.robot, motion.joint_positions.shape) == ("my_solo8", (200, 8))
    assert motion.joint_names == load_robot("my_solo8.yaml").joint_names
    figures = json.loads((tmp_path / "a.json").read_text())[name]
    assert figures["stance_slip_median_mps"] < 0.03
    cuts = [*(tmp_path / "motions" / "my_solo8-trajectories").iterdir()]
    assert [load_motion(cut).joint_positions.shape for cut in cuts] == [(100, 8)] * 2
    file = made_data / "dog_mann" / "keypoints" / "made_trot.txt"
    assert command(file, *options[2:], "--robot", SOLO8, "--out", "one").run() == 0
    assert load_motion(tmp_path / "one" / f"{name}.npz").robot == "solo8"


def test_robots_that_can_only_be_retargeted_to_are_refused_elsewhere(
    made_data, tmp_path, capsys
):
    """One sentence that says what simulation takes, or names go2 and a1."""
    file = made_data / "dog_mann" / "keypoints" / "made_trot.txt"
    one = ("--source", "dog", "--gait", "trot", "--robot", SOLO8, "--out", tmp_path)
    assert command(file, *one).run() == 0
    motion = tmp_path / "dog-trot-made_trot-0-240.npz"
    commands = [
        ("simulate", "--robot", SOLO8, "--no-meshcat"),
        ("simulate", "--robot", "go2", "--reference", motion, "--no-meshcat"),
        ("generate", "--robot", SOLO8),
        ("train", "tokenizer", "--motions", tmp_path, "--out", tmp_path / "t"),
        ("train", "tracker", "--robot", SOLO8, "--motions", tmp_path),
        ("evaluate", "tracking", "--robot", SOLO8),
    ]
    capsys.readouterr()
    for arguments in commands:
        assert main([str(argument) for argument in arguments]) == 2, arguments
        message = capsys.readouterr().err
        assert message.count("\n") == 1
        assert "go2" in message or "To be simulated" in message, message


def test_bad_clip_in_a_batch_is_reported_with_status_1(made_data, tmp_path, capsys):
    table = (made_data / "segments.csv").read_text()
    (tmp_path / "dog_mann").symlink_to(made_data / "dog_mann")
    extra = "dog_mann,keypoints/made_pace.txt,pace,0,9999,60,1,\n"
    (tmp_path / "segments.csv").write_text(table + extra)
    options = ("--data-dir", tmp_path, "--gait", "pace", "--out", tmp_path / "out")
    assert command(*options, "--json", tmp_path / "a.json").run() == 1
    message = capsys.readouterr().err
    assert "Failed: dog-pace-made_pace-0-9999: " in message
    assert "recording of dog: frames 0 to 9999" in message
    figures = json.loads((tmp_path / "a.json").read_text())
    assert "error" in figures["dog-pace-made_pace-0-9999"]
    assert (tmp_path / "out" / "dog-pace-made_pace-0-240.npz").is_file()


def test_wrong_input_raises_one_sentence(made_data, tmp_path):
    data = ("--data-dir", made_data, "--out", tmp_path)
    file = made_data / "dog_mann" / "keypoints" / "made_trot.txt"
    wrong = {
        ("--robot", "spot", *data): "'spot'; the choices are go2, a1",
        ("--gait", "fly", *data): "gait of any source 'fly'; the choices are pace",
        ("--workers", "0", *data): "--workers must be 1 or more",
        ("--trajectories", "-1", *data): "--trajectories must be 0 or more",
        ("--start", "3", *data): "need a FILE",
        (file, "--gait", "trot"): "needs its --source and one --gait",
        (file, "--source", "cat", "--gait", "trot"): "'cat'; the choices are dog",
        (tmp_path / "no", "--source", "dog", "--gait", "trot"): "There is no file",
        ("--data-dir", tmp_path / "no"): "There is no data folder",
    }
    for arguments, reason in wrong.items():
        with pytest.raises(InputError, match=reason):
            command(*arguments).run()


def test_truncated_file_is_wrong_input_and_leaves_nothing_behind(made_data, tmp_path):
    whole = (made_data / "dog_mann" / "keypoints" / "made_trot.txt").read_text()
    (tmp_path / "cut.txt").write_text(whole[:-100])
    out = tmp_path / "out"
    options = ("--source", "dog", "--gait", "trot", "--out", out)
    with pytest.raises(InputError, match="cut off"):
        command(tmp_path / "cut.txt", *options).run()
    assert not out.exists()


SOURCES = {
    "horse": ("Horse14_M3_trot1.txt", "trot", 6.0),
    "mpc": ("trot_0.9_1_50.txt", "trot", 5.0),
    "solo8": ("motion_data_7.txt", "walk", 2.0),
}


def write_recording(source, folder):
    path = folder / SOURCES[source][0]
    match source:
        case "horse":
            write_world_recording(path, make_horse("trot", 120.0))
        case "mpc":
            write_mpc_recording(path, "trot")
        case "solo8":
            write_solo8_recording(path)
    return path


@pytest.mark.parametrize("source", SOURCES)
def test_recording_never_seen_before_needs_neither_code_nor_segments(tmp_path, source):
    """Without a data folder; the length at 50 Hz tells that the rate was found."""
    file, (_, gait, seconds) = write_recording(source, tmp_path), SOURCES[source]
    options = ("--source", source, "--gait", gait, "--robot", "a1", "--out", tmp_path)
    assert command(file, *options).run() == 0
    (path,) = tmp_path.glob(f"{source}-{gait}-{file.stem}-*.npz")
    motion = load_motion(path)
    assert (motion.robot, str(motion.label)) == ("a1", f"{source}-{gait}")
    if source == "solo8":
        assert path.stem.endswith("-20-120")
    assert len(motion) == pytest.approx(50 * seconds, abs=1)
    assert motion.provenance["licence"]
    assert command(file, *options, "--start", 30, "--end", 70).run() == 0
    assert (tmp_path / f"{source}-{gait}-{file.stem}-30-70.npz").is_file()


def test_rate_given_by_hand_is_taken_unless_the_strides_contradict_it(tmp_path):
    """720 frames at 100 frames/s are 7.2 s, at 60 twice as long as the 120 in them."""
    file = write_recording("horse", tmp_path)
    options = ("--source", "horse", "--gait", "trot", "--out", tmp_path)
    assert command(file, *options, "--fps", 100).run() == 0
    motion = load_motion(tmp_path / f"horse-trot-{file.stem}-0-720.npz")
    assert len(motion) == pytest.approx(360, abs=1)
    with pytest.raises(InputError, match="motion implies 120"):
        command(file, *options, "--fps", 60).run()
    with pytest.raises(InputError, match="--fps need a FILE"):
        command("--fps", 60, "--out", tmp_path).run()


def test_folder_without_one_of_the_fifteen_gaits_says_what_is_there(tmp_path):
    write_dog_recording(tmp_path / "dog_mann" / "a.txt", "trot")
    rows = (
        "dataset,file,gait,start_frame,end_frame,fps\ndog_mann, a.txt, amble,0,99,60\n"
    )
    (tmp_path / "segments.csv").write_text(rows)
    options = ("--data-dir", tmp_path, "--out", tmp_path / "out")
    with pytest.raises(InputError, match=r"none of the fifteen .* only dog-amble"):
        command(*options).run()
    assert not (tmp_path / "out").exists()
    assert command(*options, "--gait", "amble").run() == 0
    assert (tmp_path / "out" / "dog-amble-a-0-99.npz").is_file()


def test_file_of_another_source_leaves_nothing_behind(tmp_path):
    file = write_recording("mpc", tmp_path)
    options = ("--source", "solo8", "--gait", "trot", "--out", tmp_path / "out")
    with pytest.raises(InputError, match="cannot be read as a recording of solo8"):
        command(file, *options).run()
    assert not (tmp_path / "out").exists()


def test_dog_that_lies_before_it_trots_is_warned_of(tmp_path, capsys):
    """Four seconds .34 m lower or rising: the scale is that of the standing dog.

    The file is written, --strict or not; that only decides the exit status.
    """
    write_lying_dog(tmp_path / "lies.txt")
    file = (tmp_path / "lies.txt", "--source", "dog", "--gait", "trot")
    to = ("--out", tmp_path, "--json", tmp_path / "a.json")
    name = "dog-trot-lies-0-480"
    for strict, status in (((), 0), (("--strict",), 1)):
        assert command(*file, *to, *strict).run() == status
        (figures,) = json.loads((tmp_path / "a.json").read_text()).values()
        scale = get_robot("go2").stand_height / 0.44
        assert figures["scale"] == pytest.approx(scale, rel=1e-3)
        assert figures["on_feet_frames"] == "218-480"
        printed = capsys.readouterr()
        assert f"{name} (!)" in printed.out
        assert "(!) Outside their bounds, see the warnings: 1" in printed.out
        warning = f"Warning: {name}: frames on its feet 54.6 % (218-480), not at"
        assert warning in printed.err
        motion = load_motion(tmp_path / f"{name}.npz")
        assert motion.provenance["warnings"] == "; ".join(figures["warnings"])


def test_good_clips_pass_strict_without_a_word(made_data, tmp_path, capsys):
    options = ("--data-dir", made_data, "--gait", "trot", "--trajectories", 0)
    assert command(*options, "--out", tmp_path, "--strict").run() == 0
    printed = capsys.readouterr()
    assert "Warning" not in printed.out + printed.err
    assert "(!)" not in printed.out


def test_data_without_one_of_the_fifteen_gaits_says_how_to_retarget_it(
    made_data, tmp_path
):
    """An empty table would look like success."""
    (tmp_path / "dog_mann").symlink_to(made_data / "dog_mann")
    head = (made_data / "segments.csv").read_text().splitlines()[0]
    row = "dog_mann,keypoints/made_pace.txt,walk,0,200,60,1,"
    (tmp_path / "segments.csv").write_text(f"{head}\n{row}\n")
    with pytest.raises(InputError, match=r"only dog-walk: .* --gait walk"):
        command("--data-dir", tmp_path, "--out", tmp_path).run()
    walk = ("--data-dir", tmp_path, "--gait", "walk", "--out", tmp_path)
    assert command(*walk, "--trajectories", 0).run() == 0


def test_grounded_motion_goes_to_a_folder_of_its_own(
    made_data, tmp_path, monkeypatch, capsys
):
    """With its price in the JSON file and the table; other robots have no masses."""
    monkeypatch.chdir(tmp_path)
    options = ("--data-dir", made_data, "--gait", "trot", "--trajectories", 0)
    assert command(*options, "--ground", "--json", "a.json", "--steered", 1).run() == 0
    folder = tmp_path / "motions" / "go2-grounded"
    name = "dog-trot-made_trot-0-240"
    figures = json.loads((tmp_path / "a.json").read_text())[name]
    assert figures["momentum_error"] < 0.2 * figures["momentum_error_before"]
    assert 0 < figures["ground_correction_rmse_m"] < 0.025
    assert "grounding" not in figures
    told = load_motion(folder / f"{name}.npz").provenance["momentum_error"]
    assert float(told) == pytest.approx(figures["momentum_error"], rel=1e-5)
    assert "moved" in capsys.readouterr().out
    robot = get_robot("go2")
    for steered in folder.glob("*-steered0.npz"):
        assert momentum_error(load_motion(steered), robot) < 0.1
    with pytest.raises(InputError, match="three joints in each leg"):
        command(*options, "--robot", SOLO8, "--ground").run()


def test_motion_of_another_robot(tmp_path, capsys):
    """A Go2's becomes the A1's: its gait, its contacts, its own lengths."""
    given = synthetic_motion(seconds=3.0, name="go2")
    file, out = tmp_path / "mine.npz", tmp_path / "out"
    save_motion(given, file)
    line = (file, "--robot", "a1", "--ground", "--out", out)
    assert command(*line, "--json", tmp_path / "a.json").run() == 0
    made = load_motion(out / "mine.npz")
    assert (made.robot, made.label) == ("a1", given.label)
    assert (made.contacts == given.contacts).all()
    assert made.provenance["moved_from"] == "go2"
    (figures,) = json.loads((tmp_path / "a.json").read_text()).values()
    assert figures["path"] == str(out / "mine.npz")
    assert figures["stance_slip_median_mps"] < 1e-3
    assert momentum_error(made, get_robot("a1")) < 0.06
    assert "mine" in capsys.readouterr().out


def refused(line, sentence, out):
    with pytest.raises(InputError, match=sentence):
        command(*line, "--out", out).run()
    assert not list(out.glob("*.npz")) or out.samefile(line[0].parent)


def test_motion_that_cannot_be_retargeted(tmp_path):
    given = synthetic_motion(seconds=2.0, name="go2")
    file, out = tmp_path / "mine.npz", tmp_path / "out"
    save_motion(given, file)
    refused((file, "--gait", "trot"), "a Motion file has its own", out)
    refused((file, "--resume"), "--resume is for recordings", out)
    refused((file, "--robot", "a1"), "would be replaced", tmp_path)
    assert load_motion(file).robot == "go2"
    changes = ((0, given.label), (50, GaitLabel("mpc", "trot")))
    save_motion(replace(given, gait_changes=changes), tmp_path / "two.npz")
    refused((tmp_path / "two.npz", "--robot", "a1"), "changes its gait", out)
    save_motion(replace(given, robot="stranger"), tmp_path / "stranger.npz")
    refused((tmp_path / "stranger.npz",), "motion of go2 and a1 can be", out)
    refused((tmp_path / "none.npz",), "There is no Motion file", out)
