"""A closed loop: its parts, and the readable form of its run, which specifies what the faster ones compute."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import accumulate
from typing import Any, TypeAlias

import numpy as np

from .._common.arrays import Array
from ..control.protocol import Controller
from ..control.provenance import provenance
from ..control.snapshot import fingerprint
from ..control.telemetry import FLAGS
from ..exceptions import DivergenceError, ParameterError
from ..interaction import Interaction, Sensor
from ..robot.arm_model import ArmModel
from ..trajectories import Trajectory
from .checkpoint import Checkpoint, RunState
from .plants import Motion, Plant, RigidPlant
from .plants.integrators import Integrator
from .result import SimulationResult
from .sampling import tick_times

SPEED_BOUND = 1e4
"""A joint faster than this has diverged [rad/s or m/s]."""

STIFF_FRICTION = 0.5
"""Share of a joint's speed that friction takes in a step, from which semi-implicit Euler takes it at the step's end."""

RK4_STABILITY = 2.7
"""Largest such share that the Runge-Kutta method bears."""

CHANNELS = ("q", "v", "q_r", "e1", "e2", "e_im", "s", "tau", "tau_ext", *FLAGS)
"""Channels of a `SimulationResult`, besides the time."""

OnTick: TypeAlias = Callable[[int, int], None]
"""Told (ticks done, ticks in all)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ClosedLoop:
    """The parts of one run, checked.

    Attributes:
        controller: The controller.
        plant: The simulated arm; a run works on a copy, so that it shares no work space with the controller.
        engine: What moves it; None for rigid links by ABA.
        trajectory: Desired motion.
        environment: What pushes on the plant.
        sensor: What tells the controller of that.
        q: Initial configuration, shape (nq,).
        v: Initial velocity, shape (nv,).
        ticks: Number of the last tick.
        substeps: Physics steps per control period.
        integrator: Of the plant.
    """

    controller: Controller[Any]
    plant: ArmModel
    engine: Plant[Any] | None
    trajectory: Trajectory
    environment: Interaction
    sensor: Sensor[Any]
    q: Array
    v: Array
    ticks: int
    substeps: int
    integrator: Integrator

    @property
    def h(self) -> float:
        """Length of a physics step [s]."""
        return self.controller.dt / self.substeps

    def friction_is_stiff(self) -> bool:
        """Whether a step has to take friction at its end.

        Raises:
            ParameterError: It has to, and the Runge-Kutta method cannot.
        """
        if not (self.plant.viscous.any() or self.plant.coulomb.any()):
            return False
        stiffness = self.h * self.plant.raw_dynamics.friction_rate(self.q)
        if self.integrator == "rk4" and stiffness > RK4_STABILITY:
            needed = int(np.ceil(self.substeps * stiffness / RK4_STABILITY))
            raise ParameterError(
                "integrator",
                "rk4",
                f"'semi-implicit' for friction this stiff, or at least {needed} substeps",
            )
        return self.integrator == "semi-implicit" and stiffness > STIFF_FRICTION

    def fingerprint(self) -> str:
        """Return what tells this run from others; trajectory and environment cannot be told."""
        return fingerprint(
            self.controller,
            self.plant,
            ticks=self.ticks,
            q0=self.q,
            v0=self.v,
            substeps=self.substeps,
            integrator=self.integrator,
            sensor=self.sensor,
            **self._engine(),
        )

    def _engine(self) -> dict[str, Any]:
        return {} if self.engine is None else {"engine": self.engine}

    def result(self, channels: dict[str, Any], samples: int) -> SimulationResult:
        """Return the first samples of a log as a result."""
        return SimulationResult(
            t=tick_times(range(samples), self.controller.dt),
            **{name: array[:samples] for name, array in channels.items()},
            provenance=provenance(
                self.controller,
                self.plant,
                substeps=self.substeps,
                integrator=self.integrator,
                sensor=self.sensor,
                **self._engine(),
            ),
            plant=self.plant,
        )

    def divergence(self, k: int, joint: int, channels: dict[str, Any]) -> DivergenceError:
        """Return the error of a joint that left every range in the period after tick k."""
        name, time = self.plant.joint_names[joint], k * self.controller.dt
        return DivergenceError(time, name, self.result(channels, k + 1))


