import numpy as np
import pytest
from matplotlib.patches import Circle
from PIL import Image

from loco_drake.cli.main import main
from loco_drake.datasets.segments import read_segments
from loco_drake.models.robots import get_robot
from loco_drake.motion.motion import FPS
from loco_drake.systems.keypoint_visualizer import COLORS
from loco_drake.viewing.poses import POSES, poses_figure
from loco_drake.viewing.rendering import HEIGHT, WIDTH, Camera
from loco_drake.viewing.stage import Stage
from loco_drake.viewing.takes import Scene, Take, take_of_motion
from tests.synthetic_motion import synthetic_motion
from tests.viewing.pictures import needs_renderer


@needs_renderer
def test_a_point_is_projected_to_where_it_is_seen(go2):
    """The middle of its pixels, and their number, are those of a sphere's picture."""
    still = take_of_motion("a", synthetic_motion(seconds=0.2), go2)
    points = np.full((1, 6, 3), [0.0, 0.0, -50.0])
    points[0, 0] = 0.3, -0.8, 0.55
    take = Take("a", go2, FPS, still.q[:1], points)
    stage = Stage([Scene((take,))], rendered=True)
    stage.set_up(stage.scenes[0], 0.0)
    camera = Camera(np.array([0.4, -4.0, 1.0]), np.array([0.0, 0.0, 0.3]))
    picture = camera.take(stage.query_object).astype(int)
    assert picture.shape == (HEIGHT, WIDTH, 3)
    blue = picture[..., 2] > picture[..., :2].max(axis=-1) + 50
    rows, columns = np.nonzero(blue)
    middle = np.append(stage.scenes[0].middle(0.0), 0.0)
    (pixel,), (scale,) = camera.project(points[0, :1] - middle)
    # Its shaded side is hardly blue.
    assert pixel == pytest.approx([columns.mean(), rows.mean()], abs=2.5)
    radius = 1.3 * go2.foot_radius * scale
    assert 0.6 < blue.sum() / (np.pi * radius**2) < 1.1


@needs_renderer
@pytest.mark.slow
def test_keypoints_lie_over_the_robots_a_row_for_each(made_data):
    segment = read_segments(made_data)[0]
    robots = [get_robot(name) for name in ("a1", "go2")]
    figure = poses_figure(segment, robots, ["A1", "Go2"])
    assert [axes.texts[0].get_text() for axes in figure.axes] == ["A1", "Go2"]
    for axes in figure.axes:
        discs = [p for p in axes.patches if isinstance(p, Circle)][::2]
        assert len(discs) == 6 * POSES
        for kind in (0, 2, 4):
            color = COLORS[kind].rgba[:3]
            own = [d for d in discs if np.allclose(d.get_facecolor()[:3], color)]
            assert len(own) == 2 * POSES
        height, width, _ = axes.images[0].get_array().shape
        centres = np.array([disc.center for disc in discs])
        assert (centres > 0).all()
        assert (centres < [width, height]).all()
        green = [d.center for d in discs if d.get_facecolor()[1] > 0.6]
        other = [d.center for d in discs if d.get_facecolor()[1] < 0.6]
        assert max(y for _, y in green) < min(y for _, y in other)


@needs_renderer
@pytest.mark.slow
def test_evaluate_retargeting_draws_robots_and_library(made_data, tmp_path):
    line = f"evaluate retargeting --labels dog-pace --data-dir {made_data}"
    assert main([*line.split(), "--figures", str(tmp_path)]) == 0
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["go2-library.png", "retargeted-dog-pace.webp"]
    with Image.open(tmp_path / "retargeted-dog-pace.webp") as image:
        assert image.size == (1600, 350)
