"""Flat ground: a half space for contact and a chequered floor for display."""

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

from .movable_ground import AddMovableGround, HasMovableGround, ground_shapes

# Stiff enough that the feet determine the stiffness of the contact:
# k = k_foot k_ground / (k_foot + k_ground). N/m.
STIFFNESS = 1e9

# Of the feet, s/m. A contact uses the mean of both, weighted by the other's stiffness.
_FOOT_DISSIPATION = 1.0

TILE = 0.5  # m; shows at a glance how far and how fast a robot goes
FLOOR_Z = -0.001  # m; a hair below 0, where Meshcat has a grid of its own
_TILES = 60  # along each side
_FAR = 60.0  # m; from the middle to where plain floor around the tiles ends
_MATERIALS = """
newmtl light
Kd .62 .64 .67
newmtl dark
Kd .53 .55 .58
newmtl far
Kd .575 .595 .625
"""


def AddGround(
    plant: MultibodyPlant, *, friction: float, visual: bool, movable: bool = False
) -> None:
    """Adds ground at z = 0 to a plant with a scene graph that is not finalized.

    ``friction`` is Coulomb's coefficient, static and dynamic; ``visual`` adds a floor;
    ``movable`` ground is that of :mod:`.movable_ground` instead of one half space.
    """
    properties = ProximityProperties()
    AddContactMaterial(
        dissipation=0.0,
        point_stiffness=STIFFNESS,
        friction=CoulombFriction(friction, friction),
        properties=properties,
    )
    # As AddContactMaterial does for "lagged" and "similar", leave damping to the feet.
    properties.AddProperty("material", "relaxation_time", 0.0)
    if movable:
        body = AddMovableGround(plant, properties)
    else:
        body = plant.world_body()
        plant.RegisterCollisionGeometry(
            body, RigidTransform(), HalfSpace(), "ground", properties
        )
    if visual:
        floor = GeometryInstance(
            RigidTransform([0.0, 0.0, FLOOR_Z]), floor_mesh(), "floor"
        )
        floor.set_illustration_properties(IllustrationProperties())
        plant.RegisterVisualGeometry(body, floor)


def SetGround(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    context: Context,
    *,
    friction: float | None = None,
    stiffness: float | None = None,
) -> None:
    """Sets parameters of :func:`AddGround` in the scene graph's Context, unless None.

    With a stiffness k in N/m a contact has k_foot k / (k_foot + k); the ground's
    damping is set to the feet's, so that the damping of a contact does not change.
    """
    inspector = scene_graph.get_query_output_port().Eval(context).inspector()
    if HasMovableGround(plant):
        grounds = ground_shapes(plant)
    else:
        # Users may have added their own shapes to the world.
        (ground,) = grounds = [
            shape
            for shape in plant.GetCollisionGeometriesForBody(plant.world_body())
            if inspector.GetName(shape).split("::")[-1] == "ground"
        ]
    properties = ProximityProperties(inspector.GetProximityProperties(grounds[0]))
    if friction is not None:
        properties.UpdateProperty(
            "material", "coulomb_friction", CoulombFriction(friction, friction)
        )
    if stiffness is not None:
        properties.UpdateProperty("material", "point_contact_stiffness", stiffness)
        properties.UpdateProperty(
            "material", "hunt_crossley_dissipation", _FOOT_DISSIPATION
        )
    source = plant.get_source_id()
    for ground in grounds:
        scene_graph.AssignRole(context, source, ground, properties, RoleAssign.kReplace)


def floor_mesh() -> Mesh:
    """Returns the floor as a mesh, since other Drake shapes have one colour.

    Around its tiles lies plain floor, which ends where nobody sees it.
    """
    side = _TILES + 1
    obj = ["mtllib floor.mtl"]
    corners = [(k - _TILES / 2) * TILE for k in range(side)]
    obj += [f"v {x} {y} 0" for x in corners for y in corners]
    # Meshcat needs no normal, but Drake's renderer does.
    obj.append("vn 0 0 1")
    for parity, material in enumerate(("light", "dark")):
        obj.append(f"usemtl {material}")
        for i in range(_TILES):
            for j in range((i + parity) % 2, _TILES, 2):
                k = i * side + j + 1
                around = (k, k + side, k + side + 1, k + 1)
                obj.append("f " + " ".join(f"{corner}//1" for corner in around))
    near = _TILES * TILE / 2
    obj.append("usemtl far")
    for k, (cos, sin) in enumerate(((1, 0), (0, 1), (-1, 0), (0, -1))):
        for x, y in ((near, near), (near, -near), (_FAR, -_FAR), (_FAR, _FAR)):
            obj.append(f"v {x * cos - y * sin} {x * sin + y * cos} 0")
        first = side**2 + 4 * k + 1
        obj.append("f " + " ".join(f"{first + corner}//1" for corner in range(4)))
    return Mesh(
        InMemoryMesh(
            mesh_file=MemoryFile("\n".join(obj), ".obj", "floor.obj"),
            supporting_files={"floor.mtl": MemoryFile(_MATERIALS, ".mtl", "floor.mtl")},
        )
    )
