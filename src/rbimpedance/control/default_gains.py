"""What `ImpedanceController(arm)` fills in: target, surface and gains from bounds on the arm's own dynamics.

The gains tolerate, all at once,

- links that are `MASS_ERROR` heavier or lighter than in the model,
- a payload of 5 % of the arm's moving mass at the tool frame (`PAYLOAD_SHARES`), which the model does not hold,
- dry friction that the model does not hold, `FRICTION` or at most `EFFORT_SHARE` of the joint's effort limit, and
  `FRICTION_ERROR` more or less friction than the model holds,
- one period of delay from the measurement to the torque.

The bounds are taken over postures within the joint limits, by a formula and without simulation: a constructor has a
few hundredths of a second. What is not covered: a heavier payload, rotors that the description leaves out where the
joint's own inertia is small, sensor noise, fast motion. `propose_gains` finds gains for those, and says where there are
none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .._common.arrays import Array
from ..exceptions import ParameterError
from ..law.bounded_surface import BoundedSurface
from ..law.impedance import Impedance
from ..law.input_gain import needed_margin
from ..law.super_twisting import SuperTwisting
from ..law.surfaces import FastTerminalSurface, NonsingularTerminalSurface, Surface
from ..robot.arm_model import ArmModel
from ..robot.knowledge import Knowledge
from ..robot.pinocchio_dynamics import COULOMB_SMOOTHING

MASS_ERROR = 0.1
"""Share by which the links may be heavier or lighter than in the model."""

PAYLOAD_SHARES = (0.05, 0.02, 0.01, 0.005, 0.002, 0.0)
"""Payload at the tool frame that the model does not hold, as a share of the arm's moving mass: the first one that some
gains tolerate. Less than the first where the tool frame is on a finger that weighs almost nothing itself."""

FRICTION = 0.5
"""Dry friction that the model does not hold [N·m or N]; it also lets a joint without weight reach its surface."""

EFFORT_SHARE = 0.05
"""That friction is at most this share of the joint's effort limit."""

FRICTION_ERROR = 0.3
"""Share by which the friction of the model may be too large or too small."""

DELAY = 1
"""Periods from a measurement to the torque that it leads to."""

GAIN_HEADROOM = 1.2
"""The scheme tolerates an input gain this much higher than the largest one that was found."""

ACCELERATION = 1.0
"""Of the motion [rad/s² or m/s²]."""

K2_OVER_MISMATCH = 3.0
"""k2 over the acceleration that the model misses: covers it, with room for the transient."""

K1_OVER_ROOT_K2 = 2.2
"""k1² ≥ 4·k2, with room."""

