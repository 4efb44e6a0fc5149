"""What every controller does first: check the measurements, form the impedance reference and the errors."""

from __future__ import annotations

from typing import NamedTuple

from .._common.arrays import Array, vector
from ..exceptions import DimensionError
from ..law.impedance import TargetFilter
from ..robot.arm_model import ArmModel
from ..trajectories import Reference
from .protocol import Measured


class Tracking(NamedTuple):
    """Checked measurements of a tick, the impedance reference and the errors.

    Attributes:
        q: Measured configuration, shape (nq,).
        v: Measured velocity, shape (nv,) [rad/s or m/s].
        tau_ext: Measured torque of the environment, shape (nv,) [N·m or N].
        desired: Desired motion.
        q_r: Impedance reference q_d (+) q_e, shape (nq,).
        v_r: Its velocity, shape (nv,) [rad/s or m/s].
        a_r: Its acceleration, shape (nv,) [rad/s² or m/s²].
        e1: Position error q_r (-) q, shape (nv,) [rad or m].
        e2: Velocity error v_r - v, shape (nv,) [rad/s or m/s].
    """

    q: Array
    v: Array
    tau_ext: Array
    desired: Reference
    q_r: Array
    v_r: Array
    a_r: Array
    e1: Array
    e2: Array


def track(
    arm: ArmModel,
    impedance_filter: TargetFilter,
    q_e: Array,
    v_e: Array,
    given: Measured,
) -> Tracking:
    """Return the impedance reference q_r = q_d (+) q_e (paper, eq. 4) and the errors of a tick.

    Args:
        arm: The controller's model of the arm.
        impedance_filter: Filter of the target impedance.
        q_e: Its position, shape (nv,).
        v_e: Its velocity, shape (nv,).
        given: Measurements and desired motion.

    Raises:
        DimensionError: Wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
    """
    q, v, desired, tau_ext = check_measurements(arm, given)
    a_e = impedance_filter.acceleration(q_e, v_e, tau_ext)  # eq. (3)
    q_r = arm.raw_dynamics.integrate(desired.q, q_e)  # eq. (4)
    v_r = desired.v + v_e
    a_r = desired.a + a_e
    e1 = arm.raw_dynamics.difference(q, q_r)
    return Tracking(q, v, tau_ext, desired, q_r, v_r, a_r, e1, e2=v_r - v)


def check_measurements(arm: ArmModel, given: Measured) -> tuple[Array, Array, Reference, Array]:
    """Return q, v, reference and tau_ext of a tick as checked float64 vectors.

    Raises:
        DimensionError: Wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
    """
    return (
        arm.check_configuration("q", given.q),
        vector("v", given.v, arm.nv),
        check_reference(arm, given.reference),
        vector("tau_ext", given.tau_ext, arm.nv),
    )


def check_reference(arm: ArmModel, reference: Reference) -> Reference:
    """Return the reference as checked float64 vectors.

    Raises:
        DimensionError: Not a triple (q, v, a), or one of wrong shape or kind.
        NonFiniteError: It holds NaN or infinity.
    """
    try:
        q, v, a = reference
    except (TypeError, ValueError):
        actual = f"{type(reference).__name__}"
        raise DimensionError("reference", "a Reference(q, v, a)", actual) from None
    return Reference(
        arm.check_configuration("reference.q", q),
        vector("reference.v", v, arm.nv),
        vector("reference.a", a, arm.nv),
    )
