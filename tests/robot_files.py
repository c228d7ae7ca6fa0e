"""Files of robots that this project knows nothing of, and how to spoil them."""

from pathlib import Path

ROOT = Path(__file__).parents[1]
SOLO8 = ROOT / "examples" / "solo8.yaml"
# Those that can be simulated.
OWN = {name: ROOT / "examples" / f"{name}.yaml" for name in ("b1", "anymal")}


def without_weights(name: str, folder: Path) -> Path:
    """Writes the file of one of OWN as if it came without weights; returns its path."""
    lines = OWN[name].read_text().splitlines()
    path = folder / f"{name}.yaml"
    text = "\n".join(line for line in lines if not line.startswith("weights:"))
    path.write_text(text + "\n")
    return path


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


def made_up_urdf(top: str = "", unit: float = 1.0, turn: str = "0 0 0") -> str:
    """Text of a URDF of a robot with links of .22 m, hips at (+-.2, +-.1) m.

    Args:
        top: links and joints above the trunk's link, "body".
        unit: of length in the file, in 1/m.
        turn: roll, pitch and yaw of all legs in the frame of "body", rad.
    """
    hips = {"FL": (0.2, 0.1), "FR": (0.2, -0.1), "RL": (-0.2, 0.1), "RR": (-0.2, -0.1)}
    lines = [
        f'<robot name="made_up">{top}<link name="body"/><link name="core"/>',
        '<joint name="core_joint" type="fixed"><parent link="body"/>'
        f'<child link="core"/><origin rpy="{turn}"/></joint>',
    ]
    for leg, (x, y) in hips.items():
        parent = "core"
        for part, (at, axis, lower, upper) in {
            "hip": ((x, y, 0), "1 0 0", -1, 1),
            "thigh": ((0, y / 2, 0), "0 1 0", -2, 4),
            "calf": ((0, 0, -0.22), "0 1 0", -2.7, -0.5),
            "foot": ((0, 0, -0.22), "", 0, 0),
        }.items():
            link = f"{leg}_{part}"
            xyz = " ".join(str(unit * length) for length in at)
            kind = (
                f'type="revolute"><axis xyz="{axis}"/><limit lower="{lower}" '
                f'upper="{upper}" effort="30" velocity="20"/>'
                if axis
                else 'type="fixed">'
            )
            lines.append(
                f'<link name="{link}"/><joint name="{link}_joint" {kind}'
                f'<parent link="{parent}"/><child link="{link}"/>'
                f'<origin xyz="{xyz}"/></joint>'
            )
            parent = link
    return "\n".join([*lines, "</robot>"])


def write_made_up(
    path: Path, urdf: str, names: tuple[str, ...] = _LEGS, **fields: str
) -> Path:
    """Writes a URDF beside ``path`` and there a YAML file for it; returns ``path``.

    Args:
        path: of the YAML file.
        urdf: from :func:`made_up_urdf`, perhaps spoiled.
        names: the URDF's names of the legs that the file calls FL, FR, RL and RR.
        fields: other values of urdf, trunk, foot_radius, stand and foot, in YAML.
    """
    fields = {
        "urdf": f"{path.stem}.urdf",
        "trunk": "body",
        "foot_radius": "0.02",
        "stand": "[0, 0.8, -1.6]",
        "foot": "{}_foot",
        **fields,
    }
    path.with_name(fields["urdf"]).write_text(urdf)
    lines = [f"{key}: {fields[key]}" for key in ("urdf", "trunk", "foot_radius")]
    lines.append("legs:")
    for leg, name in zip(_LEGS, names, strict=True):
        joints = ", ".join(f"{name}_{part}_joint" for part in ("hip", "thigh", "calf"))
        foot = fields["foot"].format(name)
        lines.append(
            f"  {leg}: {{joints: [{joints}], foot: {foot}, stand: {fields['stand']}}}"
        )
    path.write_text("\n".join(lines) + "\n")
    return path
