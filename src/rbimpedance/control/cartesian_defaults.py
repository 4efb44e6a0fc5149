"""What `CartesianController(arm)` fills in: target, surfaces and gains, from the bounds of `control.default_gains`.

What the joint-space defaults tolerate, these tolerate: links 10 % heavier or lighter, a payload of 5 % of the arm's
moving mass, 0.5 N·m of dry friction, one period of delay. The torque that the model misses becomes an acceleration of
the tool and of the null space, T·M_true⁻¹·(torque) with T = [J; Vᵀ], and one gain for the three translations, one for
the three rotations and one for the null space covers its norm: the gains do not depend on the world's axes. The input
gain T·(M_true⁻¹·M_model)·T⁻¹ has the eigenvalues of the joint space, so the margin of the scheme is the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array
from ..law.bounded_surface import BoundedSurface
from ..law.cartesian_impedance import CartesianImpedance
from ..law.damped_inverse import DampedInverse, Damping
from ..law.super_twisting import SuperTwisting
from ..law.surfaces import FastTerminalSurface, Surface
from ..robot.arm_model import ArmModel
from ..robot.tool_kinematics import ToolKinematics
from .cartesian_tick import SlidingLaw
from .default_gains import (
    ACCELERATION,
    K1_OVER_ROOT_K2,
    K2_OVER_MISMATCH,
    default_law,
    default_plants,
    default_postures,
    missed_friction,
)

MASS, STIFFNESS = (3.0, 0.15), (600.0, 20.0)
"""Default target, translation and rotation: critically damped [kg, kg·m²], [N/m, N·m/rad]."""

TOOL_SPEED = (0.5, 1.5)
"""Largest speed at which a default surface brings the tool back from far [m/s, rad/s]."""

_NULL_GAMMA = 1.0  # of the surface in the null space: it may be slower than the tool's
_NULL_SPEED_SHARE = 0.25  # of the slowest joint's velocity limit
_LEAST_K2 = 1.0  # where a block needs none: an arm without null space
_FAR = 1.0  # largest error at which a surface's speed is looked up [m or rad]


class CartesianDefaults(NamedTuple):
    """Laws that a controller takes where none are given.

    Attributes:
        arm: The controller's model of the arm, see `default_gains.model_for_period`.
        tool: Of the six directions at the frame.
        null: Of the null space.
    """

    arm: ArmModel
    tool: SlidingLaw
    null: SlidingLaw


def default_cartesian_impedance() -> CartesianImpedance:
    """Return a critically damped target that yields to a hand and holds its own."""
    return CartesianImpedance(MASS, STIFFNESS)


def default_cartesian_law(
    arm: ArmModel, kinematics: ToolKinematics, damping: Damping, dt: float
) -> CartesianDefaults:
    """Return surfaces and gains for the uncertainty that this module's text states.

    Args:
        arm: The controller's arm.
        kinematics: Of its frame.
        damping: Whose length scales the translations.
        dt: Control period [s].

    Raises:
        ParameterError: The period is too long.
    """
    law = default_law(arm, dt)
    k1, k2 = law.reaching.k1, law.reaching.k2
    gain_low, margin = float(((K1_OVER_ROOT_K2 / k1) ** 2 * k2).min()), law.reaching.margin
    base = law.surface.surface if isinstance(law.surface, BoundedSurface) else law.surface
    if not isinstance(base, FastTerminalSurface):  # the usual surfaces are
        base = FastTerminalSurface()
    missed = missed_acceleration(arm, default_plants(arm, law.payload), kinematics)

    def reaching(k2: Array) -> SuperTwisting:
        return SuperTwisting(K1_OVER_ROOT_K2 * np.sqrt(k2 / gain_low), k2, "matched", margin)

    translation, rotation, null = np.maximum(K2_OVER_MISMATCH * missed, _LEAST_K2)
    tool = SlidingLaw(
        _bounded(tool_surface(base, damping.length), np.repeat(TOOL_SPEED, 3)),
        reaching(np.repeat([translation, rotation], 3)),
    )
    slow = FastTerminalSurface(base.rate, _NULL_GAMMA, base.exponent, base.smoothing)
    speed = np.minimum(_NULL_SPEED_SHARE * arm.velocity_limit.min(), TOOL_SPEED[1])
    return CartesianDefaults(law.arm, tool, SlidingLaw(_bounded(slow, speed), reaching(null)))


def completed_laws(
    arm: ArmModel,
    kinematics: ToolKinematics,
    damping: Damping,
    dt: float,
    *,
    tool: tuple[Surface | None, SuperTwisting | None],
    null: tuple[Surface | None, SuperTwisting | None],
) -> CartesianDefaults:
    """Return the given laws, with defaults where parts are None.

    Args:
        arm: The controller's arm.
        kinematics: Of its frame.
        damping: Of its inverse.
        dt: Control period [s].
        tool: Surface and reaching law at the frame.
        null: Those of the null space.
    """
    if None not in tool and (None not in null or arm.nv <= 6):
        unused = FastTerminalSurface(), SuperTwisting(1.0, 1.0)
        filled = [given or usual for given, usual in zip(null, unused, strict=True)]
        return CartesianDefaults(arm, SlidingLaw(*tool), SlidingLaw(*filled))  # type: ignore[arg-type]
    own = default_cartesian_law(arm, kinematics, damping, dt)
    return CartesianDefaults(
        own.arm if tool[1] is None else arm,
        SlidingLaw(tool[0] or own.tool.surface, tool[1] or own.tool.reaching),
        SlidingLaw(null[0] or own.null.surface, null[1] or own.null.reaching),
    )


def tool_surface(surface: FastTerminalSurface, length: float = 0.3) -> FastTerminalSurface:
    """Return a surface of the joints as one for the tool, shape (6,): its translations count in units of a length.

    γ and ε of the translations become γ·L^(1-α) and ε·L, so that an error of L·x metres has the slope and the time
    of x radians.

    Args:
        surface: Surface with scalar gains.
        length: L [m].
    """
    scale = np.repeat([length, 1.0], 3)
    gamma = surface.gamma * scale ** (1.0 - surface.exponent)
    return FastTerminalSurface(surface.rate, gamma, surface.exponent, surface.smoothing * scale)


def missed_acceleration(
    arm: ArmModel, plants: Sequence[ArmModel], kinematics: ToolKinematics
) -> Array:
    """Return the largest acceleration that the model misses: of translation, rotation and null space, shape (3,).

    Args:
        arm: The controller's arm.
        plants: What it may be in truth.
        kinematics: Of the frame.
    """
    known, zero, friction = arm.raw_dynamics, np.zeros(arm.nv), missed_friction(arm)
    largest = np.zeros(3)
    for q in default_postures(arm):
        J = kinematics.motion(q, zero).jacobian
        T = np.vstack([J, DampedInverse(J, Damping()).basis.T])
        M, g = known.mass_matrix(q), known.bias(q, zero)
        for plant in (each.raw_dynamics for each in plants):
            M_true = plant.mass_matrix(q)
            to_task = T @ np.linalg.inv(M_true)
            size = ACCELERATION * np.abs(M_true - M).sum(axis=1) + friction
            weight = to_task @ (plant.bias(q, zero) - g)
            missed = [_norm(weight, to_task * size, rows) for rows in (_LINEAR, _ANGULAR, _NULL)]
            largest = np.maximum(largest, missed)
    return largest


_LINEAR, _ANGULAR, _NULL = slice(0, 3), slice(3, 6), slice(6, None)


def _norm(weight: Array, torques: Array, rows: slice) -> float:
    """Of what the weight does to a block, plus what a torque of either sign does on every joint."""
    return float(np.linalg.norm(weight[rows]) + np.linalg.norm(torques[rows], axis=0).sum())


def _bounded(surface: FastTerminalSurface, speed: ArrayLike) -> BoundedSurface:
    """The surface that asks for at most a speed, scalar or (6,)."""
    errors = _FAR * np.linspace(0.0, 1.0, 200)[1:, None] ** 4
    speeds = np.broadcast_to(
        surface.speed(errors), (len(errors), np.size(surface.speed(errors[0])))
    )
    limits = np.broadcast_to(speed, speeds.shape[1:])
    columns = zip(limits, speeds.T, strict=True)
    seen = np.array([np.interp(limit, column, errors[:, 0]) for limit, column in columns])
    return BoundedSurface(surface, seen if len(seen) > 1 else float(seen[0]))
