"""Which impedance for which wall: a rule for mass and damping, and where late force readings make contact unstable.

Along the normal of a wall of stiffness k_w the target impedance M_x, D_x, K_x moves as

    M_x ẍ + D_x ẋ + K_x x + k_w x(t - T) = forces of the reference,

with T the age of the force readings. docs/interaction.md derives and measures what is here.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, positive_number, size, vector
from ..exceptions import ParameterError
from ..law.impedance import Impedance
from ..robot.arm_model import ArmModel

LOOP_AGE = 3.0
"""Delay that the sampled loop adds to the readings, in control periods: the largest measured."""

SAMPLES_IN_CONTACT = 10.0
"""Smallest number of periods in the time √(M_x/k_w) with the recommended mass."""

_MOBILE = 1e-6  # smallest squared length of nᵀJ

_SAFETY = 4.0  # in mass, over the stability limit: tolerates twice the delay


class NormalImpedance(NamedTuple):
    """Impedance of a frame along one direction.

    Attributes:
        mass: M_x [kg].
        damping: D_x [N·s/m].
        stiffness: K_x [N/m].
    """

    mass: float
    damping: float
    stiffness: float


def contact_damping(
    mass: float, stiffness: float, wall_stiffness: float, damping_ratio: float = 1.0
) -> float:
    """Return D_x = 2ζ·√(M_x·(K_x + k_w)) [N·s/m]: in contact, the mass on both springs has the ratio ζ.

    With ζ = 1 it does not overshoot, so the first contact lasts.

    Args:
        mass: M_x [kg].
        stiffness: K_x [N/m].
        wall_stiffness: k_w [N/m]; of a wall that is not well known, the largest.
        damping_ratio: ζ.

    Raises:
        ParameterError: An argument that is not a positive number.
    """
    mass = positive_number("mass", mass, "mass in kg")
    stiffness = positive_number("stiffness", stiffness, "stiffness in N/m")
    wall = positive_number("wall_stiffness", wall_stiffness, "stiffness in N/m")
    ratio = positive_number("damping_ratio", damping_ratio, "damping ratio")
    return float(2.0 * ratio * np.sqrt(mass * (stiffness + wall)))


def critical_delay(target: NormalImpedance, wall_stiffness: float) -> float:
    """Return the delay of force readings above which contact is unstable [s]; infinite if there is none.

    The loop gain k_w·e^(-sT)/(M_x s² + D_x s + K_x) has unit size where

        M_x²ω⁴ + (D_x² - 2 M_x K_x)ω² + K_x² - k_w² = 0,

    which has a positive root exactly where k_w exceeds K_x, or D_x is small; there the delay may use up the phase
    margin, ω·T = atan2(D_x ω, M_x ω² - K_x). The larger root is the critical one.

    Args:
        target: M_x, D_x, K_x along the normal.
        wall_stiffness: k_w [N/m].

    Raises:
        ParameterError: An argument that is not a positive number.
    """
    for name, value in target._asdict().items():
        positive_number(name, value, name)
    wall = positive_number("wall_stiffness", wall_stiffness, "stiffness in N/m")
    M, D, K = target
    half = K / M - (D / M) ** 2 / 2.0  # of the sum of the roots ω²
    discriminant = half**2 + (wall**2 - K**2) / M**2
    if discriminant < 0.0 or half + np.sqrt(discriminant) <= 0.0:
        return float("inf")
    omega = float(np.sqrt(half + np.sqrt(discriminant)))
    return float(np.arctan2(D * omega, M * omega**2 - K) / omega)


def smallest_mass(
    wall_stiffness: float, delay: float, stiffness: float, damping_ratio: float = 1.0
) -> float:
    """Return the M_x [kg] at the stability limit of contact, with D_x by `contact_damping`.

    For K_x much smaller than k_w it is k_w·(T/T₀)² with T₀ = 2.74 at ζ = 1, 1.75 at ζ = 0.7 and 1.15 at ζ = 0.5.
    Heavier is stable.

    Args:
        wall_stiffness: k_w [N/m].
        delay: T, the whole age of the force readings: sensor, bus and sampled loop (`LOOP_AGE` periods) [s].
        stiffness: K_x [N/m], less than k_w.
        damping_ratio: ζ.

    Raises:
        ParameterError: An argument that is not a positive number, or K_x ≥ k_w (then no delay is critical for ζ ≥ 0.5).
    """
    delay = positive_number("delay", delay, "time in seconds")
    if stiffness >= wall_stiffness:
        raise ParameterError(
            "stiffness", stiffness, f"less than the wall's, {wall_stiffness:g} N/m"
        )
    unit = NormalImpedance(
        1.0, contact_damping(1.0, stiffness, wall_stiffness, damping_ratio), stiffness
    )
    # With this damping all times scale with √M_x.
    return float((delay / critical_delay(unit, wall_stiffness)) ** 2)


def recommended_mass(
    wall_stiffness: float,
    stiffness: float,
    dt: float,
    delay: float = 0.0,
    damping_ratio: float = 1.0,
) -> float:
    """Return the M_x [kg] with which to meet a wall.

    It is the lightest, for the peak force grows with √M_x, with which √(M_x/k_w), the time scale of contact, lasts
    `SAMPLES_IN_CONTACT` periods, and which is at least four times `smallest_mass`, so that contact tolerates readings
    that are twice as old.

    Args:
        wall_stiffness: k_w [N/m]; of a wall that is not well known, the largest.
        stiffness: K_x [N/m], less than k_w.
        dt: Control period [s].
        delay: Age of the force readings as they come to the controller [s].
        damping_ratio: ζ in contact.

    Raises:
        ParameterError: An argument that is not a positive number, a negative delay, or K_x ≥ k_w.
    """
    dt = positive_number("dt", dt, "control period in seconds")
    age = size("delay", delay) + LOOP_AGE * dt
    sampled = wall_stiffness * (SAMPLES_IN_CONTACT * dt) ** 2
    return max(sampled, _SAFETY * smallest_mass(wall_stiffness, age, stiffness, damping_ratio))


def impedance_for_wall(
    arm: ArmModel,
    q: ArrayLike,
    normal: ArrayLike,
    *,
    mass: float,
    stiffness: float,
    wall_stiffness: float,
    damping_ratio: float = 1.0,
    frame: str | None = None,
) -> Impedance:
    """Return the impedance, equal on all joints, with which a frame meets a wall.

    Equal joint impedances act along the normal as one mass, damper and spring, M_x = M_d/(nᵀJJᵀn) and so on: a push
    along n causes a deflection along J Jᵀ n for any arm. Here they are chosen such that M_x and K_x are as given and
    D_x is that of `contact_damping`.

    Args:
        arm: The arm.
        q: Configuration in which it touches, shape (nq,).
        normal: Normal of the wall, shape (3,).
        mass: M_x [kg]; see `recommended_mass`.
        stiffness: K_x [N/m]; the steady force is K_x·k_w/(K_x + k_w) per metre that the reference is in the wall.
        wall_stiffness: k_w [N/m]; of a wall that is not well known, the largest.
        damping_ratio: ζ in contact; 1 does not bounce.
        frame: Frame that touches; the arm's tool frame by default.

    Raises:
        ParameterError: An argument that is not a positive number, or a normal along which the frame cannot move at q.
        DimensionError: Wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
        ModelError: No such frame.
    """
    damping = contact_damping(mass, stiffness, wall_stiffness, damping_ratio)
    row = _normal_row(arm, q, normal, frame)
    share = float(row @ row)
    return Impedance(share * mass, share * damping, share * stiffness)


def normal_impedance(
    arm: ArmModel, q: ArrayLike, impedance: Impedance, normal: ArrayLike, frame: str | None = None
) -> NormalImpedance:
    """Return what a frame feels like along a direction: (nᵀJ A⁻¹ Jᵀn)⁻¹ for A = M_d, D_d and K_d.

    Exact for each of the three alone, and for all together where they are multiples of one another or were made by
    `joint_matrix` from such; otherwise M_x is right for fast motion, K_x for slow.

    Args:
        arm: The arm.
        q: Configuration, shape (nq,).
        impedance: Target impedance.
        normal: The direction, shape (3,).
        frame: Name of the frame; the arm's tool frame by default.

    Raises:
        ParameterError: A direction in which the frame cannot move at q.
        DimensionError: Wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
        ModelError: No such frame.
    """
    row = _normal_row(arm, q, normal, frame)
    parts = [1.0 / float(row @ np.linalg.solve(A, row)) for A in impedance.matrices(arm.nv)]
    return NormalImpedance(*parts)


def _normal_row(arm: ArmModel, q: ArrayLike, normal: ArrayLike, frame: str | None) -> Array:
    """The row nᵀJ with n of length 1, shape (nv,)."""
    n = vector("normal", normal, 3, "x, y, z")
    length = float(np.linalg.norm(n))
    row: Array = n @ arm.jacobian(q, frame)[:3] / (length or 1.0)
    if not row @ row > _MOBILE:
        raise ParameterError("normal", normal, "a direction in which the frame can move at q")
    return row
