"""A person made by formula, in the files that human motion comes in."""

import json

import numpy as np

from loco_drake.common.rotations import quat_multiply

FPS = 30.0
HIP, BONE, ANKLE = 0.34, 1.6, 0.2  # in units of the skeleton, a quarter of a metre
HIGH = 0.8  # m, of the hips over the ground; legs are bent a little

_BALL = '<joint name="{0}" type="{type}"><parent link="{1}"/><child link="{0}"/>'
_BALL += '<origin rpy="0 0 0" xyz="{2} {3} {4}"/>{5}</joint>'
_AXIS = '<axis xyz="0 0 1"/><limit lower="-3.14" upper="3.14" effort="1" velocity="1"/>'


def skeleton_text(spherical="spherical", left=-1.0):
    """The URDF of a person; ``left`` is the sign of z on the left."""
    joints = [("chest", "root", 0, 0.9, 0), ("neck", "chest", 0, 0.9, 0)]
    for side, sign in (("right", -left), ("left", left)):
        joints += [
            (f"{side}_hip", "root", 0, 0, sign * HIP),
            (f"{side}_knee", f"{side}_hip", 0, -BONE, 0),
            (f"{side}_ankle", f"{side}_knee", 0, -BONE, 0),
            (f"{side}_shoulder", "chest", 0, 0.9, sign * 0.7),
            (f"{side}_elbow", f"{side}_shoulder", 0, -1.1, 0),
            (f"{side}_wrist", f"{side}_elbow", 0, -1.0, 0),
        ]
    parts = ['<robot name="person"><link name="root"/>']
    for name, *rest in joints:
        box = '<collision><origin rpy="0 0 0" xyz="0.2 -0.1 0"/>'
        box += '<geometry><box size="0.7 0.2 0.3"/></geometry></collision>'
        foot = box if name.endswith("ankle") else ""
        parts.append(f'<link name="{name}">{foot}</link>')
        kind, axis = spherical, ""
        if name.endswith(("knee", "elbow")):
            kind, axis = "revolute", _AXIS
        elif name.endswith("wrist"):
            kind = "fixed"
        joint = _BALL.format(name, *rest, axis, type=kind)
        if kind == "ball":
            joint = joint.replace("<joint", "<drake:joint")
            joint = joint.replace("</joint", "</drake:joint")
        parts.append(joint)
    return "".join(parts) + "</robot>"


def about(axis, angle):
    """Quaternions w, x, y, z of turns by ``angle`` (T,) in rad about an axis."""
    q = np.zeros((len(angle), 4))
    q[:, 0], q[:, 1 + axis] = np.cos(angle / 2), np.sin(angle / 2)
    return q


def march(seconds=2.0, period=0.8, speed=0.0, lift=0.1):
    """Frames of a person who marches on the spot, or on, arms swinging, y up."""
    t = np.arange(round(seconds * FPS) + 1) / FPS
    root = np.stack((speed * t, np.full(len(t), HIGH), 0 * t), axis=-1)
    level = about(0, np.zeros(len(t)))
    columns = [np.full((len(t), 1), 1 / FPS), root, level, level, level]
    for late in (0.0, 0.5):
        stride = t / period + late
        # A foot stands for three fifths of its stride, and swings to the next place.
        phase = stride % 1.0
        swing = np.clip((phase - 0.6) / 0.4, 0.0, 1.0)
        place = np.floor(stride) + 0.3 - late + swing**2 * (3 - 2 * swing)
        x = speed * (period * place - t)
        z = HIGH - 0.25 * ANKLE - lift * np.sin(np.pi * swing) ** 2
        bend = 2 * np.arccos(np.hypot(x, z) / (0.5 * BONE))
        ahead = np.arctan2(x, z)
        columns += [about(2, ahead + bend / 2), -bend[:, None]]
        columns += [about(2, bend / 2 - ahead)]
        columns += [about(2, 0.3 * np.sin(2 * np.pi * stride))]
        columns += [np.full((len(t), 1), 0.5)]
    return np.concatenate(columns, axis=1)


def turned_over(frames):
    """The same frames with z up instead of y."""
    turned = frames.copy()
    x, y, z = frames[:, 1:4].T
    turned[:, 1:4] = np.stack((x, -z, y), axis=-1)
    up = about(0, np.full(len(frames), np.pi / 2))
    turned[:, 4:8] = quat_multiply(up, frames[:, 4:8])
    return turned


def write_person(folder, frames=None, skeleton=None, loop="wrap", name="march"):
    """Writes a clip and its skeleton; returns the clip's path."""
    folder.mkdir(parents=True, exist_ok=True)
    # As pybullet's, it ends in a zero byte.
    (folder / "humanoid.urdf").write_text((skeleton or skeleton_text()) + "\n\0")
    path = folder / f"humanoid3d_{name}.txt"
    frames = march() if frames is None else frames
    path.write_text(json.dumps({"Loop": loop, "Frames": np.asarray(frames).tolist()}))
    return path
