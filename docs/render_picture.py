"""Makes the picture of the README: the Go2 in the middle of a gait, and its plan.

Needs Chromium on the path (``chromium``, headless). From the root of the repository:

    python docs/render_picture.py docs/images/go2_trot.png
"""

import subprocess
import tempfile
from pathlib import Path

import tyro
from pydrake.geometry import Meshcat

from loco_drake.evaluation.replay import dress
from loco_drake.evaluation.rollout import Recorder
from loco_drake.models.plant import PlantConfig
from loco_drake.systems.scenario import GeneratedReference, Scenario, TrainedPolicy

_CHROMIUM = (
    "chromium --headless=new --no-sandbox --disable-dev-shm-usage --hide-scrollbars "
    "--use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader "
    "--disable-background-networking --no-first-run --virtual-time-budget=20000"
)


def main(
    png: tyro.conf.Positional[Path],
    gait: str = "dog-trot",
    seed: int = 3,
    time: float = 3.1,
    policy: Path | None = None,
    size: tuple[int, int] = (1280, 640),
) -> None:
    """Simulates until ``time`` and takes the picture."""
    meshcat = Meshcat()
    dress(meshcat)
    scenario = Scenario(
        plant=PlantConfig(visual=True),
        reference=GeneratedReference(gait=gait, seed=seed),
        policy=TrainedPolicy(weights=policy),
    )
    recorder = Recorder(scenario, meshcat)
    recorder.start()
    rollout, _ = recorder.run(time)
    recorder.diagram.ForcedPublish(recorder.context)
    x, y, _ = rollout.state[-1, 4:7]
    meshcat.SetCameraPose([x + 0.75, y - 0.95, 0.5], [x + 0.02, y, 0.2])
    take_picture(meshcat.StaticHtml(), png, size)


def take_picture(html: str, png: Path, size: tuple[int, int]) -> None:
    """Writes a picture of a static page of Meshcat, ``size`` pixels wide and high."""
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "page.html"
        page.write_text(html)
        png.parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(
            [
                *_CHROMIUM.split(),
                f"--user-data-dir={folder}/profile",
                f"--window-size={size[0]},{size[1]}",
                f"--screenshot={png.resolve()}",
                page.as_uri(),
            ],
            check=True,
            stderr=subprocess.DEVNULL,
        )


if __name__ == "__main__":
    tyro.cli(main)
