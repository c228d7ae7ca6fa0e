import re

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.datasets.named_points import read_points
from loco_drake.datasets.registry import read_clip
from loco_drake.datasets.skeleton import load_source, read_skeleton
from loco_drake.retargeting.scaling import load_config
from tests.synthetic_animals import CAT, HORSE, make_motion, write_bvh

pytestmark = pytest.mark.usefixtures("only_known_sources")

CAT_YAML = """
withers: Chest
hip: Pelvis
toes: {FL: Paw_Fore.L, FR: Paw_Fore.R, RL: Paw_Hind.L, RR: Paw_Hind.R}
"""
PONY_YAML = """
source: pony
withers: Base
hip: Croup
toes:
  FL: NearForeCannon/End Site
  FR: OffForeCannon/End Site
  RL: NearHindCannon/End Site
  RR: OffHindCannon/End Site
units: in
up: y
"""
POINTS = ("withers", "hip", "paw_fl", "paw_fr", "paw_rl", "paw_rr")
TABLE_YAML = """
withers: withers
hip: hip
toes: {FL: paw_fl, FR: paw_fr, RL: paw_rl, RR: paw_rr}
units: mm
"""


def load(path, text):
    path.write_text(text)
    return load_source(str(path))


def agrees(clip, truth, within):
    """Whether a clip is the truth, which starts elsewhere along its way."""
    shift = (truth.withers + truth.hip)[0] / 2 * (1, 1, 0)
    np.testing.assert_allclose(clip.withers, truth.withers - shift, atol=within)
    np.testing.assert_allclose(clip.hip, truth.hip - shift, atol=within)
    np.testing.assert_allclose(clip.toes, truth.toes - shift, atol=within)


@pytest.mark.parametrize(
    ("animal", "text", "fps"), [(CAT, CAT_YAML, 100.0), (HORSE, PONY_YAML, 60.0)]
)
def test_bvh_of_any_skeleton_reads_as_what_it_was_made_of(
    animal, text, fps, tmp_path, caplog
):
    """Other names, order, channels, units and up axes; .1 mm of a cat, 1 of a horse."""
    truth = write_bvh(tmp_path / "a.bvh", animal, heading=2.2)
    source = load(tmp_path / "my_cat.yaml", text)
    assert source == ("mycat" if animal is CAT else "pony")
    clip = read_clip(source, tmp_path / "a.bvh", "walk")
    assert clip.fps == fps
    agrees(clip, truth, 1e-3 * animal.height)
    assert (clip.toes[:, 0::2, 1] > 0).all()
    assert (clip.toes[:, 1::2, 1] < 0).all()
    assert caplog.text == ""
    assert clip.provenance["licence"] == "not stated"


def test_a_wrong_up_axis_and_exchanged_sides_are_mended_and_told(tmp_path, caplog):
    truth = write_bvh(tmp_path / "a.bvh", HORSE)
    swapped = PONY_YAML.replace("NearFore", "X").replace("OffFore", "NearFore")
    source = load(
        tmp_path / "a.yaml", swapped.replace("XC", "OffForeC").replace("up: y", "up: z")
    )
    clip = read_clip(source, tmp_path / "a.bvh", "trot")
    agrees(clip, truth, 1e-3)
    assert "up: turned upright" in caplog.text
    assert "left and right front toes exchanged" in caplog.text


def test_a_list_of_joints_is_their_middle(tmp_path):
    truth = write_bvh(tmp_path / "a.bvh", CAT)
    text = CAT_YAML.replace("Pelvis", "[Femur.L, Femur.R]")
    clip = read_clip(load(tmp_path / "a.yaml", text), tmp_path / "a.bvh", "walk")
    # The legs begin a fifth of the height below the trunk.
    expected = truth.hip[0, 2] - 0.2 * CAT.height
    np.testing.assert_allclose(clip.hip[:, 2], expected, atol=1e-4)


def one_row(names, rows):
    header = ",".join(f"{name}_{axis}" for name in names for axis in "xyz")
    return "\n".join([f"frame,{header}", *(f"{k},{row}" for k, row in enumerate(rows))])


