"""The inner torque loop of drives with a torque sensor: it hides the springs behind a fast, damped second order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..._common.arrays import Array, not_negative
from ..._common.brief import brief_repr
from ..._common.frozen import set_fields
from ...exceptions import ParameterError
from ...robot.arm_model import ArmModel
from ...robot.hardware import Hardware

DAMPING_RATIO = 0.7
"""Of the torque behind the loop."""

RATE_BANDWIDTH = 2000.0
"""Bandwidth of the measured torque's rate [rad/s]."""


class LoopState(NamedTuple):
    """What the loop remembers.

    Attributes:
        steps: Number of steps so far; with the seed it fixes the noise.
        measured: Torque that the sensors gave, shape (nv,) [N·m or N].
        rate: Of it, behind its low-pass, shape (nv,) [N·m/s or N/s].
    """

    steps: int
    measured: Array
    rate: Array


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class TorqueLoop:
    """Feedback of the torque behind a gear, τ_s, to its motor.

        tau_m = tau + K_T·(tau - τ_s) - D_T·dτ_s/dt

    With the spring K and the rotor B, τ_s follows tau like a second order of bandwidth ω_T = √(K·(1 + K_T)/B); the law
    sees a rigid joint with the rotor B/(1 + K_T), and a lag of about 1.4/ω_T. It has no integral: what friction and
    ripple leave is the outer law's.

    Attributes:
        gain: K_T, shape (nv,).
        damping: D_T, shape (nv,) [s].
        noise: Standard deviation of the sensor's white noise, shape (nv,) [N·m or N].
        seed: Of the noise.

    Args:
        gain: At least 0, shape (nv,).
        damping: At least 0, scalar or (nv,).
        noise: At least 0, scalar or (nv,).
        seed: Of the noise.

    Raises:
        ParameterError: A number below 0.
        DimensionError: Numbers for different arms.

    References:
        C. Ott, A. Albu-Schäffer, A. Kugi, G. Hirzinger, On the passivity-based impedance control of flexible joint
        robots, IEEE Transactions on Robotics 24, 2008.
    """

    gain: Array
    damping: Array
    noise: Array
    seed: int

    def __init__(
        self, gain: ArrayLike, damping: ArrayLike, noise: ArrayLike = 0.0, seed: int = 0
    ) -> None:
        nv = np.size(gain)
        set_fields(
            self,
            gain=not_negative("gain", gain, nv),
            damping=not_negative("damping", damping, nv),
            noise=not_negative("noise", noise, nv),
            seed=int(seed),
        )

    @classmethod
    def for_(cls, hardware: Hardware, arm: ArmModel) -> TorqueLoop:
        """Return the loop of the bandwidth that a description names: K_T = ω_T²·B/K - 1, D_T = 1.4·ω_T·B/K.

        Args:
            hardware: The description.
            arm: The arm, with its rotors as armature where the description has none.

        Raises:
            ParameterError: There is no torque sensor.
        """
        if hardware.torque_sensor is None:
            raise ParameterError("torque_sensor", None, "given: the loop feeds its torque back")
        omega, B = hardware.torque_bandwidth, hardware.rotors(arm)
        share = B / np.broadcast_to(hardware.joint_stiffness, (arm.nv,))  # 0 where a joint is rigid
        gain = np.maximum(omega**2 * share - 1.0, 0.0)
        return cls(gain, 2.0 * DAMPING_RATIO * omega * share, hardware.torque_sensor)

    def init(self, torque: Array) -> LoopState:
        """Return the state of a joint that has been held.

        Args:
            torque: Behind the gear, shape (nv,) [N·m or N].
        """
        return LoopState(0, np.array(torque), np.zeros(len(torque)))

    def step(
        self, state: LoopState, tau: Array, torque: Array, h: float
    ) -> tuple[Array, LoopState]:
        """Return what the motors are to give.

        Args:
            state: From `init` or the step before.
            tau: Wanted torque, shape (nv,) [N·m or N].
            torque: Behind the gear, shape (nv,) [N·m or N].
            h: Time since the step before [s].
        """
        measured = torque
        if self.noise.any():
            rng = np.random.default_rng((self.seed, state.steps))
            measured = torque + self.noise * rng.standard_normal(len(torque))
        share = -np.expm1(-RATE_BANDWIDTH * h)
        rate = state.rate + share * ((measured - state.measured) / h - state.rate)
        command = tau + self.gain * (tau - measured) - self.damping * rate
        return command, LoopState(state.steps + 1, measured, rate)
