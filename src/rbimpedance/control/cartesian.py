"""`CartesianController`: the law of `ImpedanceController` at a frame of the arm, with a posture in the null space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import positive_number
from .._common.brief import brief_repr
from .._common.frozen import MadeAnew, set_fields
from ..law.cartesian_impedance import CartesianFilter, CartesianImpedance, Displacement
from ..law.damped_inverse import DampedInverse, Damping, continued_basis
from ..law.joint_bounds import JointBounds
from ..law.limits import Limits, as_limits
from ..law.super_twisting import ReachingState, SuperTwisting
from ..law.surfaces import Surface
from ..robot.arm_model import ArmModel
from ..robot.tool_kinematics import ToolKinematics
from .backends import tool_form
from .cartesian_base import CartesianControllerBase, ToolMeasured
from .cartesian_defaults import completed_laws, default_cartesian_impedance
from .cartesian_telemetry import CartesianOutput as CartesianOutput  # noqa: PLC0414 (part of this module's interface)
from .cartesian_telemetry import CartesianState as CartesianState  # noqa: PLC0414 (part of this module's interface)
from .cartesian_tick import CartesianLaw, SlidingLaw, cartesian_tick
from .protocol import Backend
from .telemetry import Situation


@brief_repr()
@dataclass(frozen=True, eq=False)
class Posture:
    """What the motions do that leave the tool where it is, on an arm with more than six joints.

    Attributes:
        q: Configuration that they are drawn to, shape (nq,); None for the one of the first tick.
        surface: Sliding surface of the null space's coordinates, with scalar gains; a default one where it is None.
        reaching: Its reaching law, likewise.
    """

    q: ArrayLike | None = None
    surface: Surface | None = None
    reaching: SuperTwisting | None = None


@brief_repr("arm", "frame", "dt", "backend", "impedance", "surface", "reaching", "limits")
@dataclass(frozen=True, eq=False, init=False)
class CartesianController(MadeAnew, CartesianControllerBase[CartesianState]):
    """Super-twisting terminal sliding-mode impedance controller for a frame of the arm.

    The target impedance turns the measured wrench f into the reference pose x_r. With J the frame's Jacobian and V a
    basis of its null space, the joint acceleration and the torque are

        a = J^#·(ẍ_r + feedforward + u - J̇·v) + V·(that of the posture)
        tau = RNEA(q, v, a) - Jᵀ·f

    The sliding variable at the tool obeys ṡ = -u + w, with w what the model does not know: x_r is reached, and the
    frame moves as M_d, D_d, K_d demand, with the certificate of the joint-space law. With zeros in its place of the
    wrench the tool is rigid, and what is not measured is rejected like any other disturbance.

    Near a singularity J^# is damped. What this takes from the tool is in the output (`sigma`, `lost`, `premise_holds`)
    and does not wind the integral up. Joints keep their velocity and position limits: the others take over.

    `CartesianController(arm)` is complete; `control.cartesian_defaults` states what its gains tolerate.

    A controller is immutable. `step` is pure: the same arguments give the same, bit-equal answer. Two threads must not
    share one: the kinematics have one work space.

    Attributes:
        arm: The controller's model of the arm.
        impedance: Target impedance at the frame; a critically damped one by default.
        surface: Sliding surface of the three translations and rotations, gains scalar or (6,); see `tool_surface`.
        reaching: Its reaching law, gains scalar or (6,).
        dt: Control period [s].
        frame: Name of the frame; the arm's tool frame by default.
        posture: Configuration for the null space, shape (nq,), or a `Posture`; by default the configuration of the
            first tick. It also draws joints whose motion a singularity takes from the tool.
        limits: `Limits`, or an array-like of torque limits; None for none.
        joint_limits: Whether the arm's velocity and position limits bound the joint accelerations.
        damping: Of J^# near singularities.
        backend: "numpy" for the readable form, which specifies the others; "pinocchio" for Pinocchio's RNEA with all
            else compiled around it; "compiled" for a compiled RNEA as well. All are equal to rounding. NumPy does what
            cannot be compiled; the logger "rbimpedance" says so, once.

    Raises:
        ParameterError: dt is not a positive number, an unknown `backend`, or a limit that is not positive.
        DimensionError: A gain, a limit or a posture of another size.
        ModelError: No such frame, or the arm's compiled motion is not Pinocchio's.
        UnsupportedJointError: The arm has joints that mimic others.
    """

    surface: Surface
    reaching: SuperTwisting
    posture: Posture
    limits: Limits | None
    joint_limits: bool
    backend: Backend
    _law: CartesianLaw
    _made = ("_law", "_form")

    def __init__(
        self,
        arm: ArmModel,
        impedance: CartesianImpedance | None = None,
        surface: Surface | None = None,
        reaching: SuperTwisting | None = None,
        dt: float = 1e-3,
        *,
        frame: str | None = None,
        posture: Posture | ArrayLike | None = None,
        limits: Limits | ArrayLike | None = None,
        joint_limits: bool = True,
        damping: Damping | None = None,
        backend: Backend = "pinocchio",
    ) -> None:
        dt, damping = positive_number("dt", dt, "control period in seconds"), damping or Damping()
        posture = posture if isinstance(posture, Posture) else Posture(posture)
        kinematics = ToolKinematics(arm, frame)
        laws = completed_laws(
            *(arm, kinematics, damping, dt),
            tool=(surface, reaching),
            null=(posture.surface, posture.reaching),
        )
        set_fields(
            self,
            arm=laws.arm,
            impedance=impedance or default_cartesian_impedance(),
            surface=laws.tool.surface,
            reaching=laws.tool.reaching,
            dt=dt,
            frame=kinematics.frame,
            posture=Posture(posture.q, laws.null.surface, laws.null.reaching),
            limits=as_limits(limits, arm.nv),
            joint_limits=joint_limits,
            damping=damping,
            backend=backend,
        )
        self._make()

    def _make(self) -> None:
        arm, (q_n, surface, reaching) = self.arm, vars(self.posture).values()
        for part in (self.surface, self.reaching):
            part.check(6)
        null_size = max(arm.nv - 6, 0)
        for part in (surface, reaching):
            part.check(null_size)
        bounds = JointBounds(*arm.joint_limits(), arm.velocity_limit, self.dt)
        law = CartesianLaw(
            arm,
            ToolKinematics(arm, self.frame),
            self.impedance.filter(self.dt),
            SlidingLaw(self.surface, self.reaching),
            SlidingLaw(surface, reaching),
            posture=None if q_n is None else arm.check_configuration("posture", q_n).copy(),
            damping=self.damping,
            bounds=bounds if self.joint_limits else None,
            limits=self.limits,
            dt=self.dt,
        )
        set_fields(self, _law=law, _form=tool_form(self.backend, law))

    def init(self) -> CartesianState:
        """Return the state before the first tick: target at rest, integrals zero."""
        nv, n = self.arm.nv, max(self.arm.nv - 6, 0)
        six, null = np.zeros(6), np.zeros(n)
        rest = Displacement(six, six)
        return CartesianState(
            0,
            rest,
            tool=ReachingState(six, six, six),
            null=ReachingState(null, null, null),
            basis=np.zeros((nv, n)),
            posture=np.zeros(self.arm.nq),
            tau=np.zeros(nv),
            pulled=six,
            displacement_before=rest,
            z_before=six,
            z_null_before=null,
        )

    @property
    def _target(self) -> CartesianFilter:
        return self._law.target

    def _step(
        self, state: CartesianState, given: ToolMeasured
    ) -> tuple[CartesianOutput, CartesianState]:
        """The tick for inputs that its form has refused: another try with plain vectors, or NumPy's form."""
        answer: tuple[CartesianOutput, CartesianState] | None = None
        if self._form is not None:
            if (
                state.ticks == 0 and self.arm.nv > 6
            ):  # the null space of the forms continues a basis
                J = self._law.kinematics.motion(given.q, given.v).jacobian
                state = state._replace(basis=DampedInverse(J, self.damping).basis)
            answer = self._form.step(self._form.pack(state), *given.plain())
        return cartesian_tick(self._law, state, given) if answer is None else answer

    def handover(self, state: CartesianState, now: Situation) -> CartesianState:  # noqa: D102
        motion = self._law.kinematics.motion(now.q, now.v)
        basis = DampedInverse(motion.jacobian, self.damping).basis
        following: CartesianState = self._taken_over(state, now, motion)
        tool, null = state.tool, state.null
        six, rest = np.zeros(6), np.zeros(basis.shape[1])
        return following._replace(
            tool=tool._replace(x=six, a=six),
            null=null._replace(x=rest, a=rest),
            basis=continued_basis(basis, state.basis) if state.ticks else basis,
            z_before=tool.z,
            z_null_before=null.z,
        )

    def with_impedance(self, impedance: CartesianImpedance) -> CartesianController:
        """Return the same controller with another target; a run continues with its present state.

        See `ImpedanceController.with_impedance`: x_r and its velocity do not jump at the change as long as the
        compliance axes stay the same, only its acceleration does.

        Args:
            impedance: The target from the next tick on.
        """
        return CartesianController(
            self.arm,
            impedance,
            self.surface,
            self.reaching,
            self.dt,
            frame=self.frame,
            posture=self.posture,
            limits=self.limits,
            joint_limits=self.joint_limits,
            damping=self.damping,
            backend=self.backend,
        )

    def _elapsed(self, state: CartesianState, period: float) -> CartesianState:
        share, tool, null = period / self.dt, state.tool, state.null
        z = state.z_before + share * (tool.z - state.z_before)
        z_null = state.z_null_before + share * (null.z - state.z_null_before)
        displacement = self._target.advance(state.displacement_before, state.pulled, period)
        return state.at_late_tick(displacement, z, z_null)
