"""Our models against the makers' own, parsed by Drake without any of our code."""

from importlib.metadata import distribution

import numpy as np
import pytest
from pydrake.geometry import Role
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from loco_drake.models.plant import AddRobotPlant, PlantConfig
from loco_drake.models.robots import ROBOTS, get_robot

LEFT_RIGHT = (("FL", "FR"), ("RL", "RR"))
LINKS = ("hip", "thigh", "calf")
MIRROR = np.diag([1.0, -1.0, 1.0])


@pytest.fixture(scope="module", params=ROBOTS)
def models(request):
    """Our plant with its scene graph, the maker's plant, and their contexts."""
    builder = DiagramBuilder()
    plant, scene_graph, _ = AddRobotPlant(
        builder, get_robot(request.param), PlantConfig()
    )
    folder = f"cmeel.prefix/share/example-robot-data/robots/{request.param}_description"
    file = distribution("example-robot-data").locate_file(
        f"{folder}/urdf/{request.param}.urdf"
    )
    maker = MultibodyPlant(0.0)
    Parser(maker).AddModels(str(file))
    maker.Finalize()
    assert maker.num_positions() == plant.num_positions() == 19
    return plant, scene_graph, maker


def matching_positions(maker, q):
    """The maker's q for our q: A1's file lists the legs in another order."""
    names = maker.GetPositionNames(add_model_instance_prefix=False)
    ours = [f"{name}_q" for name in get_robot("go2").joint_names]
    result = np.empty(19)
    result[:7] = q[:7]
    for name, value in zip(ours, q[7:], strict=True):
        result[names.index(name)] = value
    return result


def test_every_link_has_the_inertia_of_the_makers_links_that_it_merges(models):
    """Mass, centre of mass and inertia of each link, Drake adding up the maker's."""
    plant, _, maker = models
    ours, theirs = plant.CreateDefaultContext(), maker.CreateDefaultContext()
    for index in plant.GetBodyIndices(plant.GetModelInstanceByName(_name(plant))):
        body = plant.get_body(index)
        twin = maker.GetBodyByName(body.name())
        welded = [b.index() for b in maker.GetBodiesWeldedTo(twin)]
        M = plant.CalcSpatialInertia(ours, body.body_frame(), [index])
        expected = maker.CalcSpatialInertia(theirs, twin.body_frame(), welded)
        np.testing.assert_allclose(
            M.CopyToFullMatrix6(), expected.CopyToFullMatrix6(), rtol=1e-8, atol=1e-11
        )


def test_whole_robot_has_the_makers_inertia_in_any_pose(models):
    """Composite inertia in the trunk's frame, random joints: so axes agree too."""
    plant, _, maker = models
    robot = get_robot(_name(plant))
    ours, theirs = plant.CreateDefaultContext(), maker.CreateDefaultContext()
    rng = np.random.default_rng(0)
    for joints in rng.uniform(robot.joint_lower, robot.joint_upper, (20, 12)):
        q = np.concatenate(([1, 0, 0, 0, 0, 0, 0], joints))
        plant.SetPositions(ours, q)
        maker.SetPositions(theirs, matching_positions(maker, q))
        M = [
            p.CalcSpatialInertia(
                context, p.GetFrameByName("base"), p.GetBodyIndices(instance)
            ).CopyToFullMatrix6()
            for p, context, instance in (
                (plant, ours, plant.GetModelInstanceByName(robot.name)),
                (maker, theirs, maker.GetBodyByName("base").model_instance()),
            )
        ]
        np.testing.assert_allclose(M[0], M[1], rtol=1e-8, atol=1e-9)


def test_joint_limits_are_the_makers(models):
    """All but the Go2's calf, whose linkage convention the model's file explains."""
    plant, _, maker = models
    robot = get_robot(_name(plant))
    for name in robot.joint_names:
        ours, theirs = plant.GetJointByName(name), maker.GetJointByName(name)
        np.testing.assert_allclose(
            ours.position_lower_limits(), theirs.position_lower_limits(), atol=1e-9
        )
        np.testing.assert_allclose(
            ours.position_upper_limits(), theirs.position_upper_limits(), atol=1e-9
        )
        if robot.name == "go2" and "calf" in name:
            assert theirs.velocity_upper_limits()[0] == 15.7
        else:
            assert ours.velocity_upper_limits() == theirs.velocity_upper_limits()