SMOOTHINGS = (1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
"""Smoothing radii of the usual fast terminal surfaces [rad or m]; the first one is the default."""

_STIFF = 0.5  # friction over a period, as a share of the joint's inertia
_STIFF_MARGIN, _STIFF_GAIN = (
    6.0,
    0.3,
)  # least margin, and largest input gain that k1 counts on, where friction is stiff
_LARGEST_MARGIN = 5.0  # beyond it the scheme is too slow for its friction
_STEEPEST = 0.1  # slope of a default surface at e1 = 0 times the period
_FAR = 0.2  # error from which a default surface asks for no more speed [rad or m]
_SPEED_SHARE = 0.5  # of a joint's velocity limit
_SPEED = 1.0  # of the motion [rad/s or m/s]
_POSTURES = 16
_MASS, _STIFFNESS_OVER_MASS = 1.0, 20.0  # the paper's target


def default_impedance(arm: ArmModel) -> Impedance:
    """Return a critically damped target that is no lighter than the arm: M_d = max(1, largest M_jj), K_d = 20·M_d.

    Args:
        arm: The arm.
    """
    heaviest = np.max(
        [np.diag(arm.raw_dynamics.mass_matrix(q)) for q in default_postures(arm)], axis=0
    )
    mass = np.maximum(heaviest, _MASS)
    return Impedance(mass, stiffness=_STIFFNESS_OVER_MASS * mass)


class DefaultLaw(NamedTuple):
    """Surface and gains that a controller takes where none are given, and what payload they tolerate.

    Attributes:
        arm: The controller's model: the arm itself, or where its friction is stiff `model_for_period`.
        surface: Sliding surface.
        reaching: Gains per joint, and the margin.
        payload: Payload at the tool frame that the model need not hold [kg].
    """

    arm: ArmModel
    surface: Surface
    reaching: SuperTwisting
    payload: float


def default_law(
    arm: ArmModel, dt: float, model: Knowledge = "full", surface: Surface | None = None
) -> DefaultLaw:
    """Return surface and gains for the uncertainty that this module's text states.

    Args:
        arm: The controller's arm.
        dt: Its period [s].
        model: What it knows of the arm.
        surface: Its surface; by default the steepest usual one that the period allows, bounded to half of the joints'
            velocity limits.

    Raises:
        ParameterError: The period is too long, or on this surface the gain of the reaching law depends on the speed.
    """
    if isinstance(getattr(surface, "surface", surface), NonsingularTerminalSurface):
        words = "given with a NonsingularTerminalSurface; there are defaults for s = φ(e1) + e2"
        raise ParameterError("reaching", None, words)
    surfaces = gentle_surfaces(dt) if surface is None else (surface,)
    slopes = [float(slope_at_zero(each, arm.nv).max()) for each in surfaces]
    postures = default_postures(arm)
    known = model_for_period(arm, postures, dt)
    for share in PAYLOAD_SHARES:
        payload = share * _moving_mass(arm)
        bounds = default_bounds(arm, postures, payload, dt, model)
        gains = bounds.gain_low / GAIN_HEADROOM, bounds.gain_high * GAIN_HEADROOM
        for chosen, slope in zip(surfaces, slopes, strict=True):
            margin = needed_margin(*gains, DELAY, slope * dt)
            if margin <= _LARGEST_MARGIN:
                within = bounded_to_limits(chosen, arm) if surface is None else chosen
                reaching = _reaching(bounds, margin, is_stiff=known is not arm)
                return DefaultLaw(known, within, reaching, payload)
    words = f"shorter: no default gains are stable with a slope of {min(slopes):.3g} 1/s at e1 = 0"
    raise ParameterError("dt", dt, words)


def _reaching(bounds: Bounds, margin: float, *, is_stiff: bool) -> SuperTwisting:
    k2, gain_low = K2_OVER_MISMATCH * bounds.torque / bounds.inertia, bounds.gain_low
    if is_stiff:
        margin, gain_low = max(margin, _STIFF_MARGIN), min(gain_low, _STIFF_GAIN)
    return SuperTwisting(K1_OVER_ROOT_K2 * np.sqrt(k2 / gain_low), k2, "matched", margin)


def model_for_period(arm: ArmModel, postures: Sequence[Array], dt: float) -> ArmModel:
    """Return the model for a torque that is held for a period: the arm itself unless its friction is stiff.

    Over a period h friction adds h·slope to a joint's inertia. Where that is as large as the inertia itself, as on
    light wrists without rotors, the model gets the geometric mean of what dry friction adds at rest and in motion as
    armature, and the least friction that is expected: too much compensation drives such a joint.

    Args:
        arm: The arm.
        postures: Configurations, each of shape (nq,).
        dt: Control period [s].
    """
    slope = arm.viscous + arm.coulomb / COULOMB_SMOOTHING
    inverses = [np.linalg.inv(arm.raw_dynamics.mass_matrix(q)) for q in postures]
    inertia = np.min([1.0 / np.diag(inverse) for inverse in inverses], axis=0)
    is_stiff = dt * slope > _STIFF * inertia
    if not is_stiff.any():
        return arm
    added = np.sqrt((inertia + dt * arm.viscous) * (inertia + dt * slope)) - inertia
    share = np.where(is_stiff, 1.0 - FRICTION_ERROR, 1.0)
    gentler = arm.with_friction(share * arm.viscous, share * arm.coulomb)
    return gentler.with_armature(arm.armature + is_stiff * added)


def gentle_surfaces(dt: float) -> tuple[FastTerminalSurface, ...]:
    """Return the usual surfaces that are not too steep for a period, at least one.

    Args:
        dt: Control period [s].
    """
    surfaces = usual_surfaces()
    gentle = [each for each in surfaces if float(slope_at_zero(each, 1)[0]) * dt <= _STEEPEST]
    return tuple(gentle) or surfaces[-1:]


def bounded_to_limits(surface: Surface, arm: ArmModel) -> BoundedSurface:
    """Return a surface that asks for at most half of the joints' velocity limits, and for no more speed beyond 0.2 rad.

    Args:
        surface: The surface, with the same gains on every joint.
        arm: The arm.
    """
    errors = _FAR * np.linspace(0.0, 1.0, 200)[1:] ** 4
    seen = np.interp(_SPEED_SHARE * arm.velocity_limit, surface.speed(errors), errors)
    return BoundedSurface(surface, seen)


class Bounds(NamedTuple):
    """How far plants are from a model; arrays have shape (nv,).

    Attributes:
        torque: Largest torque that the model misses [N·m or N].
        inertia: Smallest effective inertia 1/(M_true⁻¹)ᵢᵢ [kg·m² or kg].
        gain_low: Smallest eigenvalue of M_true⁻¹·M_model.
        gain_high: Largest one.
    """

    torque: Array
    inertia: Array
    gain_low: float
    gain_high: float


def default_bounds(
    arm: ArmModel,
    postures: Sequence[Array],
    payload: float,
    dt: float,
    model: Knowledge = "full",
) -> Bounds:
    """Return the bounds over the uncertainty that this module's text states.

    Args:
        arm: The controller's arm.
        postures: Configurations, each of shape (nq,).
        payload: Largest payload at the tool frame [kg].
        dt: Control period, over which viscous friction counts as inertia [s].
        model: What the controller knows of the arm.
    """
    torque, inertia, gains = np.zeros(arm.nv), np.full(arm.nv, np.inf), [1.0]
    known, zero = arm.raw_dynamics, np.zeros(arm.nv)
    for plant in (each.raw_dynamics for each in default_plants(arm, payload)):
        for q in postures:
            M, M_true = known.mass_matrix(q), plant.mass_matrix(q)
            missed = plant.bias(q, zero) - (known.bias(q, zero) if model == "full" else zero)
            inverse = np.linalg.inv(M_true)
            torque = np.maximum(
                torque, np.abs(missed) + ACCELERATION * np.abs(M_true - M).sum(axis=1)
            )
            held = np.diag((1.0 - FRICTION_ERROR) * dt * arm.viscous)
            inertia = np.minimum(inertia, 1.0 / np.diag(np.linalg.inv(M_true + held)))
            gains += np.abs(np.linalg.eigvals(inverse @ M)).tolist()
    return Bounds(torque + missed_friction(arm, model), inertia, min(gains), max(gains))


def usual_surfaces() -> tuple[FastTerminalSurface, ...]:
    """Return the fast terminal surfaces that defaults and proposals choose from, the steepest first."""
    return tuple(FastTerminalSurface(smoothing=smoothing) for smoothing in SMOOTHINGS)


def slope_at_zero(surface: Surface, nv: int) -> Array:
    """Return the slope of s over e1 at zero, shape (nv,) [1/s]."""
    return np.array(surface.feedforward(np.zeros(nv), np.ones(nv)))


def _moving_mass(arm: ArmModel) -> float:
    return float(sum(link.mass for link in list(arm.raw_dynamics.model.inertias)[1:]))


def default_plants(arm: ArmModel, payload: float) -> tuple[ArmModel, ArmModel]:
    """Return the heaviest and the lightest plant that the defaults tolerate.

    Args:
        arm: The controller's arm.
        payload: Largest payload at the tool frame [kg].
    """
    heavy = arm.with_scaled_inertia(1.0 + MASS_ERROR)
    return (
        heavy.with_payload(payload) if payload > 0.0 else heavy,
        arm.with_scaled_inertia(1.0 - MASS_ERROR),
    )


def missed_friction(arm: ArmModel, model: Knowledge = "full") -> Array:
    """Return the friction that the model misses at most, shape (nv,) [N·m or N].

    Args:
        arm: The controller's arm.
        model: What the controller knows of the arm.
    """
    share = FRICTION_ERROR if model == "full" else 1.0
    own = share * (arm.coulomb + _SPEED * arm.viscous)
    friction: Array = np.minimum(FRICTION, EFFORT_SHARE * arm.effort_limit) + own
    return friction


def default_postures(arm: ArmModel) -> list[Array]:
    """Return postures within the joint limits, the same ones at every call.

    Args:
        arm: The arm.
    """
    rng = np.random.default_rng(0)
    drawn = [arm.random_configuration(rng) for _ in range(_POSTURES)]
    return [np.array(arm.neutral), *drawn]
