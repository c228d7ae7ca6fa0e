import pytest

from loco_drake.models.__main__ import main
from loco_drake.models.robots import ROBOTS


@pytest.mark.parametrize("name", ROBOTS)
def test_viewer_opens_the_robot_in_its_stance(name, mesh_cache):
    assert main([name, "--loop_once"]) == 0


def test_viewer_names_the_robots(capsys):
    assert main(["spot"]) == 2
    assert capsys.readouterr().err == (
        "Unknown robot 'spot'; the choices are go2, a1, or a robot's YAML file.\n"
    )
