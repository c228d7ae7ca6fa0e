from importlib.metadata import PackageNotFoundError, distribution

import numpy as np
import pytest
import trimesh
from pydrake.geometry import MeshcatVisualizer, Role, StartMeshcat
from pydrake.systems.framework import DiagramBuilder

from loco_drake.common.errors import InputError
from loco_drake.models import meshes
from loco_drake.models.meshes import convert_meshes
from loco_drake.models.plant import AddRobotPlant, PlantConfig
from loco_drake.models.robots import ROBOTS, get_robot

FOLDERS = {"go2": "go2_description/visuals", "a1": "a1_description/meshes"}


def vendor_meshes(robot):
    root = distribution("example-robot-data").locate_file(
        f"cmeel.prefix/share/example-robot-data/robots/{FOLDERS[robot]}"
    )
    return sorted(root.glob("*.dae"))


@pytest.mark.filterwarnings("ignore:Setting the shape:DeprecationWarning")  # pycollada
@pytest.mark.parametrize("robot", ROBOTS)
def test_converted_meshes_lie_where_the_vendors_do(robot, mesh_cache):
    """Same bounds within the grain, 2 mm: nothing turned, scaled or lost."""
    sources = vendor_meshes(robot)
    assert len(sources) == {"go2": 7, "a1": 5}[robot]
    for source in sources:
        target = mesh_cache / "meshes" / robot / f"{source.stem}.obj"
        bounds = trimesh.load_scene(target).bounds
        np.testing.assert_allclose(
            bounds, trimesh.load_scene(source).bounds, atol=0.002
        )


def test_calves_hang_down(mesh_cache):
    """Z is up: both robots' calves reach .2 m below their joint, not to its side."""
    for robot in ROBOTS:
        bounds = trimesh.load_scene(mesh_cache / "meshes" / robot / "calf.obj").bounds
        assert bounds[0, 2] < -0.19
        assert np.abs(bounds[:, :2]).max() < 0.04


def test_colours_survive(mesh_cache):
    """The A1's thigh has the silver of its maker's URDF; the Go2's foot is black."""
    silver = (mesh_cache / "meshes/a1/thigh.mtl").read_text().split("Kd")[1].split()
    np.testing.assert_allclose(
        [float(value) for value in silver], [0.698, 0.7529, 0.8392], atol=0.005
    )
    assert "Kd 0.000 0.000 0.000" in (mesh_cache / "meshes/go2/foot.mtl").read_text()


def test_second_conversion_does_nothing(mesh_cache):
    file = mesh_cache / "meshes" / "go2" / "base.obj"
    before = file.stat().st_mtime_ns
    assert convert_meshes() == mesh_cache / "meshes"
    assert file.stat().st_mtime_ns == before


def test_no_temporary_files_stay(mesh_cache):
    """Two converters at once leave each file once and nothing half-written."""
    names = {path.name for path in (mesh_cache / "meshes").rglob("*") if path.is_file()}
    assert {name.rsplit(".", 1)[-1] for name in names} == {"obj", "mtl", "xml"}
    assert not any(name.startswith(".") for name in names)


def test_cache_of_another_version_is_redone(mesh_cache):
    """An outdated stamp, as of an older converter, brings the files back."""
    folder = mesh_cache / "meshes"
    stamp = folder / "package.xml"
    stamp.write_text(stamp.read_text().replace("<version>", "<version>0."))
    lost = folder / "go2" / "foot.obj"
    lost.unlink()
    convert_meshes()
    assert lost.is_file()
    assert "<version>0." not in stamp.read_text()


def test_missing_vendor_package_is_named(monkeypatch, mesh_cache):
    def missing(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr(meshes, "distribution", missing)
    with pytest.raises(InputError, match="example-robot-data, which is not installed"):
        convert_meshes()


@pytest.mark.parametrize("name", ROBOTS)
def test_static_replay_is_small(name, mesh_cache):
    """Robot, floor and Meshcat itself are one HTML file of less than 10 MB."""
    builder = DiagramBuilder()
    _, scene_graph, _ = AddRobotPlant(
        builder, get_robot(name), PlantConfig(visual=True)
    )
    meshcat = StartMeshcat()
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    diagram = builder.Build()
    diagram.ForcedPublish(diagram.CreateDefaultContext())
    html = meshcat.StaticHtml()
    assert 2e6 < len(html) < 1e7
    assert meshcat.HasPath(f"/drake/visualizer/{name}/FL_calf")


@pytest.mark.parametrize("name", ROBOTS)
def test_meshes_are_for_drawing_only(name, mesh_cache):
    """Visuals add illustrations: not a shape to collide with, nor one to render."""
    counts = {}
    for visual in (False, True):
        builder = DiagramBuilder()
        _, scene_graph, _ = AddRobotPlant(
            builder, get_robot(name), PlantConfig(visual=visual)
        )
        inspector = scene_graph.model_inspector()
        counts[visual] = [
            len(inspector.GetAllGeometryIds(role))
            for role in (Role.kProximity, Role.kIllustration)
        ]
    links = 13 + (4 if name == "go2" else 0)  # the Go2's feet are meshes of their own
    assert counts[False] == [10, 0]
    assert counts[True] == [10, links + 1]
