"""Flat ground: a half space to stand on and a chequered floor to look at."""

from pydrake.common import MemoryFile
from pydrake.geometry import (
    AddContactMaterial,
    GeometryInstance,
    HalfSpace,
    IllustrationProperties,
    InMemoryMesh,
    Mesh,
    ProximityProperties,
    RoleAssign,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.systems.framework import Context

# So much stiffer than the feet that theirs is the stiffness of the contact:
# k = k_foot k_ground / (k_foot + k_ground).
_STIFFNESS = 1e9

# Of the feet, s/m. That of a contact is the mean of both, weighted by the other's
# stiffness.
_FOOT_DISSIPATION = 1.0

_TILE = 0.5  # m; shows at a glance how far and how fast a robot goes
_TILES = 60  # along each side
_MATERIALS = """
newmtl light
Kd .62 .64 .67
newmtl dark
Kd .53 .55 .58
"""


def AddGround(plant: MultibodyPlant, *, friction: float, visual: bool) -> None:
    """Adds ground at z = 0 to a plant that is not finalized.

    Args:
        plant: registered with a scene graph.
        friction: Coulomb coefficient, static and dynamic.
        visual: whether to draw a floor as well.
    """
    properties = ProximityProperties()
    AddContactMaterial(
        dissipation=0.0,
        point_stiffness=_STIFFNESS,
        friction=CoulombFriction(friction, friction),
        properties=properties,
    )
    # As AddContactMaterial does for "lagged" and "similar", leave damping to the feet.
    properties.AddProperty("material", "relaxation_time", 0.0)
    world = plant.world_body()
    plant.RegisterCollisionGeometry(
        world, RigidTransform(), HalfSpace(), "ground", properties
    )
    if visual:
        # A hair below z = 0, where Meshcat has a grid of its own.
        floor = GeometryInstance(
            RigidTransform([0.0, 0.0, -0.001]), _floor().Clone(), "floor"
        )
        floor.set_illustration_properties(IllustrationProperties())
        plant.RegisterVisualGeometry(world, floor)


def SetGround(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    context: Context,
    *,
    friction: float | None = None,
    stiffness: float | None = None,
) -> None:
    """Changes the ground in a Context; what is None stays as it is.

    Args:
        plant: with a ground of :func:`AddGround`.
        scene_graph: that the plant is registered with.
        context: the scene graph's.
        friction: Coulomb coefficient, static and dynamic.
        stiffness: in N/m; that of a contact is k_foot k / (k_foot + k). Such ground
            is damped like the feet, so that the damping of a contact stays theirs.
    """
    inspector = scene_graph.get_query_output_port().Eval(context).inspector()
    # Whoever shares the plant may have put shapes of their own into the world.
    (ground,) = (
        shape
        for shape in plant.GetCollisionGeometriesForBody(plant.world_body())
        if inspector.GetName(shape).split("::")[-1] == "ground"
    )
    properties = ProximityProperties(inspector.GetProximityProperties(ground))
    if friction is not None:
        properties.UpdateProperty(
            "material", "coulomb_friction", CoulombFriction(friction, friction)
        )
    if stiffness is not None:
        for name, value in (
            ("point_contact_stiffness", stiffness),
            ("hunt_crossley_dissipation", _FOOT_DISSIPATION),
        ):
            properties.UpdateProperty("material", name, value)
    source = plant.get_source_id()
    scene_graph.AssignRole(context, source, ground, properties, RoleAssign.kReplace)


def _floor() -> Mesh:
    """Returns the floor; a mesh in memory, as Drake's shapes have but one colour."""
    side = _TILES + 1
    obj = ["mtllib floor.mtl"]
    corners = [(k - _TILES / 2) * _TILE for k in range(side)]
    obj += [f"v {x} {y} 0" for x in corners for y in corners]
    for parity, material in enumerate(("light", "dark")):
        obj.append(f"usemtl {material}")
        for i in range(_TILES):
            for j in range((i + parity) % 2, _TILES, 2):
                k = i * side + j + 1
                obj.append(f"f {k} {k + side} {k + side + 1} {k + 1}")
    return Mesh(
        InMemoryMesh(
            mesh_file=MemoryFile("\n".join(obj), ".obj", "floor.obj"),
            supporting_files={"floor.mtl": MemoryFile(_MATERIALS, ".mtl", "floor.mtl")},
        )
    )
