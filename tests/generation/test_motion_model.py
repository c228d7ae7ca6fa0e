import copy

import numpy as np
import pytest
import torch

from loco_drake.common.errors import InputError
from loco_drake.common.rotations import quat_error, quat_rotate
from loco_drake.common.weights import save_network
from loco_drake.generation.generate import (
    SEVERAL,
    generate_motion,
    generate_motions,
)
from loco_drake.generation.motion_model import MotionModel, load_motion_model
from loco_drake.generation.tokenizer import (
    Tokenizer,
)
from loco_drake.models.robots import get_robot
from loco_drake.motion.gaits import LABELS, parse_label, parse_schedule
from tests.tiny_model import make_tiny_model

PACE, TROT = parse_label("dog-pace"), parse_label("dog-trot")


@pytest.fixture(scope="module")
def model():
    return make_tiny_model()


def run(model, chunks, seeds=(1, 2), label=TROT):
    stream = model.start(np.array(seeds), 10.0)
    streams, parts = [stream], []
    for _ in range(chunks):
        stream, frames = model.extend(stream, np.full(len(seeds), label.index))
        streams.append(stream)
        parts.append(frames)
    return streams, parts


def joined(parts, name):
    return np.concatenate([getattr(part, name) for part in parts], axis=1)


def test_a_chunk_is_about_a_second(model):
    _, (frames,) = run(model, 1)
    assert frames.q.shape == (2, model.chunk_frames, 19)
    assert frames.v.shape == (2, model.chunk_frames, 18)
    assert frames.contacts.shape == (2, model.chunk_frames, 4)
    assert abs(model.chunk_frames - 50) <= 2


recorded: list[np.ndarray] = []


@pytest.fixture(autouse=True)
def _record(monkeypatch):
    """Keeps the tokens that a model appends, which streams forget."""
    recorded.clear()
    plain = MotionModel.append

    def append(self, stream, tokens, labels, told):
        recorded.append(tokens)
        return plain(self, stream, tokens, labels, told)

    monkeypatch.setattr(MotionModel, "append", append)


def test_chunks_are_the_whole_decoded_at_once(model):
    """All tokens appended in one go give the frames of the chunks."""
    streams, parts = run(model, 4)
    tokens = np.concatenate(recorded, axis=1)
    # A stream keeps only the last of them.
    assert streams[-1].tokens.shape[1] < tokens.shape[1]
    labels = np.full(tokens.shape[:2], TROT.index)
    told = np.full((*tokens.shape[:2], 3), np.nan)
    _, at_once = model.append(streams[0], tokens, labels, told)
    for name, tolerance in (("q", 1e-5), ("v", 1e-3)):
        np.testing.assert_allclose(
            joined(parts, name), getattr(at_once, name), atol=tolerance
        )
    assert (joined(parts, "contacts") == at_once.contacts).mean() > 0.999


def test_velocities_are_central_differences_across_chunks(model):
    _, parts = run(model, 3)
    q, v = joined(parts, "q"), joined(parts, "v")
    np.testing.assert_allclose(
        v[:, 1:-1, 3:], (q[:, 2:, 4:] - q[:, :-2, 4:]) * 25, atol=1e-9
    )
    np.testing.assert_allclose(
        v[:, 1:-1, :3], quat_error(q[:, :-2, :4], q[:, 2:, :4]) * 25, atol=1e-9
    )


def test_quaternions_do_not_jump_in_sign(model):
    _, parts = run(model, 6)
    q = joined(parts, "q")
    assert (q[:, 1:, :4] * q[:, :-1, :4]).sum(axis=-1).min() > 0.5


def test_the_first_frame_is_at_the_start_pose(model):
    stream = model.start(np.array([5]), 10.0, np.array([[1.0, -2.0, 0.7]]))
    _, frames = model.extend(stream, np.array([PACE.index]))
    np.testing.assert_allclose(frames.q[0, 0, 4:6], [1.0, -2.0], atol=1e-9)
    forward = quat_rotate(frames.q[0, 0, :4], np.array([1.0, 0.0, 0.0]))
    assert np.arctan2(forward[1], forward[0]) == pytest.approx(0.7, abs=1e-9)


def test_same_seed_same_motion_other_seed_another(model):
    _, a = run(model, 2)
    _, b = run(model, 2)
    _, c = run(model, 2, seeds=(1, 7))
    np.testing.assert_array_equal(joined(a, "q"), joined(b, "q"))
    np.testing.assert_allclose(joined(a, "q")[0], joined(c, "q")[0], atol=1e-5)
    assert np.abs(joined(a, "q")[1] - joined(c, "q")[1]).max() > 0.01


