"""Files of robots that this project knows nothing of, and how to spoil them."""

from pathlib import Path

ROOT = Path(__file__).parents[1]
SOLO8 = ROOT / "examples" / "solo8.yaml"

_DATA = "package://example-robot-data/robots"
_LEGS = ("FL", "FR", "RL", "RR")

# URDF, trunk, radius, joints and foot of a leg, its names there, front and rear stance.
ROBOTS = {
    "go2": (
        str(ROOT / "models" / "go2" / "go2.urdf"),
        "base",
        0.022,
        ("{}_hip_joint", "{}_thigh_joint", "{}_calf_joint"),
        "{}_foot",
        _LEGS,
        ([0, 0.85, -1.7], [0, 0.85, -1.7]),
    ),
    # Knees that point at each other, hips of which the axes are offset.
    "anymal": (
        f"{_DATA}/anymal_b_simple_description/robots/anymal.urdf",
        "base",
        0.03,
        ("{}_HAA", "{}_HFE", "{}_KFE"),
        "{}_FOOT",
        ("LF", "RF", "LH", "RH"),
        ([0, 0.7, -1.4], [0, -0.7, 1.4]),
    ),
    # Its URDF has the right legs first, and a hip's axis that is turned.
    "laikago": (
        f"{_DATA}/laikago_description/urdf/laikago.urdf",
        "trunk",
        0.027,
        ("{}_hip_joint", "{}_thigh_joint", "{}_calf_joint"),
        "{}_foot",
        _LEGS,
        ([0, 0.7, -1.4], [0, 0.7, -1.4]),
    ),
}
FOREIGN = ("anymal", "laikago")


def write_robot(path: Path, robot: str) -> Path:
    """Writes the YAML file of one of ROBOTS and returns its path."""
    urdf, trunk, radius, joints, foot, names, (front, rear) = ROBOTS[robot]
    lines = [f"urdf: {urdf}", f"trunk: {trunk}", f"foot_radius: {radius}", "legs:"]
    for leg, name, stand in zip(_LEGS, names, (front, front, rear, rear), strict=True):
        own = ", ".join(joint.format(name) for joint in joints)
        lines.append(
            f"  {leg}: {{joints: [{own}], foot: {foot.format(name)}, stand: {stand}}}"
        )
    path.write_text("\n".join(lines) + "\n")
    return path