def test_model_is_mirror_symmetric(models):
    """Left and right legs: inertia, frames, joint limits and shapes are mirrored."""
    plant, scene_graph, _ = models
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, [1.0, *[0.0] * 18])
    inspector = scene_graph.model_inspector()
    for left, right in LEFT_RIGHT:
        for link in LINKS:
            a = plant.GetBodyByName(f"{left}_{link}")
            b = plant.GetBodyByName(f"{right}_{link}")
            M_a, M_b = a.default_spatial_inertia(), b.default_spatial_inertia()
            assert M_a.get_mass() == M_b.get_mass()
            np.testing.assert_array_equal(M_a.get_com(), MIRROR @ M_b.get_com())
            I_a = M_a.CalcRotationalInertia().CopyToFullMatrix3()
            I_b = M_b.CalcRotationalInertia().CopyToFullMatrix3()
            np.testing.assert_allclose(I_a, MIRROR @ I_b @ MIRROR, atol=1e-15)
            X_a, X_b = (x.EvalPoseInWorld(context) for x in (a, b))
            np.testing.assert_allclose(
                X_a.translation(), MIRROR @ X_b.translation(), atol=1e-15
            )
            j_a = plant.GetJointByName(f"{left}_{link}_joint")
            j_b = plant.GetJointByName(f"{right}_{link}_joint")
            limits = [j_b.position_lower_limits()[0], j_b.position_upper_limits()[0]]
            if link == "hip":
                limits = [-limits[1], -limits[0]]
            assert [
                j_a.position_lower_limits()[0],
                j_a.position_upper_limits()[0],
            ] == limits
            shapes = [
                [
                    (inspector.GetShape(g), inspector.GetPoseInFrame(g).translation())
                    for g in plant.GetCollisionGeometriesForBody(x)
                ]
                for x in (a, b)
            ]
            for (shape_a, p_a), (shape_b, p_b) in zip(*shapes, strict=True):
                assert repr(shape_a) == repr(shape_b)
                np.testing.assert_array_equal(p_a, MIRROR @ p_b)


def test_trunk_is_nearly_mirror_symmetric(models):
    """The makers' trunks are not quite: their centres lie within 5 mm of the middle."""
    plant, _, _ = models
    com = plant.GetBodyByName("base").default_spatial_inertia().get_com()
    assert abs(com[1]) == pytest.approx(
        {"go2": 0.0, "a1": 0.0041}[_name(plant)], abs=1e-5
    )


def test_toes_knees_and_trunk_touch_only_the_ground(models):
    """9 shapes, and the pairs that may collide are each of them with the ground."""
    plant, scene_graph, _ = models
    inspector = scene_graph.model_inspector()
    (ground,) = plant.GetCollisionGeometriesForBody(plant.world_body())
    shapes = set(inspector.GetAllGeometryIds(Role.kProximity)) - {ground}
    assert len(shapes) == 1 + 4 + 4
    pairs = {frozenset(pair) for pair in inspector.GetCollisionCandidates()}
    assert pairs == {frozenset((shape, ground)) for shape in shapes}


def test_toes_are_of_rubber_and_the_ground_is_not(models):
    """Compliance is in the model, so that no default of Drake decides how feet feel."""
    plant, scene_graph, _ = models
    inspector = scene_graph.model_inspector()
    for leg in ("FL", "FR", "RL", "RR"):
        body = plant.GetBodyByName(f"{leg}_calf")
        (toe,) = plant.GetCollisionGeometriesForBody(body)
        properties = inspector.GetProximityProperties(toe)
        foot = plant.GetFrameByName(f"{leg}_foot").GetFixedPoseInBodyFrame()
        assert inspector.GetPoseInFrame(toe).IsExactlyEqualTo(foot)
        for name, value in (
            ("point_contact_stiffness", 5e4),
            ("hunt_crossley_dissipation", 1.0),
            ("relaxation_time", 1e-3),
        ):
            assert properties.GetProperty("material", name) == value
        friction = properties.GetProperty("material", "coulomb_friction")
        assert friction.static_friction() == friction.dynamic_friction() == 0.8
    (ground,) = plant.GetCollisionGeometriesForBody(plant.world_body())
    stiffness = inspector.GetProximityProperties(ground).GetProperty(
        "material", "point_contact_stiffness"
    )
    assert 1 / (1 / 5e4 + 1 / stiffness) > 0.999 * 5e4


def test_gains_and_rotors_are_in_the_model(models):
    """PD gains, and an armature near the .01 kg m^2 that other simulators use."""
    plant, _, _ = models
    robot = get_robot(_name(plant))
    for index in plant.GetJointActuatorIndices():
        actuator = plant.get_joint_actuator(index)
        assert actuator.has_controller()
        assert actuator.get_controller_gains().p == 100.0
        assert actuator.get_controller_gains().d == 2.0
    assert np.all(robot.reflected_inertia > 0.004)
    assert np.all(robot.reflected_inertia < 0.011)


def _name(plant):
    return "go2" if plant.HasModelInstanceNamed("go2") else "a1"