def test_extending_leaves_the_stream_alone(model):
    streams, parts = run(model, 2)
    _, again = model.extend(streams[1], np.full(2, TROT.index))
    np.testing.assert_array_equal(again.q, parts[1].q)


def test_copies_of_a_stream_are_itself(model):
    stream = model.start(np.array([0]))
    assert copy.copy(stream) is stream
    assert copy.deepcopy({"a": stream})["a"] is stream
    with pytest.raises(ValueError, match="read-only"):
        stream.footing.pose[0, 0] = 1.0


def test_many_threads_give_the_same_motion(model):
    _, a = run(model, 1)
    threads = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        _, b = run(model, 1)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(threads)
    np.testing.assert_array_equal(a[0].q, b[0].q)


def test_soles_stay_above_the_ground(model):
    robot = get_robot("go2")
    _, parts = run(model, 3)
    q = joined(parts, "q")
    p_WF = quat_rotate(q[:, :, None, :4], robot.toe_positions(q[..., 7:]))
    lowest = (p_WF + q[:, :, None, 4:7])[..., 2] - robot.foot_radius
    # Where a leg is long enough to lift it, which wild motion need not be.
    assert np.median(lowest) >= -1e-9


def test_the_gait_can_change_while_it_runs(model):
    stream = model.start(np.array([4]))
    labels = np.full((1, model.chunk_tokens), PACE.index)
    labels[0, 6:] = TROT.index
    _, frames = model.extend(stream, labels)
    changes = np.flatnonzero(np.diff(frames.labels[0]))
    # One frame is held back, so the change comes one frame later.
    assert changes.tolist() == [6 * model.frames_per_token]
    assert frames.labels[0, 0] == PACE.index
    assert frames.labels[0, -1] == TROT.index


def test_a_label_that_was_not_trained_names_those_that_were(model):
    stream = model.start(np.array([0]))
    with pytest.raises(
        InputError, match=r"not trained on horse-walk.*dog-pace, dog-trot"
    ):
        model.extend(stream, np.array([parse_label("horse-walk").index]))


def test_networks_that_do_not_belong_together_are_refused(model, tmp_path):
    other = Tokenizer(model.tokenizer.config)
    with pytest.raises(InputError, match="train the generator again"):
        MotionModel(other, model.generator, "go2")
    with pytest.raises(InputError, match="weights for go2"):
        MotionModel(model.tokenizer, model.generator, "a1")
    save_network(tmp_path / "t.safetensors", "tokenizer", model.tokenizer, half=True)
    with pytest.raises(InputError, match="no generator weights"):
        load_motion_model(tmp_path / "t.safetensors", tmp_path / "g.safetensors", "go2")


def test_generated_motions_say_what_they_are(model):
    motion = generate_motion(model, TROT, 2.5, 11)
    assert len(motion) == 126
    assert (motion.robot, motion.label, motion.fps) == ("go2", TROT, 50.0)
    assert motion.provenance["seed"] == "11"
    assert motion.provenance["tokenizer"] == model.tokenizer.fingerprint
    np.testing.assert_allclose(motion.base_position[0, :2], 0.0, atol=1e-9)


def test_motions_side_by_side_are_those_one_by_one(model):
    together = generate_motions(model, PACE, 1.5, [3, 4])
    alone = generate_motion(model, PACE, 1.5, 4)
    np.testing.assert_allclose(
        together[1].joint_positions, alone.joint_positions, atol=1e-9
    )


def test_a_motion_of_several_gaits_says_which(model):
    schedule = parse_schedule("dog-pace,dog-trot@1.2")
    (motion,) = generate_motions(model, schedule, 2.0, [5])
    (pace,) = generate_motions(model, PACE, 2.0, [5])
    assert motion.label == SEVERAL not in LABELS
    assert motion.provenance["generated"] == "dog-pace,dog-trot@1.2 for 2 s"
    # A chunk is decoded as a whole, but nothing of it can tell of a later token.
    same = np.isclose(motion.joint_positions, pace.joint_positions, atol=1e-6)
    assert same.all(axis=1)[: round(1.2 * 50)].all()
    assert not same.all(axis=1)[-20:].any()
    with pytest.raises(InputError, match="before the end, at 1 s"):
        generate_motions(model, schedule, 1.0, [5])


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan, np.inf, 601.0])
def test_durations_out_of_range_are_refused(model, duration):
    with pytest.raises(InputError, match="above 0 and at most 600 s"):
        generate_motion(model, TROT, duration, 0)


@pytest.mark.parametrize(
    "options", [{"temperature": -1.0}, {"temperature": np.nan}, {"top_p": 0.0}]
)
def test_sampling_options_out_of_range_are_refused(model, options):
    with pytest.raises(InputError, match="must be"):
        generate_motions(model, TROT, 1.0, [0], **options)
