"""What is between a controller's tick and the links: encoders, drives, springs, torque sensors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from .._common.arrays import (
    Array,
    choice,
    not_negative,
    per_joint,
    positive,
    positive_number,
    positive_or_infinite,
    size,
    whole_number,
    whole_numbers,
)
from .._common.brief import brief_repr
from .._common.frozen import Converted, Gain, OptionalGain, unless_none
from .arm_model import ArmModel

EncoderSide: TypeAlias = Literal["motor", "link"]
"""What the encoders are on."""


def _side(name: str, value: EncoderSide) -> EncoderSide:
    return choice(name, value, get_args(EncoderSide))


@brief_repr(omit_defaults=True)
@dataclass(frozen=True, eq=False, kw_only=True)
class Hardware:
    """One description of an arm's drives and sensors. Everything is perfect by default.

    Simulation and tuning read it: `DrivenPlant.for_(hardware, arm)`, `QuantizedEncoders.for_(hardware, controller)`,
    `simulate(..., hardware=hardware)` and `propose_gains(..., hardware=hardware)`.

    Attributes:
        encoder_bits: Bits to a turn of what the encoder is on, scalar or (nv,); None for exact positions.
        encoder_side: "motor" or "link".
        gear_ratio: Turns of the motor to one of the joint, scalar or (nv,); divides the counts of an encoder on the
            motor (1 where the bits are given to a turn of the joint).
        torque_lag: Time constant of the torque, scalar or (nv,) [s].
        delay: Ticks from a torque that is sent to its action.
        ripple: Amplitude of the torque's ripple relative to the torque, scalar or (nv,).
        ripple_periods: Of the ripple to a turn of the joint (to 2π m of a slide), whole numbers, scalar or (nv,); 200,
            for example, is twice a turn of a motor behind 100:1.
        stribeck: How much larger dry friction is at rest than in motion, relative; 0 for Coulomb friction.
        joint_stiffness: Scalar or (nv,) [N·m/rad or N/m]; +inf for rigid joints.
        rotor_inertia: On the joints' side of the gears, scalar or (nv,) [kg·m² or kg]; None for the arm's armature.
        torque_sensor: Standard deviation of the noise of a torque sensor behind every gear, scalar or (nv,) [N·m or N];
            None where there is no sensor.
        torque_bandwidth: Of the inner torque loop, which needs the sensor [rad/s].
        torque_rate: Largest change of the torque in a second, scalar or (nv,) [N·m/s or N/s]; +inf for none.

    Raises:
        ParameterError: A number that cannot be, or a sensor that is needed and missing.
    """

    encoder_bits: OptionalGain = Converted(unless_none(positive), None)
    encoder_side: Converted[EncoderSide, EncoderSide] = Converted(_side, "motor")
    gear_ratio: Gain = Converted(positive, 1.0)
    torque_lag: Gain = Converted(not_negative, 0.0)
    delay: Converted[int, int] = Converted(partial(whole_number, meaning="ticks"), 0)
    ripple: Gain = Converted(not_negative, 0.0)
    ripple_periods: Gain = Converted(whole_numbers, 200.0)
    stribeck: Converted[float, float] = Converted(size, 0.0)
    joint_stiffness: Gain = Converted(
        partial(positive_or_infinite, infinite=" where the joint is rigid"), np.inf
    )
    rotor_inertia: OptionalGain = Converted(unless_none(positive), None)
    torque_sensor: OptionalGain = Converted(unless_none(not_negative), None)
    torque_bandwidth: Converted[float, float] = Converted(
        partial(positive_number, meaning="rate in rad/s"), 600.0
    )
    torque_rate: Gain = Converted(positive_or_infinite, np.inf)

    @classmethod
    def of(cls, name: str, **more: Any) -> Hardware:
        """Return what the maker of an arm publishes, with figures of your own for the rest.

        - "panda" and "fr3": torques are taken at 1 kHz and act a tick later; they may change by 1000 N·m/s
          (`kMaxTorqueRate` in libfranka's rate_limiting.h). The maker gives no figures for encoders and lag.

        Args:
            name: Of the arm.
            **more: Other values, by the names of the attributes.

        Raises:
            ParameterError: There is no such entry.
        """
        return cls(**(_PUBLISHED[choice("name", name, _PUBLISHED)] | more))

    def but(self, **changes: Any) -> Hardware:
        """Return a copy with other values, by the names of the attributes."""
        return Hardware(**(vars(self) | changes))

    @property
    def is_perfect(self) -> bool:
        """Whether nothing is between a tick and the links; friction is the arm's own."""
        return (
            self.encoder_bits is None
            and self.delay == 0
            and not (self.torque_lag.any() or self.ripple.any() or self.is_elastic)
            and not np.isfinite(self.torque_rate).any()
        )

    @property
    def is_elastic(self) -> bool:
        """Whether a joint has a spring."""
        return bool(np.isfinite(self.joint_stiffness).any())

    def count(self, arm: ArmModel) -> Array:
        """Return a count of the encoders at the joints, 0 where positions are exact, shape (nv,) [rad or m].

        Args:
            arm: The arm.

        Raises:
            DimensionError: A number is given for another number of joints.
        """
        if self.encoder_bits is None:
            return np.zeros(arm.nv)
        bits = per_joint("encoder_bits", self.encoder_bits, arm.nv)
        gear = per_joint("gear_ratio", self.gear_ratio, arm.nv)
        turns = gear if self.encoder_side == "motor" else np.ones(arm.nv)
        count: Array = 2.0 * np.pi / 2.0**bits / turns
        return count

    def noise_bound(self, arm: ArmModel) -> Array:
        """Return the largest error of a measured position, half a count, shape (nv,) [rad or m].

        Args:
            arm: The arm.
        """
        return self.count(arm) / 2.0

    def rotors(self, arm: ArmModel) -> Array:
        """Return the rotors' inertia on the joints' side of the gears, shape (nv,) [kg·m² or kg].

        Args:
            arm: The arm, whose armature counts where the description has none.
        """
        own = arm.armature if self.rotor_inertia is None else self.rotor_inertia
        return per_joint("rotor_inertia", np.asarray(own), arm.nv)

    def lag(self, arm: ArmModel) -> Array:
        """Return the time constant of the torque on the links, shape (nv,) [s].

        An inner torque loop of bandwidth ω and damping 0.7 answers as late as a lag of 1.4/ω.

        Args:
            arm: The arm.
        """
        lag = per_joint("torque_lag", self.torque_lag, arm.nv)
        if self.torque_sensor is None or not self.is_elastic:
            return lag
        elastic = np.isfinite(per_joint("joint_stiffness", self.joint_stiffness, arm.nv))
        return np.where(elastic, 1.4 / self.torque_bandwidth, lag)

    def delay_bound(self, arm: ArmModel, dt: float) -> Array:
        """Return the time from a measurement to the torque that it leads to, T + (delay + 1/2)·dt, shape (nv,) [s].

        Args:
            arm: The arm.
            dt: Control period [s].
        """
        return self.lag(arm) + (self.delay + 0.5) * dt


_PUBLISHED: dict[str, dict[str, Any]] = {
    "panda": {"delay": 1, "torque_rate": 1000.0},
    "fr3": {"delay": 1, "torque_rate": 1000.0},
}