def two_rows(names, rows):
    """Names over their first columns, coordinates numbered below them, and tabs."""
    header = "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t"
    axes = "\t\t" + "\t".join(
        f"{axis}{k}" for k in range(1, len(names) + 1) for axis in "XYZ"
    )
    body = [
        f"{k + 1}\t{k / 100:.3f}\t" + row.replace(",", "\t")
        for k, row in enumerate(rows)
    ]
    head = ["PathFileType\t4\t(X/Y/Z)\tcat.trc", "DataRate\tUnits", "100\tmm"]
    return "\n".join([*head, header, axes, *body])


def three_rows(names, rows):
    """As exports of pose estimators write it: name and axis in rows of their own."""
    repeated = [name for name in names for _ in range(3)]
    head = ["scorer" + ",me" * len(repeated), "bodyparts," + ",".join(repeated)]
    axes = "coords" + ",x,y,z" * len(names)
    return "\n".join([*head, axes, *(f"{k},{row}" for k, row in enumerate(rows))])


def with_units(names, rows):
    """Below the axes the unit of each column, and a rate in a line of its own."""
    head = ["Trajectories", "100", ",," + ",,,".join(f"Cat:{n}" for n in names) + ",,"]
    axes = ["Frame,Sub Frame" + ",X,Y,Z" * len(names), "," + ",mm" * 3 * len(names)]
    return "\n".join(
        [*head, *axes, *(f"{k + 1},0,{row}" for k, row in enumerate(rows))]
    )


@pytest.mark.parametrize("form", [one_row, two_rows, three_rows, with_units])
@pytest.mark.parametrize("gap", [False, True])
def test_table_under_any_header_reads_as_what_it_was_made_of(form, gap, tmp_path):
    truth = make_motion(CAT)
    points = np.concatenate(
        (truth.withers[:, None], truth.hip[:, None], truth.toes), axis=1
    )
    rows = [",".join(f"{1000 * v:.3f}" for v in row.ravel()) for row in points]
    if gap:
        rows[150] = "," + rows[150].split(",", 1)[1]
    (tmp_path / "cat.csv").write_text(
        form(("tail", *POINTS), [f"1,2,3,{r}" for r in rows])
    )
    rate = "" if form is two_rows else "fps: 100\n"
    source = load(tmp_path / "a.yaml", TABLE_YAML + rate)
    clip = read_clip(source, tmp_path / "cat.csv", "walk")
    assert clip.fps == 100.0
    agrees(clip, truth, 1e-4)
    assert clip.provenance.get("gaps") == ("1 frames bridged" if gap else None)


def test_columns_of_a_table_can_be_named_or_numbered(tmp_path):
    truth = make_motion(CAT)
    points = np.concatenate(
        (truth.withers[:, None], truth.hip[:, None], truth.toes), axis=1
    )
    flat = points.reshape(len(points), -1)
    names = [f"c{k}" for k in range(18)]
    np.savetxt(
        tmp_path / "named.csv",
        flat,
        delimiter=",",
        header=",".join(names),
        comments="",
    )
    columns = "columns:\n" + "".join(
        f"  {point}: [c{3 * k}, {3 * k + 1}, c{3 * k + 2}]\n"
        for k, point in enumerate(POINTS)
    )
    text = TABLE_YAML.replace("mm", "m") + "fps: 100\n" + columns
    clip = read_clip(load(tmp_path / "a.yaml", text), tmp_path / "named.csv", "walk")
    agrees(clip, truth, 1e-9)
    # Without a header points are numbered, behind columns of frames and times.
    count = np.arange(len(flat))[:, None]
    np.savetxt(tmp_path / "bare.txt", np.hstack((count, count / 100, flat)))
    numbered = "withers: 0\nhip: 1\ntoes: {FL: 2, FR: 3, RL: 4, RR: 5}\n"
    clip = read_clip(load(tmp_path / "b.yaml", numbered), tmp_path / "bare.txt", "walk")
    assert clip.fps == 100.0
    agrees(clip, truth, 1e-9)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (
            "Chest",
            "Thorax",
            "no joint 'Thorax', but Pelvis, Tail, Femur.L, .*Paw_Fore.R",
        ),
        ("Chest", "End Site", "6 joints 'End Site'; name one of Tail/End Site"),
        ("Chest", "[]", "empty list"),
        ("withers: Chest", "", "It lacks withers"),
        ("FL: Paw_Fore.L, ", "", "toes must be FL, FR, RL, RR, not FR, RL, RR"),
        ("Chest", "Pelvis", "Pelvis is named twice"),
        ("withers:", "units: yd\nwithers:", "units must be m, cm, mm, in, or .* 'yd'"),
        ("withers:", "units: cm\nwithers:", "trunk would be 0.0027 m long"),
        ("withers:", "units: 0\nwithers:", "units must be m, cm"),
        ("withers:", "up: w\nwithers:", "up must be x, y, z, -x, -y, -z, not 'w'"),
        ("withers:", "fps: 9000\nwithers:", "9000 frames/s is not plausible"),
        ("withers:", "columns: {a: [1, 2, 3]}\nwithers:", "joints and no columns"),
        ("withers:", "source: dog\nwithers:", "There is a source 'dog'"),
        ("withers:", "source: My_Cat\nwithers:", "lower-case letters and digits only"),
        ("withers:", "wither: x\nwithers:", "unknown field 'wither'"),
    ],
)
def test_what_is_wrong_with_a_skeleton_is_told(old, new, reason, tmp_path):
    write_bvh(tmp_path / "a.bvh", CAT, seconds=1.0)
    with pytest.raises(InputError, match=reason):
        read_clip(
            load(tmp_path / "a.yaml", CAT_YAML.replace(old, new)),
            tmp_path / "a.bvh",
            "walk",
        )


