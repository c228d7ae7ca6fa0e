import numpy as np
import pytest

from loco_drake.cli.evaluate_steering import ways_table
from loco_drake.evaluation.naturalness import (
    WAYS,
    do_tasks,
    is_turn,
    naturalness,
    task_velocities,
)
from loco_drake.evaluation.samples import FRAMES
from loco_drake.generation.generate import generate_motions
from loco_drake.motion.gaits import parse_label
from tests.synthetic_motion import synthetic_motion
from tests.tiny_model import make_tiny_model

TROT = parse_label("dog-trot")


@pytest.fixture(scope="module")
def model():
    return make_tiny_model(told=True)


def recorded(turns):
    return [
        synthetic_motion("dog-trot", 2.5, 0.6, turn, phase=0.1 * i, recording=f"r{i}")
        for i, turn in enumerate(turns)
    ]


def test_a_task_is_the_velocity_of_the_recording(model):
    tasks = task_velocities(model, recorded([0.0, 0.4]))
    assert tasks.shape == (2, FRAMES // model.frames_per_token, 3)
    inner = tasks[:, 4:-4]
    np.testing.assert_allclose(inner[0], np.tile([0.6, 0, 0], (17, 1)), atol=0.02)
    np.testing.assert_allclose(inner[1][:, 2], 0.4, atol=0.02)


def test_a_turn_is_one_by_its_root_mean_square():
    """To both sides by .3 in turns: its mean is 0, and it is none at .1."""
    tasks = np.zeros((3, 24, 3))
    tasks[0, :, 2] = 0.3 * (-1.0) ** np.arange(24)
    tasks[1, :, 2] = 0.1
    tasks[2, :, :2] = 1.0
    assert is_turn(tasks).tolist() == [True, False, False]


def test_each_way_does_what_it_says(model):
    """Frames after the lead of 2 s; what is not bent is what the generator writes."""
    tasks = task_velocities(model, recorded([0.6, -0.6]))
    found = {way: do_tasks(model, TROT, tasks, way, 5) for way in (None, *WAYS)}
    assert {len(m) for motions in found.values() for m in motions} == {FRAMES}
    plain = generate_motions(model, TROT, 4.0, [5, 6])
    np.testing.assert_array_equal(
        found[None][1].joint_positions, plain[1].joint_positions[100 : 100 + FRAMES]
    )
    told = np.concatenate((np.repeat(tasks[:, :1], 25, axis=1), tasks), axis=1)
    asked = generate_motions(model, TROT, 4.0, [5, 6], velocity=told)
    np.testing.assert_array_equal(
        found["telling"][1].joint_positions, asked[1].joint_positions[100:200]
    )
    for way in ("bending", "both"):
        assert (found[way][0].joint_positions != found[None][0].joint_positions).any()


def test_without_enough_subjects_there_is_no_test(model):
    figures = naturalness(model, recorded([0.0, 0.5]), 1, 0)
    assert (figures["tasks"], figures["turns"]) == (2, 1)
    assert set(figures) == {"tasks", "turns", "not asked", *WAYS}
    assert figures["telling"]["two_sample_accuracy"] is None
    assert figures["telling"]["velocity_error_mps"] > 0


def test_wild_motion_is_told_from_recordings_however_it_is_steered(model):
    figures = naturalness(model, recorded([0.0, 0.5, -0.5, 0.3, 0.4, -0.3]), 1, 0)
    for way in WAYS:
        assert figures[way]["two_sample_accuracy"]["mean"] > 0.9
        assert figures[way]["two_sample_accuracy_of_turns"]["mean"] > 0.9


def test_the_table_shows_what_is_known():
    figures = {
        "bending": {"velocity_rmse_mps": 0.0512, "plan_joint_limit_violations": 3},
        "naturalness": {"both": {"two_sample_accuracy": {"mean": 0.6}}},
    }
    columns, rows = ways_table(figures)
    assert [row[0] for row in rows] == ["not asked", *WAYS]
    assert rows[1][1] == "0.051"
    assert rows[1][columns.index("joint limits")] == "3"
    assert rows[3][columns.index("two-sample")] == "0.60"
    assert rows[2][1:] == ["–"] * (len(columns) - 1)
