"""The controllers that a user has today, with the `init` and `step` of `ImpedanceController`.

They share its target, its reference q_r = q_d (+) q_e and its figures e1, e2
and e_im, so that `simulate` compares like with like, also where a law itself does not use q_r. All
are immutable and pure. With `model="inertia"` a law knows M(q) and nothing else of the arm, as the
controller in section 4 of the paper: terms from bias(q, v) are omitted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from numpy.typing import ArrayLike

from .._common.arrays import Array, choice, positive
from .._common.brief import brief_repr
from .._common.deprecation import renamed_arguments
from .._common.frozen import set_fields
from ..exceptions import ParameterError
from ..law import baseline_formulas as formulas
from ..law.formulas import Formula
from ..law.impedance import TargetImpedance
from ..robot.arm_model import ArmModel
from ..robot.knowledge import Knowledge
from .baseline_law import MemorylessBaseline
from .cartesian_baselines import CartesianHogan as CartesianHogan  # noqa: PLC0414 (part of this module's interface)
from .cartesian_baselines import CartesianPD as CartesianPD  # noqa: PLC0414 (part of this module's interface)
from .cartesian_baselines import CartesianPID as CartesianPID  # noqa: PLC0414 (part of this module's interface)
from .cartesian_baselines import OperationalSpace as OperationalSpace  # noqa: PLC0414 (part of this module's interface)
from .pid import PIDImpedance as PIDImpedance  # noqa: PLC0414 (part of this module's interface)

Smoothing: TypeAlias = Literal["sign", "boundary-layer", "dead-zone"]
"""What a first-order sliding mode switches with."""

_SWITCHES: dict[Smoothing, Formula] = {
    "sign": formulas.switch,
    "boundary-layer": formulas.boundary_layer,
    "dead-zone": formulas.dead_zone,
}


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class ComputedTorqueImpedance(MemorylessBaseline):
    """Impedance control by inverse dynamics (Hogan 1985).

        tau = M(q)·{a_d + M_d⁻¹[D_d(v_d - v) + K_d(q_d - q) + tau_ext]} + bias(q, v) - tau_ext

    With an exact model the arm has the target impedance; model errors act on it
    unopposed. It has no sliding variable: s is zero, and u is the feedback a - a_r.

    Args:
        arm: The controller's model of the arm.
        impedance: Target impedance.
        dt: Control period [s].
        model: "full"; or "inertia", without the term bias(q, v).

    Raises:
        ParameterError: dt is not a positive number, or an unknown `model`.
        DimensionError: A gain is given for another number of joints.

    References:
        N. Hogan, Impedance control: an approach to manipulation, parts I-III, Journal of Dynamic
        Systems, Measurement, and Control 107, 1985.
    """

    formula = staticmethod(formulas.computed_torque)


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class PDGravity(MemorylessBaseline):
    """Joint stiffness: PD control with gravity compensation (Takegaki and Arimoto 1981).

        tau = g(q) + D_d(v_d - v) + K_d(q_d - q)

    What Drake's `JointStiffnessController` and the joint impedance example of libfranka amount to.
    The arm yields with the target's spring and damper but with its own inertia; M_d and tau_ext enter
    the figures e1, e2 and e_im only. s and u are zero.

    Args:
        arm: The controller's model of the arm.
        impedance: Target impedance; its damping and stiffness are the PD gains.
        dt: Control period [s].
        model: "full"; or "inertia", without g(q).

    Raises:
        ParameterError: dt is not a positive number, or an unknown `model`.
        DimensionError: A gain is given for another number of joints.
    """

    formula = staticmethod(formulas.pd_gravity)
    model_torque = "gravity"
    cancels_contact = False


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class PDPlus(MemorylessBaseline):
    """PD+ (Paden and Panja 1988): PD control with gravity compensation that tracks moving targets.

        tau = M(q) a_d + C(q, v) v_d + g(q) + friction(v) + D_d(v_d - v) + K_d(q_d - q)

    As for `PDGravity`, the arm keeps its own inertia, and s and u are zero; arguments and errors are the same. With
    `model="inertia"` it is without C, g and friction.

    References:
        B. Paden, R. Panja, Globally asymptotically stable 'PD+' controller for robot manipulators,
        International Journal of Control 47, 1988.
    """

    formula = staticmethod(formulas.pd_plus)
    model_torque = "passive"
    cancels_contact = False


@dataclass(frozen=True, eq=False, init=False)
class _Sliding(MemorylessBaseline):
    """What the baselines with a sliding variable share: λ or Λ, and a gain."""

    surface_rate: Array
    gain: Array

    @renamed_arguments(knowledge="model")
    def __init__(
        self,
        arm: ArmModel,
        impedance: TargetImpedance,
        surface_rate: ArrayLike,
        gain: ArrayLike,
        dt: float,
        *,
        model: Knowledge = "full",
    ) -> None:
        super().__init__(arm, impedance, dt, model=model)
        set_fields(
            self,
            surface_rate=positive("surface_rate", surface_rate, arm.nv),
            gain=positive("gain", gain, arm.nv),
        )


@dataclass(frozen=True, eq=False, init=False)
class FirstOrderSlidingMode(_Sliding):
    """First-order sliding mode towards q_r, with s = e2 + λ·e1 and ṡ = -u + w.

        tau = RNEA(q, v, a_r + λ·e2 + u) - tau_ext,    u = k·switch(s)

    switch(s) is sgn(s) ("sign"), s/width cut off at ±1 ("boundary-layer"), or sgn(s) outside
    abs(s) ≤ width and 0 within ("dead-zone"). Where k exceeds the disturbance w, s reaches: with the
    sign, zero, about which it chatters by about k·dt; in the boundary layer, width·w/k for a constant
    w; with the dead zone, the band abs(s) ≤ width. The error is then at most sup abs(s)/λ.

    Attributes:
        arm: The controller's model of the arm.
        impedance: Target impedance.
        surface_rate: λ > 0, scalar or (nv,) [1/s].
        gain: k > 0, scalar or (nv,) [rad/s² or m/s²].
        dt: Control period [s].
        smoothing: "sign", "boundary-layer" or "dead-zone".
        width: Of boundary layer or dead zone, scalar or (nv,) [rad/s or m/s]; None with the sign. A
            boundary layer thinner than gain·dt/2 chatters like the sign.
        model: "full"; or "inertia", with M(q)·a in place of RNEA.

    Raises:
        ParameterError: A gain that is not positive, a width where there is none to give or none where it
            is needed, or an unknown `smoothing` or `model`.
        DimensionError: A gain is given for another number of joints.
    """

    smoothing: Smoothing
    width: Array | None

    @renamed_arguments(knowledge="model")
    def __init__(
        self,
        arm: ArmModel,
        impedance: TargetImpedance,
        surface_rate: ArrayLike,
        gain: ArrayLike,
        dt: float,
        smoothing: Smoothing = "sign",
        width: ArrayLike | None = None,
        *,
        model: Knowledge = "full",
    ) -> None:
        super().__init__(arm, impedance, surface_rate, gain, dt, model=model)
        choice("smoothing", smoothing, get_args(Smoothing))
        if (width is None) != (smoothing == "sign"):
            raise ParameterError(
                "width", width, "given with a boundary layer or a dead zone, only there"
            )
        width = None if width is None else positive("width", width, arm.nv)
        set_fields(self, smoothing=smoothing, width=width)

    @property
    def formula(self) -> Formula:  # type: ignore[override]
        """The law for one joint."""
        return _SWITCHES[self.smoothing]


@dataclass(frozen=True, eq=False, init=False)
class SlotineLi(_Sliding):
    """Passivity-based sliding towards q_r (Slotine and Li 1987), without adaptation.

        tau = M(q) a_s + C(q, v) v_s + g(q) + friction(v) + K_s·s - tau_ext,
        v_s = v_r + Λ·e1,    a_s = a_r + Λ·e2,    s = v_s - v = e2 + Λ·e1

    Nothing is cancelled: with an exact model M ṡ + C s + K_s s = 0, and ½ sᵀM s falls at the rate
    sᵀK_s s. u is zero; K_s·s is a torque.

    Attributes:
        surface_rate: Λ > 0, scalar or (nv,) [1/s].
        gain: K_s > 0, scalar or (nv,) [N·m·s/rad or N·s/m].
        model: "full"; or "inertia", without C, g and friction.

    The other attributes and the errors are those of `FirstOrderSlidingMode`.

    References:
        J.-J. E. Slotine, W. Li, On the adaptive control of robot manipulators, International Journal
        of Robotics Research 6, 1987.
    """

    formula = staticmethod(formulas.slotine_li)
    model_torque = "passive"
