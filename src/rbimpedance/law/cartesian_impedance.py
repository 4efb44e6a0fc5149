"""The target impedance at a frame: mass, damper and spring in six directions, exact at any rotation below 2π.

The displacement ξ = (ξ_p, ξ_φ) of x_r from x_d is a translation and a rotation vector in the compliance axes R_c. It
obeys the linear target of the joint space, with the moment pulled back by the Jacobian of the exponential map:

    M_d ξ̈ + D_d ξ̇ + K_d ξ = ŵ = (R_cᵀ f, J_l(ξ_φ)ᵀ R_cᵀ m)

The angular velocity of the displacement is R_c J_l(ξ_φ) ξ̇_φ, so ŵᵀ ξ̇ is the power of (f, m): the target is passive at
any angle, and its discrete filter is the exact one of the joint space. docs/theory.md has the derivation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, real
from .._common.brief import brief_repr
from .._common.frozen import set_fields
from ..exceptions import DimensionError, ParameterError
from .impedance import Impedance
from .poses import CartesianReference, Pose, rotation_matrix
from .rotations import at
from .tool_formulas import (
    FrameMotion,
    Six,
    displacement,
    pulled_back,
    reference_in_constant_axes,
    reference_in_turning_axes,
)
from .vectors import matrix_of, vector_of

Axes: TypeAlias = Literal["world", "reference"] | ArrayLike
"""Compliance axes: the world's, those of the reference pose, or a constant rotation from them to world axes, (3, 3)."""

_WORDS = (
    "a pair (translation, rotation), six numbers, or a symmetric positive definite matrix (6, 6)"
)
_EXAMPLE = ", e.g. CartesianImpedance(mass=(3.0, 0.15), stiffness=(1000.0, 30.0))"


@brief_repr("mass", "damping", "stiffness", "axes")
@dataclass(frozen=True, eq=False, init=False)
class CartesianImpedance:
    """The mass, damper and spring that a frame of the arm should feel like, in its compliance axes.

    Each is a pair (translation, rotation), a vector (6,) or a symmetric positive definite matrix (6, 6), translations
    first. `CartesianImpedance((3.0, 0.15), [1000, 1000, 200, 30, 30, 10])` is critically damped and soft in z.

    Attributes:
        mass: M_d, shape (6,) or (6, 6) [kg, kg·m²].
        stiffness: K_d, likewise [N/m, N·m/rad].
        damping: D_d, likewise [N·s/m, N·m·s/rad]; None where a damping ratio is used.
        damping_ratio: ζ of every vibration mode of (M_d, K_d); 1 if neither it nor the damping is given, None where
            the damping is given.
        axes: "world", "reference" (the axes of the desired pose, which turn with it), or the compliance axes as the
            columns of a constant rotation matrix, in world axes.

    Raises:
        ParameterError: A value that is not finite, not symmetric or not positive definite, both `damping` and
            `damping_ratio` given, or unknown axes.
        DimensionError: A shape other than (2,), (6,) or (6, 6), or axes that are no rotation matrix.
    """

    mass: Array
    stiffness: Array
    damping: Array | None
    damping_ratio: float | None
    axes: Literal["world", "reference"] | Array
    linear: Impedance

    def __init__(
        self,
        mass: ArrayLike,
        stiffness: ArrayLike,
        damping: ArrayLike | None = None,
        damping_ratio: float | None = None,
        axes: Axes = "world",
    ) -> None:
        linear = Impedance(
            _six("mass", mass),
            None if damping is None else _six("damping", damping),
            _six("stiffness", stiffness),
            damping_ratio=damping_ratio,
        )
        set_fields(
            self,
            mass=linear.mass,
            stiffness=linear.stiffness,
            damping=linear.damping,
            damping_ratio=linear.damping_ratio,
            axes=_checked_axes(axes),
            linear=linear,
        )

    def filter(self, dt: float) -> CartesianFilter:
        """Return its discrete filter at the period dt [s]."""
        return CartesianFilter(self, dt)


@brief_repr()
class Displacement(NamedTuple):
    """Displacement of x_r from x_d in the compliance axes.

    Attributes:
        xi: Translation and rotation vector ξ, shape (6,) [m, rad].
        rate: ξ̇, shape (6,).
    """

    xi: Array
    rate: Array


