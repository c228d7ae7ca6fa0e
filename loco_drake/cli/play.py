"""``loco-drake play``: shows motion without physics."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from loco_drake.cli.options import (
    DataDir,
    Html,
    Json,
    Port,
    UnusedSeed,
    Video,
    option,
)
from loco_drake.cli.output import do_all, print_table, say, write_json
from loco_drake.cli.simulation import save_page, start_meshcat
from loco_drake.cli.video import make_video, prepare_video
from loco_drake.common.errors import InputError, one_line

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

    from loco_drake.models.legged import LeggedRobot
    from loco_drake.motion.keypoints import KeypointClip
    from loco_drake.motion.motion import Motion
    from loco_drake.viewing.stage import Stage
    from loco_drake.viewing.takes import Take

# Beside each other; a page of more would be slow, and 2 MB larger by each.
_MOST = 12
_PERIOD = 1 / 50  # s between looks at the controls


@dataclass(kw_only=True)
class Play:
    """Show Motion files in the browser, on a page or in a video, without physics.

    They are shown one after another, over and over, until Ctrl-C or the page's button;
    with --html or --video, files are written instead.
    Space pauses, left and right step by a frame, up and down by a file; a slider goes
    to any frame.
    """

    # Motion files.
    files: Annotated[tuple[Path, ...], tyro.conf.Positional, option(metavar="FILE ...")]
    # Robot: the YAML file of one that motion is of, such as examples/solo8.yaml; may be
    # repeated. go2, a1 and g1 are known.
    robot: Annotated[
        tuple[str, ...], tyro.conf.UseAppendAction, option(metavar="ROBOT|FILE")
    ] = ()
    # Show all files at the same time.
    side_by_side: bool = False
    # Show to the left of each robot the keypoints that it was retargeted from, in its
    # size, where the recording is in the data folder.
    source: Annotated[bool, option(name="keypoints")] = False
    data_dir: DataDir = None
    port: Port = None
    html: Html = None
    video: Video = None
    json: Json = None
    seed: UnusedSeed = 0

    def run(self) -> int:
        """Shows, prints and writes; returns the exit status."""
        from loco_drake.viewing.stage import Stage
        from loco_drake.viewing.takes import one_by_one, side_by_side

        takes, rows = self._read()
        scenes = (side_by_side(takes),) if self.side_by_side else one_by_one(takes)
        seconds = sum(scene.duration for scene in scenes)
        if self.video is not None:
            prepare_video(self.video, seconds)
        live = self.html is None and self.video is None
        columns = ("file", "robot", "label", "frames", "seconds")
        cells = [[_cell(row[name]) for name in columns] for row in rows]
        do_all(
            lambda: print_table(f"Motion files: {len(rows)}", columns, cells),
            lambda: write_json(self.json, {"files": rows, "seconds": seconds}),
        )
        if live or self.html is not None:
            meshcat = start_meshcat(self.port, announce=live)
            stage = Stage(scenes, meshcat)
            if self.html is not None:
                from loco_drake.viewing.replay import record

                save_page(meshcat, self.html, record(stage, meshcat))
        if self.video is not None:
            make_video(self.video, scenes)
        if live:
            _play(stage, meshcat)
        return 0

    def _read(self) -> "tuple[list[Take], list[dict[str, Any]]]":
        """Returns the takes, and what is said of each file.

        Raises:
            InputError: if there is no file, one is damaged, or its robot unknown.
        """
        from loco_drake.datasets.registry import data_dir
        from loco_drake.motion.motion_file import load_motion
        from loco_drake.viewing.takes import take_of_motion

        if not self.files:
            raise InputError("Name at least one Motion file to play.")
        if self.side_by_side and len(self.files) > _MOST:
            raise InputError(
                f"At most {_MOST} files can be shown side by side, not "
                f"{len(self.files)}."
            )
        robots = self._robots()
        folder = data_dir(self.data_dir) if self.source else None
        takes, rows = [], []
        for path in self.files:
            motion = load_motion(path)
            robot = _robot_of(motion, path, robots)
            clip = None if folder is None else _clip_of(motion, path, folder)
            takes.append(take_of_motion(one_line(path.name), motion, robot, clip))
            row = {
                "file": str(path),
                "robot": motion.robot,
                "label": str(motion.label),
                "frames": len(motion),
                "seconds": motion.duration,
            }
            if folder is not None:
                row["source"] = None if clip is None else clip.provenance["file"]
            rows.append(row)
        return takes, rows

    def _robots(self) -> "dict[str, LeggedRobot]":
        from loco_drake.models.robots import ROBOTS, load_figure

        robots = [load_figure(definition) for definition in (*ROBOTS, *self.robot)]
        return {robot.name: robot for robot in robots}


def _robot_of(
    motion: "Motion", path: Path, robots: "dict[str, LeggedRobot]"
) -> "LeggedRobot":
    """Returns the robot of a motion.

    Raises:
        InputError: if it is none of ``robots``, or has other joints.
    """
    from loco_drake.models.biped_file import BIPEDS, read_biped

    robot = robots.get(motion.robot)
    if robot is None and motion.robot in BIPEDS:
        robot = read_biped(motion.robot)
    if robot is None:
        raise InputError(
            f"{path} is a motion of {motion.robot}, not of {', '.join(robots)}: name "
            "the YAML file of its robot with --robot."
        )
    if motion.joint_names != robot.joint_names:
        raise InputError(
            f"{path} is a motion of another {motion.robot}, whose joints are "
            f"{', '.join(motion.joint_names)}."
        )
    return robot


def _clip_of(motion: "Motion", path: Path, folder: Path) -> "KeypointClip | None":
    """Returns what a motion was retargeted from; says why if it cannot be shown."""
    from loco_drake.viewing.source_clip import source_clip

    try:
        return source_clip(motion, folder)
    except InputError as error:
        say(f"{path} is shown without its source: {error}")
        return None


def _play(stage: "Stage", meshcat: "Meshcat") -> None:
    """Plays until the page's button or Ctrl-C."""
    from loco_drake.viewing.player import Player

    print("Play on that page; its Stop button or Ctrl-C ends.", flush=True)
    player = Player(stage, meshcat)
    before = time.perf_counter()
    try:
        while not player.stopped:
            time.sleep(_PERIOD)
            now = time.perf_counter()
            player.update(now - before)
            before = now
    except KeyboardInterrupt:
        pass


def _cell(value: object) -> str:
    return f"{value:.2f}" if isinstance(value, float) else str(value)
