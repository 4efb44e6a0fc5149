"""`ImperfectController`: sensors with noise and delay before a controller, actuators with a wrong gain behind it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, not_negative, positive, vector, whole_number
from .._common.frozen import set_fields
from .protocol import Measured
from .telemetry import ControllerOutput, Situation
from .tool_view import AnyController, in_joints
from .wrapper import ControllerWrapper


class Measurement(NamedTuple):
    """What the sensors gave at one tick.

    Attributes:
        q: Configuration with noise, shape (nq,).
        v: Velocity with noise, shape (nv,) [rad/s or m/s].
        tau_ext: Torque of the environment, shape (nv,) [N·m or N].
    """

    q: Array
    v: Array
    tau_ext: Array


class ImperfectState(NamedTuple):
    """Memory of the loop.

    Attributes:
        ticks: Number of ticks so far; with the seed it fixes the noise.
        pending: Measurements that have not reached the controller yet, the oldest first.
        inner: State of the controller.
    """

    ticks: int
    pending: tuple[Measurement, ...]
    inner: Any


@dataclass(frozen=True, eq=False, init=False)
class ImperfectController(ControllerWrapper[ImperfectState, ControllerOutput]):
    """A controller that sees noisy, late measurements and whose torque arrives with a wrong gain.

    It is a controller itself: `simulate` takes it like any other. The noise is a function of the seed and the tick,
    so `step` stays pure and runs are reproducible. The logged errors are those that the controller sees; the true
    ones are `arm.difference(q, q_r)`. Limits act on the demanded torque.

    Attributes:
        controller: What is put behind the sensors; one at the tool finds its wrench from the joint torque.
        position_noise: Standard deviation of white noise on q, scalar or (nv,) [rad or m].
        velocity_noise: The same on v [rad/s or m/s].
        delay: Ticks from a measurement to the torque that it leads to; until the first one has arrived, the
            measurement of t = 0 stands.
        torque_constant: Ratio of true to demanded torque, scalar or (nv,).
        seed: Of the noise.

    Raises:
        ParameterError: Negative noise, a delay or a seed that is not a whole number from 0 on, a torque constant that
            is not positive.
        DimensionError: One of them is given for another number of joints.
    """

    position_noise: Array
    velocity_noise: Array
    delay: int
    torque_constant: Array
    seed: int

    def __init__(
        self,
        controller: AnyController,
        *,
        position_noise: ArrayLike = 0.0,
        velocity_noise: ArrayLike = 0.0,
        delay: int = 0,
        torque_constant: ArrayLike = 1.0,
        seed: int = 0,
    ) -> None:
        nv = controller.arm.nv
        set_fields(
            self,
            controller=in_joints(controller),
            position_noise=not_negative("position_noise", position_noise, nv),
            velocity_noise=not_negative("velocity_noise", velocity_noise, nv),
            delay=whole_number("delay", delay),
            torque_constant=positive("torque_constant", torque_constant, nv),
            seed=whole_number("seed", seed),
        )

    def init(self) -> ImperfectState:
        """Return the state before the first tick."""
        return ImperfectState(0, (), self.controller.init())

    def _step(
        self, state: ImperfectState, given: Measured
    ) -> tuple[ControllerOutput, ImperfectState]:
        seen = self._measure(state.ticks, given)
        pending = (*(state.pending or self.delay * (seen,)), seen)
        late = pending[0]
        output, inner = self.controller.step(
            state.inner, late.q, late.v, given.reference, late.tau_ext
        )
        output = output._replace(tau=self.torque_constant * output.tau)
        kept = pending[1:] if self.delay else ()
        return output, ImperfectState(state.ticks + 1, kept, inner)

    def handover(self, state: ImperfectState, now: Situation) -> ImperfectState:
        """Return the state with which the arm is taken over as it is now; measurements on their way are dropped.

        Args:
            state: The last state, or that of `init`.
            now: The arm at the tick to come.
        """
        return state._replace(pending=(), inner=self.controller.handover(state.inner, now))

    @property
    def is_noisy(self) -> bool:
        """Whether there is noise on any joint."""
        return bool(self.position_noise.any() or self.velocity_noise.any())

    def noise(self, tick: int) -> Array:
        """Return the noise on q and v at a tick, shape (2, nv)."""
        white = np.random.default_rng((self.seed, tick)).standard_normal((2, self.arm.nv))
        noise: Array = np.stack([self.position_noise, self.velocity_noise]) * white
        return noise

    def _measure(self, tick: int, given: Measured) -> Measurement:
        arm = self.arm
        q, v = arm.check_configuration("q", given.q), vector("v", given.v, arm.nv)
        on_q, on_v = self.noise(tick)
        return Measurement(
            arm.raw_dynamics.integrate(q, on_q),
            v + on_v,
            vector("tau_ext", given.tau_ext, arm.nv).copy(),
        )
