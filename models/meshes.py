"""The vendors' meshes, converted once to a format that Drake reads."""

from pydrake.multibody.parsing import PackageMap


def AddMeshPackage(package_map: PackageMap) -> None:
    """Registers ``loco_drake_meshes``, converting the meshes if need be."""
    raise NotImplementedError("written next")
