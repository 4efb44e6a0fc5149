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
from ..control.telemetry import CHANNELS
from ..control.tool_view import ToolTick
from ..control.wrapper import tool_inside
from ..exceptions import DivergenceError, ParameterError
from ..interaction import Interaction, Sensor, Sum
from ..robot.arm_model import ArmModel
from ..trajectories import Trajectory
from .checkpoint import Checkpoint, RunState
from .forces import Forces
from .joint_stops import JointStops
from .plants import Plant, RigidPlant
from .plants.integrators import Integrator
from .plants.protocol import SPEED_BOUND as SPEED_BOUND  # noqa: PLC0414 (part of this module's interface)
from .result import SimulationResult
from .sampling import tick_times
from .tool_log import empty_tool_channels, tool_log, write_tool
from .violations import limits_of

STIFF_FRICTION = 0.5
"""Share of a joint's speed that friction takes in a step, from which semi-implicit Euler takes it at the step's end."""

RK4_STABILITY = 2.7
"""Largest such share that the Runge-Kutta method tolerates."""

LOGGED = {c.name: c for c in CHANNELS if c.source != "derived" and c.name != "t"}
"""Channels that the loop writes at every tick, by name."""

_OUTPUT = tuple(c.name for c in CHANNELS if c.source == "controller")

OnTick: TypeAlias = Callable[[int, int], None]
"""Called with (ticks done, ticks in all)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ClosedLoop:
    """The parts of one run, checked.

    Attributes:
        controller: The controller.
        plant: The simulated arm; a run works on a copy, so that it shares no work space with the controller.
        engine: What moves it; None for rigid links by ABA.
        trajectory: Desired motion.
        environment: What pushes on the plant.
        sensor: The controller's measurement of that.
        q: Initial configuration, shape (nq,).
        v: Initial velocity, shape (nv,).
        ticks: Number of the last tick.
        substeps: Physics steps per control period.
        integrator: Of the plant.
        stops: Of the plant's joints; None for none.
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
    stops: JointStops | None = None

    @property
    def acting(self) -> Interaction:
        """All that pushes on the joints besides the motors: the environment and the stops."""
        return self.environment if self.stops is None else Sum(self.environment, self.stops)

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
        dynamics = self.plant.raw_dynamics
        if self.h * dynamics.friction_rate_bound() <= min(STIFF_FRICTION, RK4_STABILITY):
            return False
        stiffness = self.h * dynamics.friction_rate(self.q)
        if self.integrator == "rk4" and stiffness > RK4_STABILITY:
            needed = int(np.ceil(self.substeps * stiffness / RK4_STABILITY))
            raise ParameterError(
                "integrator",
                "rk4",
                f"'semi-implicit' for friction this stiff, or at least {needed} substeps",
            )
        return self.integrator == "semi-implicit" and stiffness > STIFF_FRICTION

    def fingerprint(self) -> str:
        """Return what distinguishes this run from others, except trajectory and environment."""
        return fingerprint(
            self.controller,
            self.plant,
            ticks=self.ticks,
            q0=self.q,
            v0=self.v,
            **self._settings(),
        )

    def _settings(self) -> dict[str, Any]:
        """How the loop is computed; an engine and stops where there are any."""
        always = {"substeps": self.substeps, "integrator": self.integrator, "sensor": self.sensor}
        options = {"engine": self.engine, "joint_stops": self.stops}
        return always | {name: value for name, value in options.items() if value is not None}

    def empty_log(self) -> dict[str, Any]:
        """Return arrays for all that the run logs, first axis time."""
        samples, arm = self.ticks + 1, self.plant
        channels = empty_channels(samples, arm.nq, arm.nv)
        if tool_inside(self.controller) is not None:
            channels |= empty_tool_channels(samples, arm.nv)
        return channels

    def result(
        self, channels: dict[str, Any], samples: int, diverged: str | None = None
    ) -> SimulationResult:
        """Return the first samples of a log as a result, which ended early where a joint has diverged."""
        origin = provenance(self.controller, self.plant, **self._settings())
        if diverged is not None:
            time = (samples - 1) * self.controller.dt
            origin["diverged"] = {"time": time, "joint": diverged}
        return SimulationResult(
            t=tick_times(range(samples), self.controller.dt),
            **{name: array[:samples] for name, array in channels.items() if name in LOGGED},
            tool=tool_log({name: array[:samples] for name, array in channels.items()}),
            provenance=origin | {"limits": limits_of(self.plant)},
            forces=Forces(self.environment, self.stops),
            plant=self.plant,
        )

    def divergence(self, k: int, joint: int, channels: dict[str, Any]) -> DivergenceError:
        """Return the error of a joint that left every range in the period after tick k."""
        name, time = self.plant.joint_names[joint], k * self.controller.dt
        return DivergenceError(time, name, self.result(channels, k + 1, name))


