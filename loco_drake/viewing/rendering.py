"""Pictures by Drake's renderer, without a screen and without a browser."""

import ctypes
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    GeometryInstance,
    InMemoryMesh,
    LightParameter,
    MakeRenderEngineVtk,
    Mesh,
    PerceptionProperties,
    QueryObject,
    RenderCameraCore,
    RenderEngine,
    RenderEngineVtkParams,
    Role,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.sensors import CameraInfo

from loco_drake.common.arrays import Array

Picture = NDArray[np.uint8]  # red, green, blue, shape (height, width, 3)

WIDTH, HEIGHT = 640, 360  # pixels
_NAME = "vtk"
FIELD_OF_VIEW = 0.55  # rad, from top to bottom
_NEAR, _FAR = 0.05, 60.0  # m
_SKY = [0.75, 0.83, 0.92]  # as in Meshcat
# The sun, from above and behind the camera's left shoulder, and a lamp at the camera,
# which brightens what is in the shade. A lamp is a point: it casts no shadows.
_LIGHTS = [
    LightParameter(type="directional", frame="world", direction=[0.35, 0.6, -1.2]),
    LightParameter(type="point", frame="camera", intensity=0.35),
]
_LACKS = (
    "Videos need EGL to render without a screen; on Debian or Ubuntu, install it with: "
    "apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri."
)
_SHADOW_PIXELS = 1024  # less are blurred


def make_engine() -> RenderEngine:
    """Returns the renderer.

    Raises:
        OSError: if this machine lacks the libraries for it.
    """
    params = RenderEngineVtkParams(
        default_clear_color=_SKY,
        lights=_LIGHTS,
        cast_shadows=True,
        shadow_map_size=_SHADOW_PIXELS,
    )
    if not can_render():
        raise OSError(_LACKS)
    return MakeRenderEngineVtk(params)


def can_render() -> bool:
    """Returns whether there is a graphics card or software that stands in for one.

    Without one, Drake's renderer on Linux ends the process at its first picture.
    """
    if sys.platform != "linux":
        return True
    _load_triton()
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError:
        return False
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    egl.eglGetProcAddress.argtypes = [ctypes.c_char_p]
    address = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    if address is None:
        return False
    count = ctypes.c_int32(0)
    pointer = ctypes.POINTER(ctypes.c_int32)
    query = ctypes.CFUNCTYPE(ctypes.c_uint32, ctypes.c_int32, ctypes.c_void_p, pointer)(
        address
    )
    return bool(query(0, None, ctypes.byref(count))) and count.value > 0


def _load_triton() -> None:
    """Loads PyTorch's Triton, if there is one, before Mesa.

    Both bring an LLVM, and Triton crashes the process if Mesa's is there first.
    """
    if find_spec("triton") is not None:
        import_module("triton")


def AddRenderEngine(plant: MultibodyPlant, scene_graph: SceneGraph) -> None:
    """Adds the renderer to a scene graph, for all that is in it to be seen.

    Call it before the plant is finalized.
    """
    _AddNormals(plant, scene_graph)
    scene_graph.AddRenderer(_NAME, make_engine())


class Camera:
    """A camera at ``eye`` that looks at ``target``, both (3,) in m.

    Args:
        eye: where it is.
        target: what is in the middle of its pictures.
        size: of the pictures, width and height in pixels.
        field_of_view: from top to bottom, rad.
    """

    def __init__(
        self,
        eye: Array,
        target: Array,
        size: tuple[int, int] = (WIDTH, HEIGHT),
        field_of_view: float = FIELD_OF_VIEW,
    ) -> None:
        intrinsics = CameraInfo(*size, field_of_view)
        core = RenderCameraCore(
            _NAME, intrinsics, ClippingRange(_NEAR, _FAR), RigidTransform()
        )
        self._camera = ColorRenderCamera(core, False)
        self._matrix = intrinsics.intrinsic_matrix()
        forward = (target - eye) / np.linalg.norm(target - eye)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        axes = np.stack((right, np.cross(forward, right), forward), axis=1)
        self._X_WC = RigidTransform(RotationMatrix(axes), eye)

    def project(self, p_W: Array) -> tuple[Array, Array]:
        """Returns where points (N, 3) in m are seen, and how large.

        Returns:
            Pixels from the left and from the top, (N, 2), and pixels per m, (N,).
        """
        p_C = self._X_WC.inverse().multiply(p_W.T).T
        seen = p_C @ self._matrix.T
        pixels: Array = seen[:, :2] / seen[:, 2:]
        scale: Array = self._matrix[0, 0] / p_C[:, 2]
        return pixels, scale

    def take(self, query: QueryObject) -> Picture:
        """Returns a picture of the scene graph."""
        world = SceneGraph.world_frame_id()
        image = query.RenderColorImage(self._camera, world, self._X_WC)
        return np.ascontiguousarray(image.data[..., :3])


def _AddNormals(plant: MultibodyPlant, scene_graph: SceneGraph) -> None:
    """Replaces meshes without normals, which the renderer refuses, by ones with them.

    Meshcat's stay as they are: they need none, and would be twice as large.
    """
    source = plant.get_source_id()
    inspector = scene_graph.model_inspector()
    made: dict[Path, InMemoryMesh] = {}
    for geometry in inspector.GetAllGeometryIds(Role.kPerception):
        shape = inspector.GetShape(geometry)
        if not (isinstance(shape, Mesh) and shape.source().is_path()):
            continue
        path = Path(shape.source().path())
        if path not in made:
            made[path] = _with_normals(path)
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        name = f"{inspector.GetName(geometry)}_rendered"
        pose = inspector.GetPoseInFrame(geometry)
        mesh = GeometryInstance(pose, Mesh(made[path], shape.scale3()), name)
        mesh.set_perception_properties(PerceptionProperties())
        scene_graph.RemoveRole(source, geometry, Role.kPerception)
        plant.RegisterVisualGeometry(body, mesh)


def _with_normals(path: Path) -> InMemoryMesh:
    """Returns one of our .obj files of triangles with a normal for each."""
    lines = path.read_text().splitlines()
    points = np.array([line.split()[1:] for line in lines if line[:2] == "v "], float)
    faces = np.array([line.split()[1:] for line in lines if line[:2] == "f "], int)
    a, b, c = np.moveaxis(points[faces - 1], 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    obj = [f"vn {x:.4f} {y:.4f} {z:.4f}" for x, y, z in normals]
    count = 0
    for line in lines:
        if line[:2] == "f ":
            count += 1
            line = "f " + " ".join(f"{k}//{count}" for k in line.split()[1:])
        obj.append(line)
    mtl = path.with_suffix(".mtl")
    return InMemoryMesh(
        mesh_file=MemoryFile("\n".join(obj), ".obj", path.name),
        supporting_files={mtl.name: MemoryFile(mtl.read_text(), ".mtl", mtl.name)},
    )