class CartesianFilter:
    """Exact zero-order-hold step of a `CartesianImpedance`, and the reference x_r that follows from it."""

    def __init__(self, impedance: CartesianImpedance, dt: float) -> None:
        self._linear = impedance.linear.filter(6, dt)
        self._turns = isinstance(impedance.axes, str) and impedance.axes == "reference"
        self._axes = np.eye(3) if isinstance(impedance.axes, str) else impedance.axes

    @property
    def constant_axes(self) -> Array:
        """The compliance axes where they are constant, shape (3, 3)."""
        return self._axes

    @property
    def turns(self) -> bool:
        """Whether the compliance axes are those of the reference pose."""
        return self._turns

    def maps(self) -> Array:
        """Return the maps from (ξ, ξ̇, ŵ) to ξ̈ and to the next ξ and ξ̇, stacked, shape (18, 18)."""
        return self._linear.maps()

    def axes(self, desired: CartesianReference) -> Array:
        """Return the compliance axes R_c as columns in world axes, shape (3, 3)."""
        return desired.pose.rotation if self._turns else self._axes

    def pulled_back(self, now: Displacement, desired: CartesianReference, wrench: Array) -> Array:
        """Return ŵ = (R_cᵀ f, J_l(ξ_φ)ᵀ R_cᵀ m), shape (6,) [N, N·m].

        Args:
            now: Displacement at this tick.
            desired: Desired motion.
            wrench: Force and moment of the environment at the frame's origin, world axes, shape (6,).
        """
        phi, R_c = vector_of(now.xi[3:]), matrix_of(self.axes(desired))
        return six_array(pulled_back(R_c, phi, at(phi), six_of(wrench)))

    def reference(
        self, now: Displacement, desired: CartesianReference, pulled: Array
    ) -> CartesianReference:
        """Return x_r = x_d (+) ξ with its velocity and acceleration.

        Args:
            now: Displacement at this tick.
            desired: Desired motion x_d.
            pulled: ŵ of `pulled_back`.
        """
        acceleration = self._linear.acceleration(now.xi, now.rate, pulled)
        compose = reference_in_turning_axes if self._turns else reference_in_constant_axes
        xi, rate = six_of(now.xi), six_of(now.rate)
        R_c, k = matrix_of(self.axes(desired)), at(xi[1])
        return reference_of(compose(R_c, k, xi, rate, six_of(acceleration), motion_of(desired)))

    def displacement(
        self, desired: CartesianReference, pose: Pose, velocity: Array
    ) -> Displacement:
        """Return the displacement at which x_r is a given pose and moves as given.

        Args:
            desired: Desired motion x_d.
            pose: The pose.
            velocity: Its velocity, linear and angular, world axes, shape (6,).
        """
        R_c, now = matrix_of(self.axes(desired)), CartesianReference(pose, velocity, np.zeros(6))
        six = displacement(R_c, self._turns, motion_of(desired), motion_of(now))
        return Displacement(*map(six_array, six))

    def advance(
        self, now: Displacement, pulled: Array, period: float | None = None
    ) -> Displacement:
        """Return the displacement one period later, with ŵ held.

        Args:
            now: Displacement.
            pulled: ŵ over the period, shape (6,).
            period: Another than the filter's own, as measured [s].
        """
        return Displacement(*self._linear.advance(now.xi, now.rate, pulled, period))

    def error(self, e1: Array, e2: Array, e3: Array) -> Array:
        """Return M_d·e3 + D_d·e2 + K_d·e1, what the target's equation lacks, shape (6,) [N, N·m].

        Args:
            e1: Pose error in the compliance axes, shape (6,) [m, rad].
            e2: Velocity error, shape (6,).
            e3: Acceleration error, shape (6,).
        """
        zero = np.zeros(6)  # the residual of a linear target depends on the errors alone
        return self._linear.error(e1, e2, e3, zero, zero)


def six_of(array: Array) -> Six:
    """Return an array of shape (6,) as a pair (linear, angular) of tuples."""
    a, b, c, d, e, f = array.tolist()
    return (a, b, c), (d, e, f)


def six_array(six: Six) -> Array:
    """Return a pair (linear, angular) of tuples as an array of shape (6,)."""
    return np.array(six).ravel()


def motion_of(reference: CartesianReference) -> FrameMotion:
    """Return a desired motion as tuples of numbers."""
    (R, p), v, a = reference
    return FrameMotion(matrix_of(R), vector_of(p), six_of(v), six_of(a))


def reference_of(motion: FrameMotion) -> CartesianReference:
    """Return a motion of a frame as arrays."""
    R, p, v, a = motion
    pose = Pose(np.array(R).reshape(3, 3), np.array(p))
    return CartesianReference(pose, six_array(v), six_array(a))


def _six(name: str, value: ArrayLike) -> Array:
    """A pair, a vector or a matrix for six directions; `Impedance` checks the numbers."""
    array = real(name, value, _WORDS + _EXAMPLE)
    if array.shape == (2,):
        return np.repeat(array, 3)
    if array.shape not in ((6,), (6, 6)):
        raise DimensionError(name, _WORDS + _EXAMPLE, f"shape {array.shape}")
    return array


def _checked_axes(axes: Axes) -> Literal["world", "reference"] | Array:
    if isinstance(axes, str):
        if axes == "world":
            return "world"
        if axes == "reference":
            return "reference"
        raise ParameterError("axes", axes, '"world", "reference" or a rotation matrix (3, 3)')
    rotation = rotation_matrix("axes", axes).copy()
    rotation.setflags(write=False)
    return rotation
