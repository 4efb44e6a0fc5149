"""Bandwidths of a `HardwareController` from what the hardware allows, what friction needs, and what noise costs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from .._common.arrays import Array, per_joint
from ..control.hardware_controller import OBSERVER_RATIO
from ..robot.arm_model import ArmModel
from ..robot.hardware import Hardware
from ..trajectories import Trajectory
from .worst_case import needed_variation

Bound: TypeAlias = Literal["delay", "friction", "noise", "spring"]
"""What keeps a bandwidth from being higher: the hardware's delay, no need of more, the noise of the encoders, or the
resonance of a spring."""

DELAY_SHARE = 0.3
"""Largest ω·T_d of the loop, with T_d the time from a measurement to its torque. Linear theory allows 0.42."""

JUMP_SHARE = 0.35
"""Error after a jump J of the torque, times m·ω²/J."""

NOISE_SHARE = 0.3
"""Share of the torque variation that the motion needs, which counting may add while the gate is closed."""

LARGEST_RATIO = 6.0
"""Largest ratio of the alert to the quiet bandwidth."""

NOISE_GAIN = 0.23
"""Torque variation of counting, over κ-independent factors: 0.23·(1 + 6/r + 3/r²)·M·c·ω_o³."""

SPRING_SHARE = 0.5
"""Largest gain of the loop at the resonance of a joint's spring without a torque sensor."""

SPRING_DAMPING = 0.05
"""Share of critical damping that a spring is taken to have."""

FINEST_COUNT = 2.0 * np.pi / 2**26  # rad

_STEP = 5e-3  # s between the instants at which the torque of a motion is taken


@dataclass(frozen=True, eq=False, kw_only=True)
class HardwareDemand:
    """What the bandwidths follow from; arrays have shape (nv,).

    Attributes:
        delay: T_d, from a measurement to the torque that it leads to [s].
        inertia: Smallest effective inertia m = 1/(M⁻¹)ᵢᵢ [kg·m² or kg].
        mass: Largest M_ii of the model [kg·m² or kg].
        jump: J, of dry friction at a reversal [N·m or N].
        count: c, of the encoders [rad or m].
        spring: Bandwidth that the resonance of a spring without a torque sensor allows; +inf without one [rad/s].
        need: Torque variation that the motion itself needs, over all joints [N·m/s or N/s].
        accuracy: Error after a jump that is aimed at [rad or m].
    """

    delay: Array
    inertia: Array
    mass: Array
    jump: Array
    count: Array
    spring: Array
    need: float
    accuracy: float


@dataclass(frozen=True, eq=False, kw_only=True)
class HardwareBandwidths:
    """Bandwidths of the loop and what bounds them; arrays have shape (nv,).

    Attributes:
        quiet: While counting explains what the encoders show [rad/s].
        alert: While it does not [rad/s].
        bound: What bounds each joint.
        noise: Torque variation that counting adds while the gate is closed, over all joints [N·m/s or N/s].
        jump_error: Error that a reversal of dry friction leaves without learned friction [rad or m].
    """

    quiet: Array
    alert: Array
    bound: tuple[Bound, ...]
    noise: float
    jump_error: Array


def bandwidths(demand: HardwareDemand) -> HardwareBandwidths:
    """Return the bandwidths that a demand calls for.

        alert = min(0.3/T_d, √(0.35·J/(m·accuracy))),
        quiet = clip(ω_n/r, alert/6, alert),    0.23·(1 + 6/r + 3/r²)·M_ii·c·ω_n³ = 0.3·need/n,

    with r the ratio of the observer's bandwidth to the loop's. The alert one is as high as the delay allows or as the
    jump of dry friction at a reversal needs; the quiet one is as high as its noise in the torque allows. A spring
    bounds both.

    Args:
        demand: What they follow from.
    """
    r, n = OBSERVER_RATIO, len(demand.delay)
    by_delay = DELAY_SHARE / demand.delay
    by_friction = np.sqrt(JUMP_SHARE * demand.jump / (demand.inertia * demand.accuracy))
    alert = np.minimum(np.minimum(by_delay, by_friction), demand.spring)
    gain = NOISE_GAIN * (1.0 + 6.0 / r + 3.0 / r**2) * demand.mass
    gain = gain * np.maximum(demand.count, FINEST_COUNT)
    by_noise = (NOISE_SHARE * demand.need / n / gain) ** (1.0 / 3.0) / r
    quiet = np.clip(by_noise, alert / LARGEST_RATIO, alert)
    bounds = np.select(
        [quiet < 0.99 * alert, alert == demand.spring, by_delay <= by_friction],
        ["noise", "spring", "delay"],
        "friction",
    )
    return HardwareBandwidths(
        quiet=quiet,
        alert=alert,
        bound=tuple(bounds.tolist()),
        noise=float((gain * (r * quiet) ** 3).sum()),
        jump_error=np.asarray(JUMP_SHARE * demand.jump / (demand.inertia * alert**2)),
    )


def spring_bound(hardware: Hardware, arm: ArmModel, inertia: Array, mass: Array) -> Array:
    """Return the bandwidth that a spring without a torque sensor allows, shape (nv,); +inf without one [rad/s].

    Well above its own bandwidth ω, law and observer answer a position with 90·M_ii·ω³/s. At the resonance
    ω_s = √(K·(1/B + 1/m)) the position behind a torque is 1/(2ζ·ω_s²·I), where I is the inertia of what the encoder is
    on, rotor or link. The product of both stays below `SPRING_SHARE`, so that the phase there does not matter.

    Args:
        hardware: What is between tick and links.
        arm: The model, rotors included.
        inertia: Effective inertia of the joints, rotors included [kg·m² or kg].
        mass: M_ii of the model [kg·m² or kg].
    """
    K = per_joint("joint_stiffness", hardware.joint_stiffness, arm.nv)
    elastic, B = np.isfinite(K), hardware.rotors(arm)
    if hardware.torque_sensor is not None or not elastic.any():
        return np.full(arm.nv, np.inf)
    link = np.maximum(inertia - B, 1e-3 * mass)
    resonance = np.sqrt(np.where(elastic, K, 1.0) * (1.0 / B + 1.0 / link))
    seen = B if hardware.encoder_side == "motor" else link
    cube = SPRING_SHARE * 2.0 * SPRING_DAMPING * resonance**3 * seen / (90.0 * mass)
    return np.where(elastic, np.cbrt(cube), np.inf)


def variation_of_motion(
    plant: ArmModel, hardware: Hardware, trajectory: Trajectory, duration: float
) -> float:
    """Return the torque variation per second that a motion needs on that hardware, over all joints [N·m/s or N/s].

    Ripple of amplitude ρ at n periods to a turn adds 4·ρ·abs(tau)·n·abs(v)/(2π) to a joint, because a torque that holds
    the arm against it has to undo it.

    Args:
        plant: The arm that moves, with its friction.
        hardware: Its drives.
        trajectory: The motion.
        duration: Length that counts [s].
    """
    times = np.arange(0.0, duration, _STEP)
    need = float(needed_variation(plant, trajectory, times).sum())
    if not hardware.ripple.any():
        return need
    rippling = 0.0
    for t in times[::10].tolist():
        q, v, a = trajectory(t)
        tau = plant.raw_dynamics.inverse_dynamics(q, v, a)
        crossings = hardware.ripple_periods * np.abs(v) / (2.0 * np.pi)
        rippling += float((4.0 * hardware.ripple * np.abs(tau) * crossings).sum())
    return need + rippling / len(times[::10])