def run(
    loop: ClosedLoop, on_tick: OnTick | None = None, checkpoint: Checkpoint | None = None
) -> SimulationResult:
    """Run a closed loop with any controller, environment and sensor.

    Raises:
        DivergenceError: A joint left every sensible range.
        SnapshotError: The checkpoint is of another run, or damaged.
    """
    controller, sensor, period = loop.controller, loop.sensor, _Period(loop)
    plant, log = period.plant, _Log(loop.ticks + 1, loop.plant.nq, loop.plant.nv)
    moved = plant.begin(loop.q, loop.v, loop.h)
    start = RunState(0, moved, np.zeros(loop.plant.nv), controller.init(), sensor.init())
    if checkpoint is not None:
        start = checkpoint.begin(start, log.channels, loop.fingerprint())
    first, moved, tau, state, sensed = start
    for k in range(first, loop.ticks + 1):
        t, (q, v) = k * controller.dt, plant.measured(moved)
        tau_ext = plant.external_torque(moved, loop.environment, t)
        told, sensed = sensor.step(sensed, q, v, tau, tau_ext)
        output, state = controller.step(state, q, v, loop.trajectory(t), told)
        tau = output.tau
        a = plant.acceleration(moved, tau, tau_ext)
        log.write(k, plant.motion(moved), output, controller.impedance_error(output, a), tau_ext)
        if on_tick is not None:
            on_tick(k, loop.ticks)
        if k < loop.ticks:
            moved = period.advance(k, moved, tau, log)
            if checkpoint is not None:
                checkpoint.offer(RunState(k + 1, moved, tau, state, sensed), log.channels)
    return loop.result(log.channels, loop.ticks + 1)


class _Period:
    """The plant between two ticks."""

    def __init__(self, loop: ClosedLoop) -> None:
        self.loop = loop
        self.plant: Plant[Any] = loop.engine or RigidPlant(
            loop.plant, loop.integrator, loop.friction_is_stiff()
        )

    def advance(self, k: int, moved: Any, tau: Array, log: _Log) -> Any:
        """Advance by one control period under a held torque."""
        loop, h = self.loop, self.loop.h
        for i in range(loop.substeps):
            t = k * loop.controller.dt + i * h
            moved = self.plant.step(moved, tau, loop.environment, t, h)
            speed = np.abs(self.plant.motion(moved).v)
            if not (speed < SPEED_BOUND).all():
                joint = int(np.argmax(speed))  # NaN counts as the largest
                raise loop.divergence(k, joint, log.channels)
        return moved


class _Log:
    """Preallocated channels, first axis time."""

    def __init__(self, samples: int, nq: int, nv: int) -> None:
        self.channels = empty_channels(samples, nq, nv)

    def write(self, k: int, motion: Motion, output: Any, e_im: Array, tau_ext: Array) -> None:
        channels = self.channels
        channels["q"][k], channels["v"][k] = motion
        channels["e_im"][k], channels["tau_ext"][k] = e_im, tau_ext
        for name in ("q_r", "e1", "e2", "s", "tau", *FLAGS):
            channels[name][k] = getattr(output, name)


def empty_channels(
    samples: int, nq: int, nv: int, names: Iterable[str] = CHANNELS
) -> dict[str, Any]:
    """Return arrays for channels of a `SimulationResult`, by default all but the time.

    All lie in one block: the system hands large blocks out in large pages, which a run fills with far fewer faults.
    """
    kinds = {name: np.dtype(bool if name in FLAGS else float) for name in names}
    shapes = {name: (samples, nq if name in ("q", "q_r") else nv) for name in kinds}
    words = [math.ceil(math.prod(shapes[name]) * kind.itemsize / 8) for name, kind in kinds.items()]
    block = np.empty(sum(words))
    starts = accumulate(words, initial=0)
    return {
        name: np.ndarray(shapes[name], kind, block.data, 8 * start)
        for (name, kind), start in zip(kinds.items(), starts, strict=False)
    }
