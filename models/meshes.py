"""The manufacturers' meshes, converted once to a format that Drake reads.

Drake does not read Collada. The meshes of Go2 and A1 in the PyPI package
``example-robot-data`` are converted to Wavefront .obj files with .mtl colours in the
user's cache. They are used for visualization only.
"""

import warnings
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from threading import Lock

import numpy as np

from loco_drake.common.errors import InputError
from loco_drake.common.files import atomic_path, cache_dir

# Increment when the converter changes, to invalidate older caches.
_VERSION = 1

_FOLDERS = {"go2": "go2_description/visuals", "a1": "a1_description/meshes"}

_LOADING = Lock()  # warning filters are global

# Vertices closer than this, in m, are merged. This hardly changes the Go2's meshes and
# reduces the A1's to two fifths, which keeps replays small.
_GRAIN = {"go2": 0.0005, "a1": 0.002}

_PACKAGE_XML = """<?xml version="1.0"?>
<package format="2">
  <name>loco_drake_meshes</name>
  <version>{version}</version>
  <description>Meshes of example-robot-data converted by loco_drake.</description>
  <maintainer email="noreply@example.com">loco_drake</maintainer>
  <license>MPL-2.0</license>
</package>
"""


def convert_meshes() -> Path:
    """Returns the folder of the package ``loco_drake_meshes``, created or updated.

    Files are written atomically, and package.xml, which marks the folder as complete,
    is written last. Concurrent conversions are therefore safe.

    Raises:
        InputError: if the package ``example-robot-data`` is not installed.
    """
    vendor, robots = _vendor(), vendor_folder() / "robots"
    folder = cache_dir() / "meshes"
    stamp = _PACKAGE_XML.format(version=f"{_VERSION}.{vendor.version}")
    package_xml = folder / "package.xml"
    if package_xml.is_file() and package_xml.read_text() == stamp:
        return folder
    for robot, subfolder in _FOLDERS.items():
        for source in sorted((robots / subfolder).glob("*.dae")):
            _convert(source, folder / robot / f"{source.stem}.obj", _GRAIN[robot])
    with atomic_path(package_xml) as temporary:
        temporary.write_text(stamp)
    return folder


def vendor_folder() -> Path:
    """Returns the folder of robots, URDFs and meshes of ``example-robot-data``.

    Raises:
        InputError: if the package is not installed.
    """
    return Path(str(_vendor().locate_file("cmeel.prefix/share/example-robot-data")))


def _vendor() -> Distribution:
    try:
        return distribution("example-robot-data")
    except PackageNotFoundError:
        raise InputError(
            "Robots' meshes and URDFs come from the package example-robot-data, "
            "which is not installed."
        ) from None


def _convert(source: Path, target: Path, grain: float) -> None:
    """Writes the Collada file ``source`` as ``target`` (.obj) and an .mtl beside it."""
    # A slow import that only the first conversion needs.
    import trimesh

    # Pycollada sets the shape of arrays, which numpy 2.5 deprecates (pycollada#162).
    with _LOADING, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Setting the shape", DeprecationWarning)
        scene = trimesh.load_scene(source)
    obj = [f"mtllib {target.stem}.mtl"]
    mtl = []
    count = 0
    # Parts of a Collada file have transforms; use the scene's frame.
    for index, part in enumerate(scene.dump()):
        assert isinstance(part, trimesh.Trimesh)
        # Without normals, viewers use flat shading, which suits machined parts and
        # halves the file.
        mesh = trimesh.Trimesh(part.vertices / grain, part.faces, process=False)
        mesh.merge_vertices(digits_vertex=0)
        mesh.update_faces(mesh.nondegenerate_faces() & mesh.unique_faces())
        mesh.remove_unreferenced_vertices()
        obj.append(f"usemtl m{index}")
        obj += [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in mesh.vertices * grain]
        obj += [f"f {a} {b} {c}" for a, b, c in mesh.faces + count + 1]
        count += len(mesh.vertices)
        assert isinstance(part.visual, trimesh.visual.TextureVisuals)
        r, g, b = _srgb(part.visual.material.main_color)
        mtl.append(f"newmtl m{index}\nKd {r:.3f} {g:.3f} {b:.3f}")
    with atomic_path(target.with_suffix(".mtl")) as temporary:
        temporary.write_text("\n".join(mtl) + "\n")
    with atomic_path(target) as temporary:
        temporary.write_text("\n".join(obj) + "\n")


def _srgb(rgba: np.ndarray) -> np.ndarray:
    """Returns sRGB in [0, 1] of a linear colour in 0..255, as Blender writes them."""
    linear = np.asarray(rgba[:3], dtype=np.float64) / 255
    return np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055
    )
