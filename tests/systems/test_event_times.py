"""Events that belong together come at the same time, to the last bit."""

from loco_drake.control.plan import PLAN_DT, UPDATE_PERIOD
from loco_drake.evaluation.tracking import Recorder, normalized_return
from loco_drake.models.plant import PlantConfig
from loco_drake.systems.scenario import GeneratedReference, Scenario


def test_producers_look_at_the_times_of_control_periods():
    looks = round(UPDATE_PERIOD / PLAN_DT)
    assert all(k * UPDATE_PERIOD == looks * k * PLAN_DT for k in range(100_000))
    # What goes wrong with another period.
    assert 15 * PLAN_DT != 3 * 0.1


def test_cenic_takes_no_step_between_events_of_the_same_time():
    """With looks every .1 s this robot got 5e6 m/s at .3 s, and counted as fallen."""
    recorder = Recorder(
        Scenario(
            robot="a1",
            plant=PlantConfig(contact="cenic", accuracy=1e-4),
            reference=GeneratedReference(gait="solo8-wave", seed=4),
        )
    )
    recorder.start(gait="solo8-wave", seed=4)
    rollout, _ = recorder.run(0.4)
    assert not rollout.fell
    assert normalized_return(rollout) > 80
    smallest = (
        recorder.simulator.get_integrator().get_smallest_adapted_step_size_taken()
    )
    assert smallest > 1e-6
