import numpy as np
import pytest

from loco_drake.common.runs import intervals
from loco_drake.retargeting.correction import CLEARANCE, plant_feet, swing_clearance

FPS, RADIUS, CUTOFF = 50.0, 0.02, 7.0


def walking_feet(frames=100, slide=0.0, sink=0.0, seed=0):
    """Four feet that stand 15 frames and step 10, sliding and sinking in stance."""
    rng = np.random.default_rng(seed)
    p_WF = np.empty((frames, 4, 3))
    contacts = np.empty((frames, 4), dtype=bool)
    time = np.arange(frames)
    for leg in range(4):
        stride, phase = np.divmod(time + 6 * leg, 25)
        contacts[:, leg] = phase < 15
        s = np.clip((phase - 15) / 10, 0, 1)
        p_WF[:, leg, 0] = 0.3 * (stride + s**2 * (3 - 2 * s)) + slide * phase / FPS
        p_WF[:, leg, 1] = 0.1 * (-1) ** leg
        p_WF[:, leg, 2] = RADIUS + 0.06 * np.sin(np.pi * s) ** 2 - sink * (phase < 15)
    return p_WF + rng.normal(0, 1e-3, p_WF.shape), contacts


def test_feet_in_contact_do_not_move_and_stand_on_the_ground():
    p_WF, contacts = walking_feet(slide=0.2, sink=0.01)
    planted = plant_feet(p_WF, contacts, RADIUS, CUTOFF, FPS)
    for leg in range(4):
        for start, end in intervals(contacts[:, leg]):
            stance = planted[start:end, leg]
            np.testing.assert_allclose(stance, stance[[0] * len(stance)], atol=1e-12)
            np.testing.assert_allclose(stance[:, 2], RADIUS)


def test_foot_stands_amid_where_it_slid():
    """Slid by 60 mm in stance: the foot is put within 10 mm of the middle."""
    p_WF, contacts = walking_feet(slide=0.2)
    planted = plant_feet(p_WF, contacts, RADIUS, CUTOFF, FPS)
    for leg in range(4):
        for start, end in intervals(contacts[:, leg]):
            if start > 0 and end < len(p_WF):
                middle = p_WF[start:end, leg, 0].mean()
                assert planted[start, leg, 0] == pytest.approx(middle, abs=0.01)


def test_no_foot_sinks_and_swings_clear_the_ground():
    p_WF, contacts = walking_feet()
    p_WF[..., 2] = RADIUS - 0.005  # feet dragged through the ground all the time
    planted = plant_feet(p_WF, contacts, RADIUS, CUTOFF, FPS)
    assert planted[..., 2].min() >= RADIUS
    for leg in range(4):
        for start, end in intervals(~contacts[:, leg]):
            if start > 0 and end < len(p_WF):
                assert planted[start:end, leg, 2].max() >= RADIUS + CLEARANCE - 1e-9


def test_touchdown_and_liftoff_are_no_jumps():
    """Feet that slid 60 mm: steps at the edges of stance stay below the swing's own."""
    p_WF, contacts = walking_feet(slide=0.2)
    planted = plant_feet(p_WF, contacts, RADIUS, CUTOFF, FPS)
    steps = np.linalg.norm(np.diff(planted, axis=0), axis=-1)
    edges = contacts[1:] != contacts[:-1]
    naive = p_WF.copy()
    for leg in range(4):
        for start, end in intervals(contacts[:, leg]):
            naive[start:end, leg] = p_WF[start:end, leg].mean(axis=0)
    naive_steps = np.linalg.norm(np.diff(naive, axis=0), axis=-1)
    assert steps[edges].max() < 0.02
    assert naive_steps[edges].max() > 0.025  # what cutting and pasting would do
    assert steps.max() < 0.06


def test_feet_that_need_no_correction_are_hardly_moved():
    p_WF, contacts = walking_feet()
    planted = plant_feet(p_WF, contacts, RADIUS, 12.0, FPS)
    error = np.linalg.norm(planted - p_WF, axis=-1)
    assert np.sqrt((error**2).mean()) < 0.004


def test_clearance_is_a_parabola_up_to_its_height():
    """20 m/s^2: 4 mm after one frame of 20 ms, 15 mm (not 16) after two."""
    contact = np.ones(20, dtype=bool)
    contact[5:12] = False
    expected = np.zeros(20)
    expected[5:12] = [0.004, 0.015, 0.015, 0.015, 0.015, 0.015, 0.004]
    np.testing.assert_allclose(swing_clearance(contact, FPS), expected)


def test_clip_without_contact_is_only_smoothed():
    p_WF, contacts = walking_feet()
    up = np.array([0.0, 0.0, 1.0])
    planted = plant_feet(p_WF + up, ~contacts & False, RADIUS, 20.0, FPS)
    np.testing.assert_allclose(planted, p_WF + up, atol=0.01)


def test_foot_that_never_lifts_stays_put():
    p_WF, contacts = walking_feet()
    planted = plant_feet(p_WF, contacts | True, RADIUS, CUTOFF, FPS)
    np.testing.assert_allclose(planted, planted[[0] * len(planted)], atol=1e-12)
    np.testing.assert_allclose(planted[0, :, :2], p_WF.mean(axis=0)[:, :2], atol=1e-9)
