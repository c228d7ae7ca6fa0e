"""Drives: simulations that follow a driver's orders, and the record of these."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from loco_drake.common.arrays import Array, Integers
from loco_drake.common.rotations import yaw_of
from loco_drake.control.domain import Domain, Push
from loco_drake.control.driving import COMMAND, PUSH, RESET, OrderTable, order_table
from loco_drake.control.plan import PLAN_DT
from loco_drake.control.state import ORIENTATION
from loco_drake.evaluation.steering import reference_latency
from loco_drake.evaluation.tracking import Recorder, Rollout
from loco_drake.systems.domain import SetDomain
from loco_drake.systems.simulator import PlaceOnPlan
from loco_drake.tracking.randomization import PUSH_DURATION

# s; a command that differs no more than this late is one that is not followed.
_LONGEST_LATENCY = 1.0


@dataclass(frozen=True)
class Driven:
    """What came of a drive."""

    rollout: Rollout  # the reward is 0 while the robot lies
    table: OrderTable  # the orders in every control period
    falls: int
    lying: Integers  # samples at which the robot lies
    # Index into LABELS of the gait that was asked for or chosen in each control period.
    gaits: Integers
    # Seconds from a change of the command to the first sample of the plan that differs.
    latencies: list[float]
    wall: float  # seconds inside AdvanceTo


def drive(
    recorder: Recorder,
    steps: int | None,
    after_step: Callable[[float, Array], bool],
) -> Driven:
    """Simulates a drive; call :meth:`Recorder.start` first.

    Orders to push or to reset are carried out at the end of the control period at whose
    beginning they were sampled. A reset puts the robot where its plan is. All depends
    on the orders alone, so the same orders give the same states, to the last bit.

    Args:
        recorder: has a source and, for pushes, the disturbance of that name.
        steps: number of control periods; None for no end.
        after_step: called after each with the context's time, s, and the orders, shape
            (ORDERS,); returns whether to go on.
    """
    diagram, context = recorder.diagram, recorder.context
    source = diagram.GetSubsystemByName("command_source")
    source_context = source.GetMyContextFromRoot(context)
    times: list[float] = []
    rows: list[Array] = []
    lying: list[int] = []
    gaits: list[float] = []
    selector = diagram.GetSubsystemByName("gait_selector")
    gait = selector.GetOutputPort("gait")
    latencies = _Latencies(recorder)
    wall, done, falls = 0.0, 0, 0
    lies, goes_on = False, True
    while goes_on and (steps is None or done < steps):
        start = time.perf_counter()
        recorder.simulator.AdvanceTo((done + 1) * PLAN_DT)
        wall += time.perf_counter() - start
        orders = source.orders(source_context)
        latencies.update(done * PLAN_DT, orders[COMMAND])
        gaits.append(gait.Eval(selector.GetMyContextFromRoot(context))[0])
        acts = orders[PUSH] != 0 or orders[RESET] != 0
        if not rows or acts or (orders[:PUSH] != rows[-1][:PUSH]).any():
            times.append(done * PLAN_DT)
            rows.append(orders)
        done += 1
        falls += recorder.fell and not lies
        lies = recorder.fell
        if lies:
            lying.append(done)
        if orders[RESET]:
            PlaceOnPlan(diagram, context)
            lies = recorder.fell = False
        if orders[PUSH]:
            _push(recorder, float(orders[PUSH]))
        goes_on = after_step(done * PLAN_DT, orders)
    rollout = recorder.rollout(done, done)
    reward = rollout.reward
    reward[lying] = 0.0
    rollout = replace(rollout, reward=reward, fell=falls > 0)
    return Driven(
        rollout,
        order_table(times, rows),
        falls,
        np.array(lying, dtype=np.int64),
        np.array(gaits, dtype=np.int64),
        latencies.found,
        wall,
    )


class _Latencies:
    """Measures how soon the plan differs after a change of the command."""

    def __init__(self, recorder: Recorder) -> None:
        self._context = recorder.context
        self._port = recorder.diagram.GetOutputPort("plan")
        self._command: Array | None = None
        self._plan = self._port.Eval(self._context)
        self._changed: float | None = None  # when the change came that is waited for
        self.found: list[float] = []

    def update(self, begun: float, command: Array) -> None:
        """Takes note of the control period that began at ``begun``, s."""
        if self._command is not None and (command != self._command).any():
            # Of changes that come before the plan differs, the first counts.
            self._changed = begun if self._changed is None else self._changed
        self._command = command
        plans = [self._plan, self._port.Eval(self._context)]
        self._plan = plans[1]
        if self._changed is None:
            return
        due = reference_latency(plans, 0)
        if due is not None:
            self.found.append(due - self._changed)
        if due is not None or begun - self._changed > _LONGEST_LATENCY:
            self._changed = None


def _push(recorder: Recorder, impulse: float) -> None:
    """Pushes the trunk to its left with an impulse in N s; another push ends."""
    context = recorder.context
    state = recorder.diagram.GetOutputPort("state").Eval(context)
    yaw = yaw_of(state[ORIENTATION])
    left_W = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    push = Push(
        start=context.get_time(),
        duration=PUSH_DURATION,
        force_W=impulse / PUSH_DURATION * left_W,
    )
    SetDomain(recorder.diagram, context, Domain(pushes=(push,)))
