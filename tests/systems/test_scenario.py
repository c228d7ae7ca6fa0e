"""Scenarios come from people: typed data is read, anything else is one sentence."""

import contextlib
import pickle
import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from loco_drake.common.errors import InputError
from loco_drake.control.domain import Domain, Push, SensorErrors
from loco_drake.systems.diagram import MakeLocomotionDiagram
from loco_drake.systems.scenario import (
    Disturbances,
    ExternalAction,
    GeneratedReference,
    LoadScenario,
    PlanReference,
    Scenario,
    SmootherConfig,
    TrainedPolicy,
)
from loco_drake.systems.simulator import MakeSimulator, StartEpisode


def test_a_scenario_is_read_from_yaml(tmp_path):
    text = """
    robot: a1
    plant: {time_step: 0.005}
    reference: !GeneratedReference {gait: dog-pace, seed: 7}
    policy: !ExternalAction {}
    smoother: null
    """
    scenario = LoadScenario(data=text, overlay="plant: {friction: 0.5}")
    assert scenario.robot == "a1"
    assert scenario.plant.time_step == 0.005
    assert scenario.plant.friction == 0.5
    assert scenario.plant.contact == "similar"
    assert scenario.reference == GeneratedReference(gait="dog-pace", seed=7)
    assert scenario.policy == ExternalAction()
    assert scenario.smoother is None
    path = tmp_path / "scenario.yaml"
    path.write_text(text)
    assert LoadScenario(filename=path).robot == "a1"


@pytest.mark.parametrize("policy", [TrainedPolicy(weights=Path("a/b.x")), None])
def test_a_scenario_reaches_a_worker_process_as_it_is(policy):
    """Pickled, which Drake's own configurations cannot be."""
    scenario = Scenario(
        robot="a1",
        reference=GeneratedReference(gait="dog-pace", temperature=0.1 + 0.2),
        policy=policy or ExternalAction(),
        disturbances=Disturbances(pushes=True, terrain=True),
        smoother=None,
    )
    for each in (scenario, replace(scenario, reference=PlanReference()), Scenario()):
        copy = pickle.loads(pickle.dumps(each))
        assert repr(copy) == repr(each)


BAD = {
    "robto: go2": "cannot be read",
    "robot: go2\nrobot: a1": "line 2 names 'robot' a second time",
    "robot: spot": "Unknown robot 'spot'; the choices are go2, a1",
    "robot: [go2]": "cannot be read",
    "plant: {time_step: fast}": "cannot be read",
    "plant: {time_step: .nan}": "plant's time_step must be a number from 1e-05 to",
    "plant: {time_step: 1.0e+9}": "plant's time_step must be a number",
    "plant: {friction: -1}": "plant's friction",
    "plant: {accuracy: 0}": "plant's accuracy",
    "plant: {contact: glue}": "choices are similar, lagged, sap, cenic",
    "plant: 3": "cannot be read",
    "reference: !Dance {}": "cannot be read",
    "reference: !GeneratedReference {gait: waltz}": "any, dog-pace, dog-trot",
    "reference: !GeneratedReference {gait: 'any,dog-pace@3'}": "'any'; the choices",
    "{steering: null, reference: !GeneratedReference {gait: any}}": "needs steering",
    "reference: !GeneratedReference {seed: 1.5}": "cannot be read",
    "reference: !GeneratedReference {seed: -1}": "seed must be 0 or more",
    "reference: !GeneratedReference {duration: .inf}": "duration must be a number",
    "reference: !GeneratedReference {top_p: 2}": "top_p must be a number",
    "reference: !GeneratedReference {temperature: -1}": "temperature must be",
    "smoother: {chunk: .01}": "smoother's chunk must be a number from 0.08 to 1.4",
    "smoother: {chunk: 2}": "smoother's chunk",
    "smoother: {lookahead: .nan}": "smoother's lookahead must be a number from 0.16",
    "smoother: {fall: 0}": "smoother's fall must be a number from 0.1",
    "simulator: {integration_scheme: cenic}": "only target_realtime_rate",
    "simulator: {target_realtime_rate: -1}": "target_realtime_rate must be",
    "visualization: {publish_period: 0}": "publish_period must be",
    "policy: !!python/object/apply:os.getcwd []": "cannot be read",
    "disturbances: {pushes: 3}": "cannot be read",
    "steering: {tell: 3}": "cannot be read",
    "steering: {response: 0}": "steering's response must be a number",
    "[": "cannot be read",
    "3": "cannot be read",
    "robot: \x00": "cannot be read",
    "a: &a [*a]": "cannot be read",
    "[" * 10_000: "brackets",
    "- " * 2_000: "cannot be read",
    "#" * 200_000: "characters",
}


