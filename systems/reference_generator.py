"""The system that generates motion of a gait while the simulation runs."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context

from loco_drake.common.arrays import Array
from loco_drake.common.errors import InputError
from loco_drake.common.immutable import Immutable
from loco_drake.control.command import check_finite
from loco_drake.control.plan import PLAN_DT, UPDATE_PERIOD, Plan, join_plans, make_plan
from loco_drake.generation.generate import token_labels
from loco_drake.generation.motion_model import (
    MotionModel,
    Stream,
    motion_model_of,
)
from loco_drake.models.robots import Robot
from loco_drake.motion.gaits import LABELS, GaitLabel, GaitSchedule, parse_schedule

from .plan_producer import PlanProducer
from .scenario import GeneratedReference

# A command that differs less from what is told, in m/s and rad/s, is not told: to write
# ahead again takes longer than an update, and a driver's keys change it all the time.
LEAST_CHANGE = 0.05
_KEEP = 1.0  # seconds of plan kept behind what can no longer change


@dataclass(frozen=True, eq=False)
class _Chunk(Immutable):
    """One call of the motion model."""

    before: Stream  # the stream that it extended
    frames: int  # frames of the plan before it
    lead: int  # tokens at its beginning that only gave context
    tokens: NDArray[np.int64]  # shape (1, n, codebooks)
    labels: NDArray[np.int64]  # of the tokens, shape (1, n)
    told: NDArray[np.float64]  # velocities of the tokens, see Stream, shape (1, n, 3)


@dataclass(frozen=True, eq=False)
class _Script(Immutable):
    """The plan so far and how to continue it, from its end or from a token before."""

    schedule: GaitSchedule
    stream: Stream
    plan: Plan | None = None
    chunks: tuple[_Chunk, ...] = ()
    told: tuple[float, ...] | None = None  # the velocity that new tokens are told

    @property
    def frames(self) -> int:
        """Number of frames generated so far, which is that of the next one."""
        if self.plan is None:
            return 0
        return round(self.plan.path_time[-1] / PLAN_DT) + 1


class ReferenceGenerator(PlanProducer):
    """Generates a plan for a gait with the GPT, chunk by chunk, ahead of its use.

    .. pydrake_system::

        name: ReferenceGenerator
        input_ports:
        - gait: vector (1,), index into LABELS, nan for the configured one; optional
        - path_time: vector (1,), how much of the plan has been used; s; optional
        - fixed_time: vector (1,), plan time up to which nothing changes; s; optional
        - command: vector (3,), velocity to be told: forward, sideways, yaw rate in H;
          m/s, rad/s; NaN for none; optional
        output_ports:
        - plan: abstract, Plan; open-ended

    ``path_time`` and ``fixed_time`` come from the smoother; without it the Context's
    time and ``path_time`` are used. The configured gait may be a schedule, whose times
    are on the plan's clock and are kept to one token. The port ``gait`` overrides the
    schedule: what comes later than ``fixed_time`` by an update and up to a token is
    generated again, and so it is if ``command`` differs by more than ``LEAST_CHANGE``
    from what was told last. H is the base's heading frame. The output depends only on
    the seed, the chunks' numbers, the labels and what was told: a cloned or reset
    Context repeats it exactly.

    Args:
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
        own = self._config
        self._model = model or motion_model_of(
            robot.definition, own.tokenizer, own.generator
        )
        # Whether the model learned from grounded motion only.
        self.grounded = self._model.grounded
        self._gait = self.DeclareVectorInputPort("gait", 1)
        self._path_time = self.DeclareVectorInputPort("path_time", 1)
        self._fixed_time = self.DeclareVectorInputPort("fixed_time", 1)
        self._command = self.DeclareVectorInputPort("command", 3)
        self._DeclarePlan(self._begun(self._config.gait, self._config.seed))

    def SetReference(
        self, context: Context, *, gait: str | None = None, seed: int | None = None
    ) -> None:
        """Restarts from plan time 0; see :func:`.simulator.StartEpisode`.

        Gait, a label or a schedule, and seed are the configured ones by default.
        ``context`` is this system's own.

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
        return self._written(_Script(schedule, stream), 0.0, 0.0)

    def _next(self, context: Context, script: _Script) -> _Script:
        used = context.get_time()
        if self._path_time.HasValue(context):
            used = float(self._path_time.Eval(context)[0])
        fixed = used
        if self._fixed_time.HasValue(context):
            fixed = float(self._fixed_time.Eval(context)[0])
        asked = self._gait.Eval(context)[0] if self._gait.HasValue(context) else np.nan
        if not np.isnan(asked):
            schedule = GaitSchedule((self._label(asked),))
            if schedule != script.schedule:
                script = self._rewound(script, fixed + UPDATE_PERIOD + PLAN_DT)
                script = replace(script, schedule=schedule)
                used = min(used, fixed)
        if self._command.HasValue(context):
            told = self._to_tell(script, self._command.Eval(context))
            if told != script.told:
                script = self._rewound(script, fixed + UPDATE_PERIOD + PLAN_DT)
                script = replace(script, told=told)
                used = min(used, fixed)
        return self._written(script, used, fixed)

    def _to_tell(self, script: _Script, command: Array) -> tuple[float, ...] | None:
        """Returns the velocity to be told, which small changes leave as it was."""
        if np.isnan(command).all():
            return None
        check_finite(command)
        told = script.told
        if told is not None and np.abs(command - told).max() <= LEAST_CHANGE:
            return told
        self._model.check_told()
        return tuple(command.tolist())

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

    def _rewound(self, script: _Script, time: float) -> _Script:
        """Returns ``script`` up to its first token that begins at ``time`` or later."""
        per_token = self._model.frames_per_token
        token = int(np.ceil(time / PLAN_DT / per_token - 1e-6))
        if token * per_token >= script.frames or script.plan is None:
            return script
        chunks = [c for c in script.chunks if c.frames < token * per_token]
        last = chunks.pop()
        tokens = last.lead + token - last.frames // per_token
        stream, _ = self._model.append(
            last.before,
            last.tokens[:, :tokens],
            last.labels[:, :tokens],
            last.told[:, :tokens],
        )
        cut = replace(last, tokens=last.tokens[:, :tokens])
        end = token * per_token - round(script.plan.start_time / PLAN_DT)
        plan = script.plan.slice(0, end)
        return replace(script, stream=stream, plan=plan, chunks=(*chunks, cut))

    def _written(self, script: _Script, used: float, fixed: float) -> _Script:
        """Returns ``script`` with chunks added until the horizon is reached."""
        while script.frames * PLAN_DT <= used + self._horizon:
            script = self._extended(script)
        plan, chunks = script.plan, script.chunks
        assert plan is not None
        old = int(np.searchsorted(plan.path_time, fixed - _KEEP))
        if old > self._model.chunk_frames:
            plan = plan.slice(old)
            first = round(plan.start_time / PLAN_DT)
            chunks = tuple(
                chunk
                for chunk, later in zip(chunks, [*chunks[1:], None], strict=True)
                if later is None or later.frames > first
            )
            script = replace(script, plan=plan, chunks=chunks)
        return script

    def _extended(self, script: _Script) -> _Script:
        """Returns ``script`` with one more chunk."""
        plan, count = script.plan, script.frames
        labels = token_labels(
            self._model, script.schedule, count // self._model.frames_per_token
        )
        before = script.stream
        stream, frames = self._model.extend(
            before,
            labels[None],
            velocity=None if script.told is None else np.array([script.told]),
            temperature=self._config.temperature,
            top_p=self._config.top_p,
        )
        times = PLAN_DT * np.arange(count, count + frames.q.shape[1], dtype=np.float64)
        added = make_plan(
            self._robot,
            **vars(frames[0]),
            start_time=count * PLAN_DT,
            path_time=times,
            open_ended=True,
        )
        lead = 0 if before.chunk else self._model.lead
        tokens = len(labels) + lead
        chunk = _Chunk(
            before,
            count,
            lead,
            tokens=stream.tokens[:, -tokens:],
            labels=stream.labels[:, -tokens:],
            told=stream.told[:, -tokens:],
        )
        return replace(
            script,
            stream=stream,
            plan=added if plan is None else join_plans(plan, added),
            chunks=(*script.chunks, chunk),
        )
