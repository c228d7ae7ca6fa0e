"""What is shown: one robot's motion is a take, takes beside each other are a scene."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from loco_drake.common.arrays import Array
from loco_drake.common.rotations import (
    quat_multiply,
    quat_rotate,
    yaw_of,
    yaw_quat,
)
from loco_drake.control.state import ORIENTATION, POSITION
from loco_drake.models.legged import LeggedRobot
from loco_drake.motion.keypoints import KeypointClip
from loco_drake.motion.momentum import positions
from loco_drake.motion.motion import Motion
from loco_drake.retargeting.scaling import resample
from loco_drake.viewing.captions import Caption, Track, caption_at

# s around a time of which the speed is told, and after a change of gait in which it
# stands out.
_AROUND, _CHANGING = 0.5, 2.0
# Width of the lane that a robot has for itself, over its height.
_LANE = 2.2


@dataclass(frozen=True, eq=False)
class Take:
    """What one robot is shown to do, and six points that are shown with it.

    Points are the toes FL, FR, RL, RR, the withers and the hip.
    """

    title: str  # what the page calls it, beside its gait
    robot: LeggedRobot
    fps: float  # frames/s
    q: Array  # [q_WB as w x y z, p_WB, joints], m and rad, shape (T, 7 + J)
    points: Array | None = None  # p_WK, m, shape (T, 6, 3)
    gaits: tuple[tuple[int, str], ...] = ()  # first frame and label of each

    def __len__(self) -> int:
        return len(self.q)

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return (len(self) - 1) / self.fps

    def index(self, time: float) -> int:
        """Returns the frame nearest to ``time`` in s, the last one if it is over."""
        return min(max(round(time * self.fps), 0), len(self) - 1)

    def gait(self, time: float) -> tuple[str, bool]:
        """Returns the gait at ``time`` in s, and whether it has just changed."""
        frame = self.index(time)
        begun = [gait for gait in self.gaits if gait[0] <= frame]
        if not begun:
            return "", False
        (start, name), before = begun[-1], begun[-2:-1]
        if not before or frame - start > _CHANGING * self.fps:
            return name, False
        return f"{before[0][1]} → {name}", True


@dataclass(frozen=True, eq=False)
class Scene:
    """Takes that are shown at the same time, side by side."""

    takes: tuple[Take, ...]
    # Where the middle of each take's lane is beside that of the scene, to the left, m.
    lanes: tuple[float, ...] = (0.0,)
    width: float = 0.0  # from the first lane's middle to the last's, m
    track: Track = ()  # what is said instead of gait, time and speed
    whose: str = "recording"  # points are shown

    def __len__(self) -> int:
        return round(self.duration * self.fps) + 1

    def caption(self, time: float) -> Caption:
        """Returns what there is to say at ``time`` in s, takes from right to left."""
        if self.track:
            return caption_at(self.track, time)
        gaits = [take.gait(time) for take in self.takes]
        names = [
            "  ".join(filter(None, (gait, take.title)))
            for (gait, _), take in zip(gaits, self.takes, strict=True)
        ]
        half, frame = round(_AROUND / 2 * self.fps), round(time * self.fps)
        begin = min(max(frame - half, 0), len(self) - 1)
        end = min(frame + half, len(self) - 1)
        way = float(np.linalg.norm(self._path[end] - self._path[begin]))
        speed = way * self.fps / max(end - begin, 1)
        return Caption(
            "  |  ".join(names),
            (f"{time:.2f} s  {speed:.2f} m/s",),
            any(changing for _, changing in gaits),
        )

    @property
    def fps(self) -> float:
        """Frames/s, those of the take that has most."""
        return max(take.fps for take in self.takes)

    @property
    def duration(self) -> float:
        """Seconds of the longest take; the others wait at their end."""
        return max(take.duration for take in self.takes)

    def middle(self, time: float) -> Array:
        """Returns what is in the middle at ``time`` in s, x and y in m, shape (2,).

        It moves as the takes do on average that have not ended.
        """
        frame = min(max(round(time * self.fps), 0), len(self) - 1)
        middle: Array = self._path[frame]
        return middle

    @cached_property
    def _path(self) -> Array:
        """The middle at each frame, m, shape (T, 2)."""
        steps = np.zeros((len(self.takes), len(self) - 1, 2))
        for k, take in enumerate(self.takes):
            shown = [take.index(frame / self.fps) for frame in range(len(self))]
            steps[k] = np.diff(take.q[shown][POSITION][:, :2], axis=0)
        times = np.arange(len(self) - 1) / self.fps
        lasts = np.array([take.duration - 1e-6 for take in self.takes])
        going = times < lasts[:, None]
        mean = (steps * going[..., None]).sum(axis=0) / going.sum(axis=0)[:, None]
        starts = [take.q[0][POSITION][:2] for take in self.takes]
        lanes = np.stack((np.zeros(len(self.lanes)), self.lanes), axis=-1)
        start = np.mean(np.array(starts) - lanes, axis=0)
        return np.concatenate((start[None], start + np.cumsum(mean, axis=0)))


def caption_of(scenes: Sequence[Scene], number: int, time: float) -> Caption:
    """Returns what there is to say of one of several scenes at ``time`` in it, s."""
    said = scenes[number].caption(time)
    place = f"{number + 1} of {len(scenes)}: " if len(scenes) > 1 else ""
    return replace(said, title=f"{place}{said.title}")


def take_of_motion(
    title: str, motion: Motion, robot: LeggedRobot, clip: KeypointClip | None = None
) -> Take:
    """Returns a take that begins at the origin and heads along +x.

    Args:
        title: what the page calls it, beside its gait.
        motion: the motion, of ``robot``.
        robot: the robot.
        clip: keypoints to show to the robot's left, in its size and time.
    """
    q = positions(motion)
    turn = yaw_quat(-yaw_of(q[0, :4]))
    begin = q[0, 4:7] * np.array([1.0, 1.0, 0.0])
    q[ORIENTATION] = quat_multiply(turn, q[ORIENTATION])
    q[POSITION] = quat_rotate(turn, q[POSITION] - begin)
    points = None
    if clip is not None:
        clip = resample(clip, motion.fps)
        ends = (clip.withers[:, None], clip.hip[:, None])
        points = np.concatenate((clip.toes, *ends), axis=1)
        # A spline may end a frame before the motion, or after it.
        shown = np.minimum(np.arange(len(q)), len(points) - 1)
        points = points[shown] + np.array([0.0, _LANE * robot.stand_height, 0.0])
    changes = motion.gait_changes or ((0, motion.label),)
    gaits = tuple((frame, str(label)) for frame, label in changes)
    return Take(title, robot, motion.fps, q, points, gaits)


def one_by_one(takes: Sequence[Take]) -> tuple[Scene, ...]:
    """Returns a scene for each take."""
    return tuple(side_by_side([take]) for take in takes)


def side_by_side(takes: Sequence[Take]) -> Scene:
    """Returns one scene, with the first take on the right."""
    lane = _LANE * max(take.robot.stand_height for take in takes)
    count = np.array([1 if take.points is None else 2 for take in takes])
    starts = np.cumsum(count) - count
    width = lane * float(count.sum() - 1)
    lanes = lane * starts - width / 2
    shown = []
    for take, y in zip(takes, lanes, strict=True):
        q = take.q.copy()
        q[..., 5] += y
        points = None if take.points is None else take.points + np.array([0.0, y, 0.0])
        shown.append(replace(take, q=q, points=points))
    return Scene(tuple(shown), tuple(lanes.tolist()), width)