def run(
    loop: ClosedLoop, on_tick: OnTick | None = None, checkpoint: Checkpoint | None = None
) -> SimulationResult:
    """Run a closed loop with any controller, environment and sensor.

    Raises:
        DivergenceError: A joint left every sensible range.
        SnapshotError: The checkpoint is of another run, or damaged.
    """
    controller, sensor = loop.controller, loop.sensor
    plant: Plant[Any] = loop.engine or RigidPlant(
        loop.plant, loop.integrator, loop.friction_is_stiff()
    )
    channels = loop.empty_log()
    moved = plant.begin(loop.q, loop.v, loop.h)
    start = RunState(0, moved, np.zeros(loop.plant.nv), controller.init(), sensor.init())
    if checkpoint is not None:
        start = checkpoint.begin(start, channels, loop.fingerprint())
    first, moved, tau, state, sensed = start
    stops = loop.stops
    for k in range(first, loop.ticks + 1):
        t, (q, v) = k * controller.dt, plant.measured(moved)
        tau_ext = plant.external_torque(moved, loop.environment, t)
        told, sensed = sensor.step(sensed, q, v, tau, tau_ext)
        output, state = controller.step(state, q, v, loop.trajectory(t), told)
        tau = output.tau
        stop = 0.0 if stops is None else stops.torque(loop.plant, t, *plant.motion(moved))
        a = plant.acceleration(moved, tau, tau_ext + stop)
        channels["q"][k], channels["v"][k] = plant.motion(moved)
        channels["e_im"][k] = controller.impedance_error(output, a)
        channels["tau_ext"][k] = tau_ext
        for name in _OUTPUT:
            channels[name][k] = getattr(output, name)
        if isinstance(output, ToolTick):
            write_tool(channels, k, output.at_tool)
        if on_tick is not None:
            on_tick(k, loop.ticks)
        if k < loop.ticks:
            moved = _advance(loop, plant, k, moved, tau, channels)
            if checkpoint is not None:
                checkpoint.offer(RunState(k + 1, moved, tau, state, sensed), channels)
    return loop.result(channels, loop.ticks + 1)


def _advance(
    loop: ClosedLoop, plant: Plant[Any], k: int, moved: Any, tau: Array, channels: dict[str, Any]
) -> Any:
    """Advance the plant by one control period under a held torque."""
    h, acting = loop.h, loop.acting
    for i in range(loop.substeps):
        moved = plant.step(moved, tau, acting, k * loop.controller.dt + i * h, h)
        speed = np.abs(plant.motion(moved).v)
        if not (speed < SPEED_BOUND).all():
            joint = int(np.argmax(speed))  # NaN counts as the largest
            raise loop.divergence(k, joint, channels)
    return moved


def empty_channels(
    samples: int, nq: int, nv: int, names: Iterable[str] = tuple(LOGGED)
) -> dict[str, Any]:
    """Return arrays for channels of a `SimulationResult`, by default all that the loop writes.

    All lie in one block: the system hands large blocks out in large pages, which a run fills with far fewer faults.
    """
    channels = [LOGGED[name] for name in names]
    shapes = [channel.shape(samples, nq, nv) for channel in channels]
    kinds = [np.dtype(bool if channel.is_flag else float) for channel in channels]
    words = [
        math.ceil(math.prod(shape) * kind.itemsize / 8)
        for shape, kind in zip(shapes, kinds, strict=True)
    ]
    block = np.empty(sum(words))
    return {
        channel.name: np.ndarray(shape, kind, block.data, 8 * start)
        for channel, shape, kind, start in zip(
            channels, shapes, kinds, accumulate(words, initial=0), strict=False
        )
    }
