"""Tracking in MuJoCo: Drake's plans, and Drake's return."""

import numpy as np
import pytest

from loco_drake.evaluation.tracking import Recorder, normalized_return
from loco_drake.systems.scenario import GeneratedReference, Scenario

pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")

from loco_drake.evaluation.mujoco import MujocoRecorder
from loco_drake.models.mujoco_plant import MujocoConfig

SECONDS = 4.0


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["go2", "a1"])
def test_policies_keep_95_percent_of_their_return(robot):
    """The plans are the same to the last bit, and so are the scores of equal motion."""
    scenario = Scenario(robot=robot)
    scenario.reference = GeneratedReference(gait="dog-trot", duration=SECONDS)
    drake, mujoco = Recorder(scenario), MujocoRecorder(scenario, MujocoConfig())
    for gait in ("dog-trot", "horse-walk"):
        records = []
        for recorder in (drake, mujoco):
            recorder.start(gait=gait, seed=5)
            records.append(recorder.run(SECONDS)[0])
        for name in ("plan_state", "path_time"):
            first, second = (getattr(record, name) for record in records)
            np.testing.assert_array_equal(first, second)
        shares = [len(record.state) for record in records]
        assert shares == [201, 201]
        drakes, mujocos = map(normalized_return, records)
        assert drakes > 85
        assert mujocos > 0.95 * drakes
        # The policy's first answer is to the same state.
        first, second = (record.desired_joints[:2] for record in records)
        np.testing.assert_allclose(first, second, atol=1e-6)
