"""What `bench` times, and how: ticks and closed loops, by turns with `pin.rnea`, less what reading the clock costs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import cycle, islice
from time import perf_counter_ns as clock
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin

from .._common.arrays import Array
from ..control.cartesian import CartesianController
from ..control.controller import ImpedanceController
from ..control.protocol import Backend
from ..law.impedance import Impedance
from ..law.poses import CartesianReference, Pose
from ..law.super_twisting import Scheme, SuperTwisting
from ..robot.arm_model import ArmModel
from ..robot.tool_kinematics import ToolKinematics
from ..simulation.batch import simulate_batch
from ..simulation.run import simulate
from ..simulation.scenarios import SurfaceName, paper_surface
from ..trajectories import Reference, Trajectory, cosine

Ticks: TypeAlias = Iterator[int]
"""Does one thing at every `next`, and yields the clock when it is done [ns]."""

Timer: TypeAlias = Callable[[int], Array]
"""Does a thing so many times and returns how long each took [µs]."""

Progress: TypeAlias = Callable[[int, int], None]
"""Called with (done, in all)."""

BACKENDS: tuple[Backend, ...] = ("pinocchio", "compiled")
RNEA = "pin.rnea"
STEP = {backend: f"step, {backend}" for backend in BACKENDS}
REALTIME = {backend: f"realtime torque, {backend}" for backend in BACKENDS}
AT_TOOL = {backend: f"step at the tool, {backend}" for backend in BACKENDS}
SIMULATE = {backend: f"simulate, {backend}" for backend in BACKENDS}
DT = 1e-3
STATES = 64

_WARM_UP, _COST_SAMPLES = 30, 200


class Inputs(NamedTuple):
    """What one tick is given.

    Attributes:
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        reference: Desired motion.
        tau_ext: Torque of the environment, shape (nv,).
    """

    q: Array
    v: Array
    reference: Reference
    tau_ext: Array


def controller(
    arm: ArmModel,
    backend: Backend,
    surface: SurfaceName = "fast-terminal",
    scheme: Scheme = "matched",
) -> ImpedanceController:
    """Return the controller that is measured, warmed up."""
    made = ImpedanceController(
        arm,
        impedance=Impedance(mass=1.0, damping=10.0, stiffness=20.0),
        surface=paper_surface(surface),
        reaching=SuperTwisting(8.0, 10.0, scheme),
        dt=DT,
        backend=backend,
    )
    made.warm_up()
    return made


def motion(arm: ArmModel) -> Trajectory:
    """Return the motion: every joint about the middle of its range, where it has one."""
    bounded = np.isfinite(arm.lower) & np.isfinite(arm.upper)
    center = np.array(arm.neutral)
    center[bounded] = (arm.lower[bounded] + arm.upper[bounded]) / 2.0
    return cosine(arm, center=center, amplitude=0.2, period=6.0)


def inputs(arm: ArmModel, seed: int = 0) -> list[Inputs]:
    """Return what ticks along a motion see.

    Joints swing by 0.2 rad in 6 s about the middle of their range, with errors about 1e-3 rad and 1e-2 rad/s.
    """
    rng, trajectory = np.random.default_rng(seed), motion(arm)
    found = []
    for t in np.linspace(0.0, 6.0, STATES, endpoint=False):
        reference, noise = trajectory(float(t)), rng.normal(size=(3, arm.nv))
        q = arm.raw_dynamics.integrate(reference.q, 1e-3 * noise[0])
        found.append(Inputs(q, reference.v + 1e-2 * noise[1], reference, noise[2]))
    return found


def repeated(call: Callable[..., Any], rows: Sequence[tuple[Any, ...]]) -> Ticks:
    """Any call, over and over."""
    for arguments in cycle(rows):
        call(*arguments)
        yield clock()


def rnea(arm: ArmModel, given: Sequence[Inputs]) -> Ticks:
    """`pin.rnea` called from Python: the yardstick."""
    model, data = arm.model, arm.model.createData()
    return repeated(pin.rnea, [(model, data, x.q, x.v, x.reference.a) for x in given])


def step(made: ImpedanceController, given: Sequence[Inputs]) -> Ticks:
    """`controller.step` with telemetry, one tick after the other."""
    state, tick = made.init(), made.step
    for q, v, reference, tau_ext in cycle(given):
        _, state = tick(state, q, v, reference, tau_ext)
        yield clock()


def realtime(made: ImpedanceController, given: Sequence[Inputs]) -> Ticks:
    """`RealtimeController.torque`, one tick after the other."""
    return repeated(made.realtime().torque, [tuple(x) for x in given])


def step_at_tool(arm: ArmModel, backend: Backend, given: Sequence[Inputs]) -> Ticks:
    """`CartesianController.step` along the same motion, with the same errors and a wrench.

    Raises:
        UnsupportedJointError: The arm has joints that mimic others.
    """
    made, kinematics = CartesianController(arm, backend=backend), ToolKinematics(arm)
    rows = []
    for q, v, (q_d, v_d, a_d), tau_ext in given:
        R, p, J, velocity, drift = kinematics.motion(q_d, v_d)
        there = CartesianReference(Pose(R, p), velocity, J @ a_d + drift)
        rows.append((q, v, there, np.resize(tau_ext, 6)))
    state, tick = made.init(), made.step
    for each in cycle(rows):
        _, state = tick(state, *each)
        yield clock()


def timer(ticks: Ticks) -> Timer:
    """Return what times ticks, from one reading of the clock to the next, less what the reading costs."""

    def durations(count: int) -> Array:
        cost = np.median(_intervals(_idle(), _COST_SAMPLES))
        return (_intervals(ticks, count) - cost) / 1e3

    return durations


def simulate_timer(arm: ArmModel, backend: Backend) -> Timer:
    """Return what times a run of `simulate` of so many ticks, one physics step a tick, logs included, per tick.

    Args:
        arm: Controller's model and plant.
        backend: Of the controller.
    """
    made, trajectory = controller(arm, backend), motion(arm)
    return _run_timer(partial(simulate, made, arm, trajectory, q0=trajectory(0.0).q, substeps=1))


def batch_timer(arm: ArmModel, worlds: Sequence[ArmModel], threads: int) -> Timer:
    """Return what times a run of `simulate_batch` of so many ticks, metrics included, per world and tick.

    Args:
        arm: The controller's model.
        worlds: One plant each.
        threads: How many to use.
    """
    made, trajectory = controller(arm, "compiled"), motion(arm)
    given, start = (made, worlds, trajectory), trajectory(0.0).q
    call = partial(simulate_batch, *given, q0=start, substeps=1, threads=threads)
    return _run_timer(call, len(worlds))


def plants(arm: ArmModel, count: int, seed: int = 0) -> list[ArmModel]:
    """Return arms that differ: each with a payload of its own, up to 2 kg."""
    rng = np.random.default_rng(seed)
    return [arm.with_payload(float(mass)) for mass in rng.uniform(0.0, 2.0, count)]


def interleaved(
    timers: Mapping[str, Timer], count: int, *, rounds: int = 50, on_tick: Progress | None = None
) -> dict[str, Array]:
    """Time several things by turns, so that a disturbance of the machine meets all of them.

    Each turn begins with a few that do not count, since the others have had the caches.

    Args:
        timers: What to time, by name.
        count: How many times each.
        rounds: In how many turns.
        on_tick: Called after each turn.

    Returns:
        Durations [µs] by name.
    """
    rounds = min(rounds, count)
    found: dict[str, list[Array]] = {name: [] for name in timers}
    for k in range(rounds):
        for name, measure in timers.items():
            measure(_WARM_UP)
            found[name].append(measure(count // rounds))
        if on_tick is not None:
            on_tick(k + 1, rounds)
    return {name: np.concatenate(parts) for name, parts in found.items()}


def _intervals(ticks: Ticks, count: int) -> Array:
    start = clock()
    stamps = np.fromiter(islice(ticks, count), np.int64, count)
    return np.diff(stamps, prepend=start).astype(np.float64)


def _idle() -> Ticks:
    while True:
        yield clock()


def _run_timer(run: Callable[..., object], worlds: int = 1) -> Timer:
    """What times runs of so many ticks, per tick and world."""

    def durations(count: int) -> Array:
        start = clock()
        run(duration=count * DT)
        return np.array([(clock() - start) / 1e3 / (count + 1) / worlds])

    return durations
