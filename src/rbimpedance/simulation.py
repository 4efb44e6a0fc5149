"""The closed loop: a controller at its period, a plant of its own by ABA in between, and the log of both."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import Array, positive_number, vector
from .controller import Controller
from .dynamics import ArmModel, PinocchioDynamics
from .exceptions import DivergenceError, GainError
from .integrators import INTEGRATORS, Integrator
from .interaction import Interaction, Perfect, Sensor, TimeFunction, as_interaction
from .result import SimulationResult, provenance
from .trajectories import Trajectory

SPEED_BOUND = 1e4
"""A joint faster than this has diverged [rad/s or m/s]."""

STIFF_FRICTION = 0.5
"""Share of a joint's speed that friction takes in a step, from which semi-implicit Euler takes it at the step's end."""

RK4_STABILITY = 2.7
"""Largest such share that the Runge-Kutta method bears."""


def simulate(
    controller: Controller[Any],
    plant: ArmModel,
    trajectory: Trajectory,
    *,
    wrench: Interaction | ArrayLike | TimeFunction | None = None,
    sensor: Sensor[Any] | None = None,
    q0: ArrayLike | None = None,
    v0: ArrayLike | None = None,
    duration: float,
    substeps: int = 4,
    integrator: Integrator = "semi-implicit",
    on_tick: Callable[[int, int], None] | None = None,
) -> SimulationResult:
    """Run a controller against a plant.

    At t = k·dt the controller sees the plant's state and the torque of the environment, and its torque is then held
    for one period, in which the plant takes `substeps` steps; the environment acts at every one of them.

    Args:
        controller: Any object with `arm`, `dt`, `init`, `step` and `impedance_error`.
        plant: The arm that is simulated; give it what the controller does not know. It is copied: controller and
            plant never share a model.
        trajectory: Desired motion as a function of time.
        wrench: Environment: None, an `Interaction` (`FrameWrench`, `JointTorque`, ...), or a wrench (6,) at the tool
            frame in world axes, constant or as a function of time.
        sensor: What tells the controller the environment's torque: late, filtered, or estimated without a force sensor.
            The truth by default. The result logs the truth; `sense` gives what was told.
        q0: Initial configuration, shape (nq,); `plant.neutral` by default.
        v0: Initial velocity, shape (nv,); at rest by default.
        duration: Length of the run [s], a multiple of the control period.
        substeps: Physics steps per control period, a positive whole number.
        integrator: "semi-implicit" (Euler, first order) or "rk4" (fourth order).
        on_tick: Called with (ticks done, ticks in all), for a progress bar.

    Returns:
        The log at every tick, t = 0 and t = duration included.

    Raises:
        DivergenceError: A joint left every sensible range; carries time, joint and the result so far.
        GainError: A duration that is no multiple of the period, a bad number of substeps, an unknown integrator, or a
            controller made for another number of joints.
        DimensionError: An input of wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
    """
    ticks = _number_of_ticks(duration, controller.dt)
    _check_substeps(substeps)
    if integrator not in INTEGRATORS:
        raise GainError("integrator", integrator, "one of " + ", ".join(map(repr, INTEGRATORS)))
    if (controller.arm.nq, controller.arm.nv) != (plant.nq, plant.nv):
        raise GainError(
            "plant",
            repr(plant),
            f"an arm with the controller's nq, nv = {controller.arm.nq}, {controller.arm.nv}",
        )
    plant = plant.copy()
    q = np.array(plant.neutral if q0 is None else plant.check_configuration("q0", q0))
    v = np.zeros(plant.nv) if v0 is None else vector("v0", v0, plant.nv).copy()
    sensor = Perfect() if sensor is None else sensor
    environment = as_interaction(wrench)
    loop = _ClosedLoop(controller, plant, trajectory, environment, sensor, substeps, integrator)
    return loop.run(q, v, ticks, on_tick)


class _ClosedLoop:
    """The parts of one run."""

    def __init__(
        self,
        controller: Controller[Any],
        plant: ArmModel,
        trajectory: Trajectory,
        environment: Interaction,
        sensor: Sensor[Any],
        substeps: int,
        integrator: Integrator,
    ) -> None:
        self.controller = controller
        self.plant = plant
        self.dynamics: PinocchioDynamics = plant.unchecked
        self.trajectory = trajectory
        self.environment = environment
        self.sensor = sensor
        self.substeps = substeps
        self.integrator = integrator
        self.advance = INTEGRATORS[integrator]
        self.h = controller.dt / substeps

    def run(
        self, q: Array, v: Array, ticks: int, on_tick: Callable[[int, int], None] | None
    ) -> SimulationResult:
        self.friction_is_stiff = self._friction_is_stiff(q)
        dt, log = self.controller.dt, _Log(ticks + 1, self.plant.nq, self.plant.nv)
        state, sensed, tau = self.controller.init(), self.sensor.init(), np.zeros(self.plant.nv)
        for k in range(ticks + 1):
            t = k * dt
            tau_ext = self.environment.torque(self.plant, t, q, v)
            told, sensed = self.sensor.step(sensed, q, v, tau, tau_ext)
            output, state = self.controller.step(state, q, v, self.trajectory(t), told)
            tau = output.tau
            a = self.dynamics.forward_dynamics(q, v, tau + tau_ext)
            e_im = self.controller.impedance_error(output, a)
            log.write(k, t, q, v, output, e_im, tau_ext)
            if on_tick is not None:
                on_tick(k, ticks)
            if k < ticks:
                q, v = self._period(k, q, v, tau, log)
        return self._result(log, ticks + 1)

    def _period(self, k: int, q: Array, v: Array, tau: Array, log: _Log) -> tuple[Array, Array]:
        """Advance the plant by one control period under a held torque."""

        def acceleration(t: float, q: Array, v: Array) -> Array:
            if not np.isfinite(q).all():  # a stage of a diverging step: ended by the check below
                return np.full(self.plant.nv, np.nan)
            torque = tau + self.environment.torque(self.plant, t, q, v)
            if self.friction_is_stiff:
                return self.dynamics.damped_forward_dynamics(q, v, torque, self.h)
            return self.dynamics.forward_dynamics(q, v, torque)

        h = self.h
        for i in range(self.substeps):
            t = k * self.controller.dt + i * h
            with np.errstate(over="ignore", invalid="ignore"):
                q, v = self.advance(self.dynamics, acceleration, t, q, v, h)
            self._check(k, v, log)
        return q, v

    def _friction_is_stiff(self, q: Array) -> bool:
        """Whether a step has to take friction at its end; the Runge-Kutta method cannot."""
        stiffness = self.h * self.dynamics.friction_rate(q)
        if self.integrator == "rk4" and stiffness > RK4_STABILITY:
            needed = int(np.ceil(self.substeps * stiffness / RK4_STABILITY))
            raise GainError(
                "integrator",
                "rk4",
                f"'semi-implicit' for friction this stiff, or at least {needed} substeps",
            )
        return self.integrator == "semi-implicit" and stiffness > STIFF_FRICTION

    def _check(self, k: int, v: Array, log: _Log) -> None:
        speed = np.abs(v)
        if (speed < SPEED_BOUND).all():
            return
        joint = self.plant.joint_names[int(np.argmax(speed))]  # NaN counts as the largest
        raise DivergenceError(k * self.controller.dt, joint, self._result(log, k + 1))

    def _result(self, log: _Log, samples: int) -> SimulationResult:
        return SimulationResult(
            **{name: array[:samples] for name, array in log.channels.items()},
            provenance=provenance(
                self.controller,
                self.plant,
                substeps=self.substeps,
                integrator=self.integrator,
                sensor=self.sensor,
            ),
            plant=self.plant,
        )


class _Log:
    """Preallocated channels, first axis time."""

    def __init__(self, samples: int, nq: int, nv: int) -> None:
        widths = {"q": nq, "q_r": nq} | dict.fromkeys(
            ("v", "e1", "e2", "e_im", "s", "tau", "tau_ext"), nv
        )
        self.channels: dict[str, Any] = {"t": np.empty(samples)}
        self.channels |= {name: np.empty((samples, width)) for name, width in widths.items()}
        self.channels["saturated"] = np.empty((samples, nv), dtype=np.bool_)

    def write(
        self, k: int, t: float, q: Array, v: Array, output: Any, e_im: Array, tau_ext: Array
    ) -> None:
        channels = self.channels
        channels["t"][k] = t
        channels["q"][k], channels["v"][k] = q, v
        channels["e_im"][k], channels["tau_ext"][k] = e_im, tau_ext
        for name in ("q_r", "e1", "e2", "s", "tau", "saturated"):
            channels[name][k] = getattr(output, name)


def _check_substeps(substeps: Any) -> None:
    is_whole = isinstance(substeps, int | np.integer) and not isinstance(substeps, bool)
    if not is_whole or substeps < 1:
        raise GainError(
            "substeps",
            substeps,
            "a positive whole number: the period is a multiple of the physics step",
        )


def _number_of_ticks(duration: float, dt: float) -> int:
    duration = positive_number("duration", duration, "length of the run in seconds")
    ticks = max(round(duration / dt), 1)
    if abs(ticks * dt - duration) > 1e-9 * duration:
        raise GainError(
            "duration",
            duration,
            f"a multiple of the control period dt = {dt:g} s, e.g. {ticks * dt:g}",
        )
    return ticks
