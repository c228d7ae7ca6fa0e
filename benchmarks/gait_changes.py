"""How every gait changes into every other: is there a jump, is the new gait reached?

Prints the roughest changes, by the greatest ratio of a peak about the change to that of
the gaits themselves (loco_drake/evaluation/gait_change.py), and those that are farthest
from the new gait's speed from one second after on. Run it from the root of the
repository:

    OMP_NUM_THREADS=1 python benchmarks/gait_changes.py
"""

from itertools import permutations

import numpy as np
import tyro

from loco_drake.evaluation.gait_change import forward_speed, roughness
from loco_drake.generation.generate import generate_motions
from loco_drake.generation.motion_model import pretrained_motion_model
from loco_drake.motion.gaits import LABELS, GaitSchedule
from loco_drake.motion.motion import FPS

BEFORE, AFTER = 3.0, 3.0  # s of a gait before and after the change
SETTLED = 1.0  # s after the change from which on the speed counts


def main(robot: str = "go2", count: int = 4, rows: int = 8) -> None:
    """Prints the tables.

    Args:
        robot: go2 or a1.
        count: number of motions, and seeds, of each change.
        rows: number of changes to print.
    """
    model = pretrained_motion_model(robot)
    known = [k for k in LABELS if str(k) in model.generator.config.labels]
    seeds = range(count)
    steady = {k: generate_motions(model, k, BEFORE + AFTER, seeds) for k in known}
    speed = {
        k: [forward_speed(model.robot, m).mean() for m in own]
        for k, own in steady.items()
    }
    lowest, highest = ({k: f(v) for k, v in speed.items()} for f in (min, max))
    found = []
    peaks: list[dict[str, float]] = []
    first = round((BEFORE + SETTLED) * FPS)
    for a, b in permutations(known, 2):
        schedule = GaitSchedule((a, b), (0.0, BEFORE))
        for motion in generate_motions(model, schedule, BEFORE + AFTER, seeds):
            rough = roughness(motion, BEFORE, [*steady[a], *steady[b]])
            peaks.append(rough)
            worst = max(rough, key=lambda key: rough[key])
            settled = forward_speed(model.robot, motion)[first:].mean()
            beyond = max(lowest[b] - settled, settled - highest[b], 0.0)
            found.append((rough[worst], worst, beyond, f"{a} to {b}"))
    ratios = np.array([ratio for ratio, *_ in found])
    beyond = np.array([off for _, _, off, _ in found])
    print(f"{len(found)} changes of {len(known)} gaits, {robot}")
    print(f"peaks over those of the gaits: median {np.median(ratios):.2f}", end=", ")
    print(f"most {ratios.max():.2f}, above 1: {(ratios > 1).mean():.1%}")
    print(f"speed {SETTLED:g} s after, beyond that of all {count} motions of", end=" ")
    print(f"the gait: median {np.median(beyond):.2f} m/s, most {beyond.max():.2f}")
    print("\n| peak over those of the gaits | median | most | above 1, % |")
    print("|---|---:|---:|---:|")
    for key in peaks[0]:
        each = np.array([rough[key] for rough in peaks])
        share = 100 * (each > 1).mean()
        print(f"| {key} | {np.median(each):.2f} | {each.max():.2f} | {share:.1f} |")
    print("\n| change | roughest in | over the gaits' |\n|---|---|---:|")
    for ratio, worst, _, name in sorted(found, reverse=True)[:rows]:
        print(f"| {name} | {worst} | {ratio:.2f} |")
    print("\n| change | m/s beyond the gait's |\n|---|---:|")
    for off, name in sorted(((o, n) for *_, o, n in found), reverse=True)[:rows]:
        print(f"| {name} | {off:.2f} |")


if __name__ == "__main__":
    tyro.cli(main)
