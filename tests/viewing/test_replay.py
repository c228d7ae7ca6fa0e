import numpy as np
from pydrake.geometry import Meshcat

from loco_drake.viewing.replay import frame_times, record
from loco_drake.viewing.stage import Stage
from loco_drake.viewing.takes import one_by_one, take_of_motion
from tests.meshcat_messages import animation, captions
from tests.synthetic_motion import synthetic_motion


def test_a_page_holds_all_files_one_after_another_and_follows_the_robot(go2):
    motions = [synthetic_motion(seconds=s, speed=1.0) for s in (1.0, 2.0)]
    takes = [take_of_motion("a", motion, go2) for motion in motions]
    meshcat = Meshcat()
    corner = record(Stage(one_by_one(takes), meshcat), meshcat)
    told = captions(corner)
    assert [time for time, _ in told] == sorted({*np.arange(13) / 4, 33 / 32})
    for (time, caption), place in zip(told, 5 * [1] + 9 * [2], strict=True):
        within = time - (place == 2) * 33 / 32
        for part in (f"{place} of 2: dog-trot  a<", f"{within:.2f} s", "1.00 m/s"):
            assert part in caption
    recording = meshcat.get_mutable_recording()
    assert recording.loop_mode() == recording.LoopMode.kLoopRepeat
    assert recording.repetitions() > 1000
    tracks = animation(meshcat.StaticHtml())
    base = tracks["/drake/illustration/figure0/go2/base", ".position"]
    times, places = zip(*base, strict=True)
    # 33 and 65 pictures, the first and the last of each file among them.
    assert times == tuple(range(98))
    places = np.array(places)
    np.testing.assert_allclose(places[:, :2], 0, atol=1e-9)
    heights = [takes[k].q[round(50 * t), 6] for k, t in ((0, 0), (0, 1), (1, 2))]
    np.testing.assert_allclose(places[[0, 32, 97], 2], heights)
    floor = np.array(
        [p for _, p in tracks["/drake/illustration/ground/floor", ".position"]]
    )
    np.testing.assert_allclose(floor[[0, 32, 33, 97], 0], [0, -1, 0, -2], atol=0.02)


def test_frames_of_whole_steps_include_the_last(go2):
    scenes = one_by_one([take_of_motion("a", synthetic_motion(seconds=0.4), go2)] * 2)
    times = frame_times(scenes, 25)
    assert len(times) == 22
    assert times[10][1] == times[21][1] == 0.4
    assert (times[10][0], times[11]) == (scenes[0], (scenes[1], 0.0))
