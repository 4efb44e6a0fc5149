"""Proposed gains of the law at the tool, and the controller that they make."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array
from .._common.brief import brief_repr
from ..control.cartesian import CartesianController, Posture
from ..control.cartesian_defaults import tool_surface
from ..exceptions import ParameterError
from ..law.cartesian_impedance import CartesianImpedance
from ..law.damped_inverse import Damping
from ..law.limits import Limits
from ..law.super_twisting import SuperTwisting
from ..law.surfaces import FastTerminalSurface, Surface
from ..robot.arm_model import ArmModel
from .mismatch import Mismatch
from .tool_checks import ToolCase
from .uncertainty import Uncertainty

BLOCKS = ("translation", "rotation", "null space")
"""What has gains of its own."""


class GainsAtTool(Protocol):
    """What a law at the tool takes from a proposal, or from its file; `CartesianGainProposal` describes it."""

    @property
    def frame(self) -> str | None:
        """Name of the frame."""

    @property
    def dt(self) -> float:
        """Control period [s]."""

    @property
    def damping(self) -> Damping | None:
        """Of the Jacobian's inverse."""

    @property
    def surface(self) -> Surface:
        """Sliding surface of an angle."""

    @property
    def k1(self) -> Array:
        """Gains of the root, shape (3,)."""

    @property
    def k2(self) -> Array:
        """Gains of the integral, shape (3,)."""

    @property
    def margin(self) -> float | Array:
        """Of the matched scheme."""


def law_at_tool(
    model: ArmModel,
    impedance: CartesianImpedance | None,
    gains: GainsAtTool,
    *,
    posture: ArrayLike | None = None,
    **options: Any,
) -> CartesianController:
    """Return the controller with some gains.

    Args:
        model: The model that the controller should use.
        impedance: Target impedance.
        gains: The gains, with their frame, surface and period.
        posture: Configuration for the null space, shape (nq,).
        **options: Others of `CartesianController`.
    """
    k1, k2, margin = gains.k1, gains.k2, float(np.max(gains.margin))
    damping, surface = gains.damping or Damping(), gains.surface
    if not isinstance(surface, FastTerminalSurface):  # the usual surfaces are
        raise TypeError(type(surface).__name__)
    null = SuperTwisting(float(k1[2]), float(k2[2]), "matched", margin)
    return CartesianController(
        model,
        impedance,
        tool_surface(surface, damping.length),
        SuperTwisting(np.repeat(k1[:2], 3), np.repeat(k2[:2], 3), "matched", margin),
        gains.dt,
        frame=gains.frame,
        posture=Posture(posture, surface, null),
        damping=damping,
        **options,
    )


@brief_repr("feasible", "reason", "k1", "k2", "margin", "payload")
@dataclass(frozen=True, eq=False, kw_only=True)
class CartesianGainProposal:
    """Gains for a `CartesianController`, or why there are none; arrays are for translation, rotation and null space.

    Attributes:
        feasible: Whether bounds, the scheme's margins and the simulated worst plants all allow these gains.
        reason: Why not; empty where feasible.
        block: One of `BLOCKS` that makes it infeasible, or None.
        nominal: The arm as it was given.
        arm: The model that the controller should use.
        payload: Payload in that model [kg].
        uncertainty: What is not known.
        frame: Name of the frame.
        dt: Control period [s].
        damping: Of the Jacobian's inverse.
        surface: Sliding surface of an angle; `tool_surface` makes that of the tool.
        k1: Gains of the root, shape (3,).
        k2: Gains of the integral, shape (3,) [m/s³, rad/s³].
        margin: Of the matched scheme.
        missed: Largest acceleration that the model misses, shape (3,) [m/s², rad/s²].
        error: Error that the scheme leaves, predicted, shape (3,) [m, rad].
        noise_error: Error caused by sensor noise, shape (3,) [m, rad].
        mismatch: The bounds in joint space.
        worst: The simulated worst plants; empty where the bounds alone say no.
        limits: Of the actuators, which the controller keeps; None for none.
    """

    feasible: bool
    reason: str
    block: str | None
    nominal: ArmModel
    arm: ArmModel
    payload: float
    uncertainty: Uncertainty
    frame: str
    dt: float
    damping: Damping
    surface: FastTerminalSurface
    k1: Array
    k2: Array
    margin: float
    missed: Array
    error: Array
    noise_error: Array
    mismatch: Mismatch
    worst: tuple[ToolCase, ...]
    limits: Limits | None

    def controller(
        self,
        impedance: CartesianImpedance | None = None,
        *,
        posture: ArrayLike | None = None,
        limits: Limits | ArrayLike | None = None,
        **options: Any,
    ) -> CartesianController:
        """Build the controller that was proposed.

        Args:
            impedance: Target impedance; the controller's default by default.
            posture: Configuration for the null space, shape (nq,); that of the first tick by default.
            limits: Of the actuators; those of the proposal by default, +inf for none.
            **options: Others of `CartesianController`: joint_limits.

        Raises:
            ParameterError: The proposal is not feasible.
        """
        if not self.feasible:
            raise ParameterError("proposal", self.reason, "feasible")
        return law_at_tool(
            self.arm,
            impedance,
            self,
            posture=posture,
            limits=self.limits if limits is None else limits,
            **options,
        )

    def explain(self) -> str:
        """Explain the proposal, or why it is infeasible."""
        if not self.feasible:
            return f"No gains: {self.reason}."
        gains = f"{self.mismatch.gain_low:.2g} to {self.mismatch.gain_high:.2g}"
        error = self.error + self.noise_error
        return (
            f"The controller's model holds {self.payload:.3g} kg. A plant answers with {gains} times the acceleration "
            f"that the model expects; margin {self.margin:.3g} tolerates that at dt = {self.dt:g} s. The model misses "
            f"up to {self.missed[0]:.3g} m/s² and {self.missed[1]:.3g} rad/s². The error that is left is about "
            f"{error[0]:.2g} m and {error[1]:.2g} rad{self._explain_simulated()}."
        )

    def _explain_simulated(self) -> str:
        """The largest error of the simulated plants without noise."""
        m, rad = np.max([case.error for case in self.worst if not case.noisy], axis=0)
        return f", in simulation of the worst plants {m:.2g} m and {rad:.2g} rad"
