"""The system that generates motion of a gait while the simulation runs."""

from dataclasses import dataclass, replace

import numpy as np
from pydrake.systems.framework import Context

from loco_drake.common.errors import InputError
from loco_drake.common.immutable import Immutable
from loco_drake.control.plan import PLAN_DT, Plan, join_plans, make_plan
from loco_drake.generation.generate import chunk_labels
from loco_drake.generation.motion_model import (
    MotionModel,
    Stream,
    pretrained_motion_model,
)
from loco_drake.models.robots import Robot
from loco_drake.motion.gaits import LABELS, GaitLabel, GaitSchedule, parse_schedule

from .plan_producer import PlanProducer
from .scenario import GeneratedReference

_KEEP = 1.0  # seconds of plan kept behind what has been used up


@dataclass(frozen=True, eq=False)
class _Script(Immutable):
    """The plan so far and how to continue it."""

    schedule: GaitSchedule
    stream: Stream
    plan: Plan | None = None


class ReferenceGenerator(PlanProducer):
    """Generates a plan for a gait with the GPT, chunk by chunk, ahead of its use.

    .. pydrake_system::

        name: ReferenceGenerator
        input_ports:
        - gait: vector (1,), index into LABELS; optional
        - path_time: vector (1,), how much of the plan has been used; s; optional
        output_ports:
        - plan: abstract, Plan; open-ended

    ``path_time`` comes from the smoother; without it the Context's time is used. The
    configured gait may be a schedule, whose times are on the plan's clock and are kept
    to one token. The port ``gait`` overrides the schedule for chunks not yet generated,
    so a change takes effect after ``horizon`` and up to one chunk. The output depends
    only on the seed, the chunk's number and the labels: a cloned or reset Context
    repeats it exactly.

    Args:
        robot: the robot.
        config: gait, seed and sampling.
        model: the motion model; the shipped one by default.
        horizon: how far to generate ahead of what has been used, s.

    Raises:
        InputError: if the model does not know the gait, or a number in ``config`` is
            out of its bounds.
    """

    def __init__(
        self,
        robot: Robot,
        config: GeneratedReference | None = None,
        model: MotionModel | None = None,
        horizon: float = 3.0,
    ) -> None:
        super().__init__()
        self._robot = robot
        self._config = config or GeneratedReference()
        self._horizon = horizon
        self._config.check()
        self._model = model or pretrained_motion_model(robot.name)
        self._gait = self.DeclareVectorInputPort("gait", 1)
        self._path_time = self.DeclareVectorInputPort("path_time", 1)
        self._DeclarePlan(self._begun(self._config.gait, self._config.seed))

    def SetReference(
        self, context: Context, *, gait: str | None = None, seed: int | None = None
    ) -> None:
        """Restarts from plan time 0; see :func:`.simulator.StartEpisode`.

        Args:
            context: this system's own.
            gait: a gait label or a schedule; the configured one by default.
            seed: seed of the tokens; the configured one by default.

        Raises:
            InputError: if a value is out of its bounds.
        """
        config = replace(
            self._config,
            gait=self._config.gait if gait is None else gait,
            seed=self._config.seed if seed is None else seed,
        )
        config.check()
        self._set(context, self._begun(config.gait, config.seed))

    def _begun(self, gait: str, seed: int) -> _Script:
        """Returns the script at time 0 with its first chunks generated."""
        stream = self._model.start(
            np.array([seed]), duration=float(self._config.duration)
        )
        schedule = parse_schedule(gait)
        self._model.check_labels(schedule.at(schedule.starts))
        return self._written(_Script(schedule, stream), 0.0)

    def _next(self, context: Context, script: _Script) -> _Script:
        if self._gait.HasValue(context):
            gait = self._label(self._gait.Eval(context)[0])
            script = replace(script, schedule=GaitSchedule((gait,)))
        used = context.get_time()
        if self._path_time.HasValue(context):
            used = float(self._path_time.Eval(context)[0])
        return self._written(script, used)

    def _label(self, index: float) -> GaitLabel:
        """Returns the gait that the input port selects."""
        known = self._model.generator.config.labels
        choices = {k: label for k, label in enumerate(LABELS) if str(label) in known}
        if index not in choices:
            raise InputError(
                f"The input port gait must be the index of a gait, "
                f"{', '.join(f'{k} {label}' for k, label in choices.items())}; not "
                f"{index:g}."
            )
        return choices[int(index)]

    def _written(self, script: _Script, used: float) -> _Script:
        """Returns ``script`` with chunks added until the horizon is reached."""
        plan, stream = script.plan, script.stream
        while plan is None or plan.path_time[-1] < used + self._horizon:
            labels = chunk_labels(self._model, script.schedule, stream.chunk)
            stream, frames = self._model.extend(
                stream,
                labels[None],
                temperature=self._config.temperature,
                top_p=self._config.top_p,
            )
            count = 0 if plan is None else round(plan.path_time[-1] / PLAN_DT) + 1
            chunk = frames[0]
            added = make_plan(
                self._robot,
                q=chunk.q,
                v=chunk.v,
                contacts=chunk.contacts,
                labels=chunk.labels,
                start_time=count * PLAN_DT,
                path_time=PLAN_DT * np.arange(count, count + len(chunk.q)),
                open_ended=True,
            )
            plan = added if plan is None else join_plans(plan, added)
        old = int(np.searchsorted(plan.path_time, used - _KEEP))
        if old > self._model.chunk_frames:
            plan = plan.tail(old)
        return replace(script, stream=stream, plan=plan)
