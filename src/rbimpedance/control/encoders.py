"""Encoders in the loop: positions in whole counts, velocities from their differences."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, positive, vector
from .._common.brief import brief_repr
from .._common.frozen import set_fields
from ..exceptions import ParameterError
from ..interaction.sensors import LowPass
from ..robot.hardware import Hardware
from .protocol import Measured
from .telemetry import ControllerOutput
from .tool_view import AnyController, in_joints
from .wrapper import ControllerWrapper

VelocitySource: TypeAlias = Literal["differentiated", "measured"]
"""Where the velocity comes from."""

BITS_17 = 2.0 * np.pi / 2**17
"""Resolution of an encoder of 17 bits on the joint [rad]."""


class EncoderState(NamedTuple):
    """Memory of encoders and controller.

    Attributes:
        q: Configuration in whole counts at the tick before, shape (nq,), or None before the first tick.
        v: Velocity measured then, shape (nv,) [rad/s or m/s], or None.
        period: Time of the coming tick after the one before [s].
        inner: State of the controller.
    """

    q: Array | None
    v: Array | None
    period: float
    inner: Any


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class QuantizedEncoders(ControllerWrapper[EncoderState, ControllerOutput]):
    """A controller that sees positions in whole counts, and velocities as their differences.

    It is a controller itself: `simulate` takes it like any other, and `ImperfectController` puts noise and delay before
    or behind it. Counts are taken from `arm.neutral` on the manifold; on a continuous joint they go round without a
    seam where a turn is a whole number of them. The torque of the environment passes unchanged. The logged errors are
    those that the controller sees.

    A difference over a period is half a period late, and one count more or less is resolution/dt in it; a low-pass
    trades the second for more of the first: see `phase_loss`, `position_noise` and `velocity_noise`.

    Attributes:
        controller: What is put behind the encoders; one at the tool finds its wrench from the joint torque.
        resolution: A count, shape (nv,) [rad or m].
        velocity: "differentiated": (q_k (-) q_(k-1))/h of the counted positions with h the measured period, or dt
            where none is given, zero at the first tick; or
            "measured": the true one, as of a tachometer.
        bandwidth: Corner frequency of a first-order low-pass on the velocity [Hz], or None.

    Args:
        controller: What is put behind the encoders.
        resolution: Scalar or (nv,); 17 bits to a turn of the joint by default.
        velocity: "differentiated" or "measured".
        bandwidth: Positive, or None for no low-pass.

    Raises:
        ParameterError: A resolution or bandwidth that is not positive, or an unknown source of the velocity.
        DimensionError: A resolution for another number of joints.
    """

    resolution: Array
    velocity: VelocitySource
    bandwidth: float | None
    _low_pass: LowPass | None

    def __init__(
        self,
        controller: AnyController,
        *,
        resolution: ArrayLike = BITS_17,
        velocity: VelocitySource = "differentiated",
        bandwidth: float | None = None,
    ) -> None:
        if velocity not in ("differentiated", "measured"):
            raise ParameterError("velocity", velocity, '"differentiated" or "measured"')
        low_pass = None if bandwidth is None else LowPass(bandwidth, controller.dt)
        set_fields(
            self,
            controller=in_joints(controller),
            resolution=positive("resolution", resolution, controller.arm.nv),
            velocity=velocity,
            bandwidth=bandwidth,
            _low_pass=low_pass,
        )

    @classmethod
    def for_(cls, hardware: Hardware, controller: AnyController) -> QuantizedEncoders:
        """Return a controller behind the encoders of a description; velocities are differences, without a low-pass.

        Args:
            hardware: The description.
            controller: What is put behind its encoders.

        Raises:
            ParameterError: The description has no encoders.
        """
        if hardware.encoder_bits is None:
            raise ParameterError("encoder_bits", None, "given: without encoders nothing is counted")
        return cls(controller, resolution=hardware.count(controller.arm))

    @property
    def position_noise(self) -> Array:
        """Standard deviation of what rounding does to q, resolution/√12, shape (nv,) [rad or m]; for `Uncertainty`."""
        return np.asarray(self.resolution / np.sqrt(12.0))

    @property
    def velocity_noise(self) -> Array:
        """Standard deviation of what rounding does to v behind the low-pass, shape (nv,) [rad/s or m/s].

        Roundings of different ticks are taken as independent, as they are while the joint turns by some counts a tick.
        """
        if self.velocity == "measured":
            return np.zeros(self.arm.nv)
        lag = 0.0 if self._low_pass is None else self._low_pass.delay
        pole = lag / (lag + self.dt)
        share = (1.0 - pole) * np.sqrt(2.0 / (1.0 + pole))
        return np.asarray(share * self.position_noise / self.dt)

    def phase_loss(self, frequency: ArrayLike) -> Array:
        """Return how far the velocity lags behind the true one at frequencies in Hz [rad], of their shape.

        Args:
            frequency: Frequencies, below half of the sampling rate [Hz].
        """
        f = np.asarray(frequency, dtype=np.float64)
        difference = np.pi * f * self.dt if self.velocity == "differentiated" else np.zeros_like(f)
        return difference if self._low_pass is None else difference + self._low_pass.phase_loss(f)

    def init(self) -> EncoderState:
        """Return the state before the first tick."""
        return EncoderState(None, None, self.dt, self.controller.init())

    def _step(self, state: EncoderState, given: Measured) -> tuple[ControllerOutput, EncoderState]:
        q = self._counted(self.arm.check_configuration("q", given.q))
        v = self._velocity(state, q, vector("v", given.v, self.arm.nv))
        output, inner = self.controller.step(state.inner, *given._replace(q=q, v=v))
        return output, EncoderState(q, v, self.dt, inner)

    def _elapsed(self, state: EncoderState, period: float) -> EncoderState:
        return super()._elapsed(state, period)._replace(period=float(period))

    def _counted(self, q: Array) -> Array:
        """The configuration that is a whole number of counts away from neutral."""
        arm = self.arm
        counts = np.rint(arm.raw_dynamics.difference(arm.neutral, q) / self.resolution)
        return arm.raw_dynamics.integrate(arm.neutral, counts * self.resolution)

    def _velocity(self, state: EncoderState, counted: Array, v: Array) -> Array:
        if self.velocity == "measured":
            raw = v.copy()
        elif state.q is None:
            raw = np.zeros_like(v)
        else:
            raw = self.arm.raw_dynamics.difference(state.q, counted) / state.period
        if self.bandwidth is None:
            return raw
        return LowPass(self.bandwidth, state.period).smooth(state.v, raw)