def test_retargeting_is_configured_in_the_same_file(tmp_path):
    more = "retargeting: {hip_spread: 0.17, contact: {land_height: 0.03}}\n"
    config = load_config(load(tmp_path / "a.yaml", CAT_YAML + more))
    assert (config.hip_spread, config.contact.land_height) == (0.17, 0.03)
    assert config.front_hip == 0.0
    for wrong, reason in (
        (
            "spread: 1",
            "retargeting: it has the unknown field 'spread'; there are base_",
        ),
        ("swing_height: 0", "retargeting: swing_height must be above 0, not 0"),
    ):
        source = load(tmp_path / "a.yaml", f"{CAT_YAML}retargeting: {{{wrong}}}\n")
        with pytest.raises(InputError, match=reason):
            load_config(source)


def test_table_without_rate_or_of_other_points_is_refused(tmp_path):
    header = "frame,tail_x,tail_y,tail_z"
    rows = "\n".join(f"{k},1.5,2.5,3.5" for k in range(9))
    (tmp_path / "a.csv").write_text(f"{header}\n{rows}\n")
    source = load(tmp_path / "a.yaml", TABLE_YAML)
    with pytest.raises(InputError, match=r"rate is not in the file; give .* as fps"):
        read_clip(source, tmp_path / "a.csv", "walk")
    with pytest.raises(InputError, match="no point 'withers', but tail"):
        read_clip(source, tmp_path / "a.csv", "walk", fps=50)
    (tmp_path / "a.csv").write_text("a,b\n1.5,2.5\n3.5,4.5\n")
    with pytest.raises(InputError, match=r"no points .*, but a, b; name those"):
        read_points(tmp_path / "a.csv")


def test_joint_named_twice_needs_a_path(tmp_path):
    path = tmp_path / "a.bvh"
    write_bvh(path, CAT, seconds=1.0)
    path.write_text(re.sub("Paw_(Fore|Hind).[LR]", "Paw", path.read_text()))
    named = read_points(path)
    with pytest.raises(InputError, match=r"4 joints 'Paw'; name one of Tibia.L/Paw"):
        named.find("Paw")
    assert named.find("Tibia.L/Paw") == named.find("Femur.L/Paw") == 5
    assert named.path(5) == "Tibia.L/Paw"


def test_a_file_loaded_again_replaces_what_it_said(tmp_path):
    path = tmp_path / "cat.yaml"
    assert load(path, CAT_YAML) == load(path, CAT_YAML + "units: cm\n") == "cat"
    assert read_skeleton(path).metres == 0.01
    with pytest.raises(InputError, match="There is a source 'cat'"):
        load(tmp_path / "cat.yml", CAT_YAML)
