"""Replays for the page: simulations of the shipped policies, as pages of Meshcat.

A saved page of Meshcat is a viewer and meshes of several MB, and a recording of a few
hundred kB. Replays of a robot differ in the recording alone, so that whatever
they have in common is kept once.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from pydrake.geometry import Meshcat, MeshcatAnimation

from loco_drake.evaluation.tracking import (
    FRAMES_PER_SECOND,
    Recorder,
    dress,
    frame,
    tracking_metrics,
)
from loco_drake.models.plant import PlantConfig
from loco_drake.systems.scenario import GeneratedReference, Scenario, TrainedPolicy

_AGAIN = 10_000  # times that a replay is repeated
_PIECE = 2000  # characters


@dataclass(frozen=True)
class Replay:
    """A simulation that can be watched."""

    robot: str  # its name
    label: str  # the gait
    html: str  # a page of Meshcat that plays it
    fell: bool  # whether the robot did
    figures: dict[str, float]  # of loco_drake.evaluation.tracking.tracking_metrics


def record_replays(
    robot: str, labels: Sequence[str], seconds: float, seed: int = 0
) -> Iterator[Replay]:
    """Simulates the shipped policy on generated motion, one gait after another.

    Args:
        robot: one that a policy is shipped for.
        labels: that the policy was trained on; at least one.
        seconds: of each, at most.
        seed: of the generated motion.
    """
    scenario = Scenario(
        robot=robot,
        plant=PlantConfig(visual=True),
        reference=GeneratedReference(gait=labels[0], seed=seed, duration=seconds),
        policy=TrainedPolicy(),
    )
    meshcat = Meshcat()
    dress(meshcat)
    recorder = Recorder(scenario, meshcat)
    for label in labels:
        meshcat.DeleteRecording()
        recorder.start(gait=label, seed=seed)
        meshcat.StartRecording(frames_per_second=FRAMES_PER_SECOND)
        rollout, _ = recorder.run(seconds)
        meshcat.StopRecording()
        animation = meshcat.get_mutable_recording()
        animation.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
        animation.set_repetitions(_AGAIN)
        meshcat.PublishRecording()
        frame(meshcat, rollout.state[:, 4:7])
        figures = tracking_metrics(rollout)
        yield Replay(robot, label, meshcat.StaticHtml(), rollout.fell, figures)


def share_pieces(pages: Sequence[str]) -> dict[str, Any]:
    """Returns all pieces of all pages, each once, and of which each page is made.

    Joining the "pieces" that an entry of "pages" counts gives that page again. A line
    is cut into pieces: meshes get new names with each simulation, so that no long line
    is quite like another.
    """
    place: dict[str, int] = {}
    made = [
        [
            place.setdefault(line[start : start + _PIECE], len(place))
            for line in page.splitlines(keepends=True)
            for start in range(0, len(line), _PIECE)
        ]
        for page in pages
    ]
    return {"pieces": list(place), "pages": made}
