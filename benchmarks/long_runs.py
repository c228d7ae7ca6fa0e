"""Does motion of a minute end as it began: every gait, figure by figure.

The figures are those of ``drift`` in ``loco-drake evaluate generation``, without all
else that it measures. Needs retargeted recordings. Run it from the root of the
repository, after ``loco-drake retarget``:

    OMP_NUM_THREADS=1 python benchmarks/long_runs.py
"""

from pathlib import Path

import tyro

from loco_drake.evaluation.drift import RESOLUTION, SECONDS, beyond_recorded, drift
from loco_drake.evaluation.recorded import load_recorded
from loco_drake.evaluation.samples import FRAMES
from loco_drake.generation.generate import generate_motions
from loco_drake.generation.motion_model import pretrained_motion_model
from loco_drake.motion.gaits import LABELS


def main(
    motions: Path = Path("motions/go2"), count: int = 16, seconds: float = SECONDS
) -> None:
    """Prints change over tolerance of each figure, and what is beyond recordings.

    Args:
        motions: folder of the robot's Motion files.
        count: motions of each gait, of as many seeds.
        seconds: of each.
    """
    robot, recorded = load_recorded(motions)
    model = pretrained_motion_model(robot.name)
    names = [name.rsplit("_", 1)[0].replace("_", " ") for name in RESOLUTION]
    print(f"| {robot.name} | {' | '.join(names)} | turning | height |")
    print("|---" + "|---:" * (len(names) + 2) + "|", flush=True)
    for label in LABELS:
        real = [
            m
            for m in (*recorded.train, *recorded.validation)
            if m.label == label and len(m) >= FRAMES
        ]
        if not real or str(label) not in model.generator.config.labels:
            continue
        made = generate_motions(model, label, seconds, range(count))
        figures = drift(robot, made)
        cells = [
            f"{figures[name]['drift']:.2f}" if name in figures else "-"
            for name in RESOLUTION
        ]
        beyond = beyond_recorded(made, real)
        cells += [
            f"{beyond[f'{name}_over_recorded']:.2f}" for name in ("turn", "height")
        ]
        print(f"| {label} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    tyro.cli(main)
