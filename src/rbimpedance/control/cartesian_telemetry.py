"""What a `CartesianController` hands out at every tick: the output, and the state for the next tick."""

from __future__ import annotations

from typing import NamedTuple

from .._common.arrays import Array, BoolArray
from .._common.brief import brief_repr
from ..law.cartesian_impedance import Displacement
from ..law.poses import CartesianReference, Pose
from ..law.super_twisting import ReachingState


@brief_repr("ticks", "displacement")
class CartesianState(NamedTuple):
    """Everything that a `CartesianController` remembers from one tick to the next; n = max(nv - 6, 0).

    Attributes:
        ticks: Number of ticks so far.
        displacement: Of x_r from x_d at this tick.
        tool: Memory of the reaching law at the tool, arrays of shape (6,).
        null: Memory of the reaching law in the null space, arrays of shape (n,).
        basis: Basis V of the null space at the tick before, shape (nv, n).
        posture: Configuration that the null space is drawn to, shape (nq,).
        tau: Torque of the tick before, shape (nv,) [N·m or N].
        pulled: Wrench that the target saw then, shape (6,); with the three below, what a late tick starts from again.
        displacement_before: The displacement at that tick.
        z_before: z of the tool then, shape (6,).
        z_null_before: z of the null space then, shape (n,).
    """

    ticks: int
    displacement: Displacement
    tool: ReachingState
    null: ReachingState
    basis: Array
    posture: Array
    tau: Array
    pulled: Array
    displacement_before: Displacement
    z_before: Array
    z_null_before: Array

    def at_late_tick(self, displacement: Displacement, z: Array, z_null: Array) -> CartesianState:
        """Return the state at a tick that comes late, with what has grown meanwhile.

        Args:
            displacement: Of x_r from x_d.
            z: Integral at the tool, shape (6,).
            z_null: Integral in the null space, shape (n,).
        """
        tool, null = self.tool._replace(z=z), self.null._replace(z=z_null)
        return self._replace(displacement=displacement, tool=tool, null=null)


@brief_repr("tau", "e1", "e2", "s", "sigma", "lost", "saturated")
class CartesianOutput(NamedTuple):
    """What a tick computed. Six numbers are three translations and three rotations, in world axes.

    Attributes:
        tau: Motor torque, within the limits, shape (nv,) [N·m or N].
        pose: Measured pose of the frame.
        reference: Impedance reference x_r = x_d (+) ξ with its velocity and acceleration.
        axes: Compliance axes R_c as columns, shape (3, 3).
        wrench: Wrench of the environment that the target was given, shape (6,) [N, N·m].
        e1: Pose error (p_r - p, log(R_r Rᵀ)), shape (6,) [m, rad].
        e2: Its rate, shape (6,) [m/s, rad/s].
        e3: The rate of that under tau, by the controller's model, shape (6,).
        s: Sliding variable, shape (6,).
        u: Reaching term that tau realises, by the controller's model, shape (6,).
        e_null: Error of the posture in the null space, Vᵀ(q_n (-) q), shape (n,) with n = max(nv - 6, 0) [rad or m].
        s_null: Its sliding variable, shape (n,).
        a: Joint acceleration that tau realises, by the controller's model, shape (nv,) [rad/s² or m/s²].
        jacobian: J of the frame in world axes, shape (6, nv).
        inverse: Its inverse J^#, damped near singularities, shape (nv, 6).
        basis: Basis V of its null space, shape (nv, n).
        sigma: Smallest singular value of the Jacobian whose linear rows are divided by the controller's length.
        lost: Share of each axis' motion that damping takes near a singularity, from 0 to 1, shape (6,); 1 for what the
            joints cannot do at all.
        premise_holds: Whether tau makes the axis' reaching law act in full, by the controller's model, shape (6,);
            False where a singularity, a joint limit or a torque limit withholds acceleration. See
            `ControllerOutput.premise_holds`.
        saturated: Whether the joint is at its torque limit, shape (nv,), bool.
        rate_limited: Whether its torque may not change faster, shape (nv,), bool.
        joint_limited: Whether its velocity or position limit bounds its acceleration, shape (nv,), bool.
    """

    tau: Array
    pose: Pose
    reference: CartesianReference
    axes: Array
    wrench: Array
    e1: Array
    e2: Array
    e3: Array
    s: Array
    u: Array
    e_null: Array
    s_null: Array
    a: Array
    jacobian: Array
    inverse: Array
    basis: Array
    sigma: float
    lost: Array
    premise_holds: BoolArray
    saturated: BoolArray
    rate_limited: BoolArray
    joint_limited: BoolArray