@pytest.mark.parametrize("text", BAD, ids=lambda text: text[:40])
@pytest.mark.parametrize("kind", ["data", "overlay"])
def test_a_scenario_with_a_mistake_is_one_sentence(text, kind):
    with pytest.raises(InputError) as error:
        LoadScenario(**{kind: text})
    assert BAD[text] in str(error.value)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 500


def test_a_damaged_scenario_is_refused_or_sound():
    """Two hundred texts, a few characters of each changed, moved or lost."""
    text = """
robot: a1
plant: {time_step: 0.005, contact: lagged, friction: 0.5}
reference: !GeneratedReference {gait: dog-pace, seed: 7}
smoother: {chunk: 0.9, lookahead: 1.0}
"""
    LoadScenario(data=text)
    dice = random.Random(0)
    for _ in range(200):
        letters = list(text)
        for _ in range(dice.choice([1, 1, 3])):
            k = dice.randrange(len(letters))
            letters[k] = dice.choice(["", "{", "]", ":", "&", "*", "-", "\0", "e", "9"])
        with contextlib.suppress(InputError):
            LoadScenario(data="".join(letters)).check()


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"\xff\xfe\x00", "not text in UTF-8"), (b" " * 200_000, "more than 100000 B")],
)
def test_a_file_that_is_no_scenario_is_named(tmp_path, content, message):
    path = tmp_path / "scenario.yaml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=f"scenario.yaml .*{message}"):
        LoadScenario(filename=path)


@pytest.mark.parametrize("name", ["none.yaml", "", "x" * 4_000])
def test_a_missing_scenario_file_is_named(tmp_path, name):
    with pytest.raises(InputError, match=r"no scenario file|cannot be read"):
        LoadScenario(filename=tmp_path / name)


@pytest.mark.parametrize("chunk", [0.08, 0.1, 0.333, 1.4])
def test_the_plan_goes_on_with_every_chunk_that_is_allowed(chunk):
    """The least one too: what is smoothed stays ahead of the clock, and moves."""
    scenario = Scenario(
        reference=GeneratedReference(gait="dog-trot", seed=1),
        smoother=SmootherConfig(chunk=chunk, lookahead=0.5),
    )
    diagram = MakeLocomotionDiagram(scenario)
    simulator = MakeSimulator(diagram, scenario)
    StartEpisode(simulator)
    simulator.AdvanceTo(2.5)
    plan = diagram.GetOutputPort("plan").Eval(simulator.get_context())
    assert plan.end_time >= 3.0
    k = plan.index(2.5)
    # A dog's trot is faster than .5 m/s: the base of the last second went that far.
    assert np.linalg.norm((plan.q[k] - plan.q[k - 25])[4:6]) > 0.25


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Domain(friction=0.0), "friction must be a number of at least 0.001"),
        (lambda: Domain(friction=np.nan), "friction"),
        (lambda: Domain(stiffness=-1.0), "stiffness"),
        (lambda: Domain(payload=-9.0), "payload must be a number of at least -3"),
        (lambda: Domain(payload=np.inf), "payload"),
        (lambda: Domain(latency=0.2), "latency must be a number from 0 to 0.1"),
        (lambda: Domain(latency="1"), "latency"),
        (lambda: Domain(com_shift=[0, 0]), "com_shift must be 3 finite numbers from"),
        (lambda: Domain(com_shift=[0, 0, 1.0]), "com_shift"),
        (lambda: Domain(strength=np.zeros(12)), "strength must be 12 finite numbers"),
        (lambda: Domain(strength=np.full(12, np.nan)), "strength"),
        (lambda: Domain(strength="weak"), "strength"),
        (lambda: Push(start=-1, duration=1, force_W=[0, 0, 0]), "push's start"),
        (lambda: Push(start=0, duration=np.nan, force_W=[0, 0, 0]), "push's duration"),
        (lambda: Push(start=0, duration=1, force_W=[0, 0]), "push's force_W must be 3"),
        (lambda: SensorErrors(bias=[0], white=np.ones(36), seed=0), "errors's bias"),
        (lambda: SensorErrors(bias=np.ones(36), white=-np.ones(36), seed=0), "white"),
    ],
)
def test_a_world_that_cannot_be_is_refused_by_its_field(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_a_domain_does_not_change_with_the_array_that_it_was_made_of():
    strength = np.ones(12)
    domain = Domain(strength=strength)
    strength[:] = 0.6
    assert (domain.strength == 1).all()
    assert not domain.strength.flags.writeable


def test_code_may_change_a_scenario_and_is_checked_too():
    scenario = Scenario(reference=PlanReference(), policy=ExternalAction())
    scenario.smoother.chunk = 0.01
    with pytest.raises(InputError, match="smoother's chunk"):
        MakeLocomotionDiagram(scenario)
    with pytest.raises(InputError, match="Unknown robot"):
        MakeLocomotionDiagram(replace(scenario, robot="spot"))
