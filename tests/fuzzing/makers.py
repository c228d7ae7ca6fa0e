"""Makes the sound files that are damaged, and whatever else a command needs."""

import csv
import hashlib
import shutil
from collections.abc import Callable
from pathlib import Path

TOKENIZER = "train tokenizer --motions motions --steps 2 --out out/run"
TRACKER = (
    "train tracker --motions motions --steps 64 --batch 32 --workers 1 "
    "--per-worker 2 --out out/run --json out/figures.json"
)
DRIVE = "drive --no-meshcat --duration 0.12"


def motion(
    folder: Path,
    name: str = "motion.npz",
    label: str = "dog-trot",
    seconds: float = 1.0,
) -> None:
    from loco_drake.motion.motion_file import save_motion
    from tests.synthetic_motion import synthetic_motion

    save_motion(synthetic_motion(label, seconds), folder / name)


def policy(folder: Path) -> None:
    from loco_drake.models.shipped import pretrained_path

    motion(folder)
    shutil.copy(pretrained_path("policy_go2"), folder / "policy.safetensors")


def model(folder: Path) -> None:
    from loco_drake.common.weights import save_network
    from tests.tiny_model import make_tiny_model

    model = make_tiny_model()
    save_network(
        folder / "tokenizer.safetensors", "tokenizer", model.tokenizer, half=True
    )
    save_network(
        folder / "generator.safetensors", "generator", model.generator, half=True
    )


def references(folder: Path) -> None:
    for label in ("dog-trot", "dog-pace"):
        motion(folder, f"motions/{label}.npz", label, 2.0)


def _run(folder: Path, *command: str) -> None:
    """Makes what a training leaves, by the command itself."""
    from tests.fuzzing.worker import Worker

    worker = Worker()
    run = worker.run(list(command), folder, seconds=200.0)
    worker.close()
    assert run.status == 0, run.stderr


def tokenizer_run(folder: Path) -> None:
    references(folder)
    _run(folder, *TOKENIZER.split())


def tracker_run(folder: Path) -> None:
    references(folder)
    _run(folder, *TRACKER.split())
    for name in ("checkpoint", "policy"):
        shutil.copy(folder / f"out/run/{name}.safetensors", folder)


def start(folder: Path) -> None:
    tracker_run(folder)
    shutil.rmtree(folder / "out")


def recording(form: str, file: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        from tests import synthetic, synthetic_bvh, synthetic_horse, synthetic_robots

        path = folder / file
        match form:
            case "dog":
                synthetic.write_dog_recording(path, "trot", seconds=2.0)
            case "dog BVH":
                synthetic_bvh.write_dog_bvh(path, "trot", seconds=1.5)
            case "horse":
                horse = synthetic_horse.make_horse("trot", 60.0, 3.0)
                synthetic_horse.write_world_recording(path, horse)
            case "horse, raw":
                horse = synthetic_horse.make_horse("walk", 60.0, 4.0)
                synthetic_horse.write_raw_recording(path, horse)
            case "mpc":
                synthetic_robots.write_mpc_recording(path, "trot", seconds=2.0)
            case "solo8":
                synthetic_robots.write_solo8_recording(path)

    return make


def data(folder: Path) -> None:
    from tests.synthetic import write_data_folder

    write_data_folder(folder / "data", ("pace", "trot"), 2.0)


def mirror(folder: Path) -> None:
    from tests.synthetic import write_data_folder

    mirror = write_data_folder(folder / "mirror", ("pace", "trot"), 1.0)
    rows = [["file", "repository", "commit", "path", "bytes", "sha256"]]
    for path in sorted(mirror.rglob("*.txt")):
        content = path.read_bytes()
        name = path.relative_to(mirror).as_posix()
        checksum = hashlib.sha256(content).hexdigest()
        rows.append([name, "owner/name", "0" * 40, name, str(len(content)), checksum])
    with (folder / "manifest.csv").open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
    shutil.copy(mirror / "segments.csv", folder / "shipped.csv")


def fetched(folder: Path) -> None:
    mirror(folder)
    shutil.copytree(folder / "mirror", folder / "out/data")


def robot(folder: Path) -> None:
    from tests.made_inputs import robot_yaml, urdf

    recording("dog", "dog.txt")(folder)
    (folder / "robot.urdf").write_text(urdf())
    (folder / "robot.yaml").write_text(robot_yaml("robot.urdf"))


def sources(folder: Path) -> None:
    from loco_drake.retargeting import scaling

    recording("dog", "dog.txt")(folder)
    shutil.copytree(Path(scaling.__file__).parent / "sources", folder / "sources")


def results() -> list[str]:
    """Returns the name of one shipped result of each command that writes some."""
    from loco_drake.models.shipped import results_path

    stems = [path.stem for path in results_path("any").parent.glob("*.json")]
    families: dict[str, str] = {}
    for stem in sorted(stems, reverse=True):
        families[stem.split("-")[0]] = stem
    return sorted(families.values())


def result(name: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        from loco_drake.models.shipped import results_path

        (folder / "results").mkdir()
        shutil.copy(results_path(name), folder / "results")

    return make


def scenario(folder: Path) -> None:
    motion(folder)
    (folder / "scenario.yaml").write_text(
        "robot: go2\n"
        "plant: {contact: similar, time_step: 0.01, friction: 0.8}\n"
        "reference: !MotionReference {path: motion.npz}\n"
        "policy: !TrainedPolicy {}\n"
    )


def commands(folder: Path) -> None:
    (folder / "commands.csv").write_text(
        "time,forward,sideways,yaw_rate,gait,push,reset\n"
        "0,0.3,0,0,,0,0\n"
        "0.04,0.5,0.1,0.2,dog-pace,10,0\n"
        "0.08,0.5,-0.1,0,,0,1\n"
        "0.1,0.4,0,-0.1,dog-trot,0,0\n"
    )


def drive(folder: Path) -> None:
    commands(folder)
    _run(folder, *f"{DRIVE} --commands commands.csv --record drive.jsonl".split())
