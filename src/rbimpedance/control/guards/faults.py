"""What can be wrong at run time: faults as data, and the range of measurements that are plausible."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..._common.arrays import Array, per_joint, positive_or, real
from ..._common.brief import brief_repr
from ..._common.frozen import set_fields
from ...exceptions import InputError, ParameterError
from ...robot.arm_model import ArmModel

FASTEST = 100.0
"""Speed range of a joint whose description gives none [rad/s or m/s]."""

STRONGEST = 1e4
"""Range of tau_ext of a joint whose description gives no effort limit [N·m or N]."""

LEVERAGE = 10.0
"""Range of tau_ext in effort limits."""

FaultKind: TypeAlias = Literal[
    "malformed",
    "not finite",
    "out of range",
    "jump",
    "inconsistent",
    "frozen",
    "no effect",
    "controller",
]
"""What is wrong: an input of wrong shape or kind; NaN or infinity; a value outside the stated range, measured well; one
that cannot follow the one before; a velocity that is not how the positions move; a measurement that is constant where
it cannot; a torque that moves nothing; a controller that computes no finite torque."""


class Fault(NamedTuple):
    """Why a tick cannot continue normally.

    Attributes:
        kind: What is wrong.
        name: Which quantity: "q", "v", "tau_ext", "reference", "period" or "tau".
        joints: Names of the joints concerned; empty where it is not a matter of single joints.
        message: Description of the fault.
    """

    kind: FaultKind
    name: str
    joints: tuple[str, ...]
    message: str


class FaultError(InputError):
    """A fault under the policy "raise".

    Attributes:
        fault: What it was.
    """

    def __init__(self, fault: Fault) -> None:
        self.fault = fault
        super().__init__(fault)

    def __str__(self) -> str:
        return self.fault.message


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class OperatingRange:
    """The measurements that an arm can give while all is well.

    Attributes:
        lower: Lower ends of the positions, shape (nv,) [rad or m]; -inf where there is none.
        upper: Upper ends, shape (nv,).
        velocity: Largest speed, shape (nv,) [rad/s or m/s].
        acceleration: Largest change of the measured velocity in a second, shape (nv,) [rad/s² or m/s²].
        external: Largest plausible tau_ext, shape (nv,) [N·m or N].

    Raises:
        ParameterError: A bound that is not positive, or ends without room between them.
        DimensionError: Bounds for another number of joints.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    external: Array

    def __init__(
        self,
        arm: ArmModel,
        *,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        external: ArrayLike | None = None,
    ) -> None:
        """State a range; what is not given is the arm's own.

        Args:
            arm: The arm.
            lower: Lower ends, scalar or (nv,); the arm's by default.
            upper: Upper ends, likewise.
            velocity: Largest speed; the arm's limit by default, `FASTEST` where it has none.
            acceleration: Largest change of the velocity in a second; not bounded by default.
            external: Largest tau_ext; by default `LEVERAGE` effort limits of the arm, `STRONGEST` where it has none.
        """
        lowest, highest = arm.joint_limits()
        set_fields(
            self,
            lower=lowest if lower is None else _ends("lower", lower, arm.nv),
            upper=highest if upper is None else _ends("upper", upper, arm.nv),
            velocity=positive_or("velocity", velocity, _finite_or(arm.velocity_limit, FASTEST)),
            acceleration=positive_or("acceleration", acceleration, np.full(arm.nv, np.inf)),
            external=positive_or(
                "external", external, _finite_or(LEVERAGE * arm.effort_limit, STRONGEST)
            ),
        )
        if not (self.lower < self.upper).all():
            raise ParameterError("upper", self.upper.tolist(), "above `lower` on every joint")


def _finite_or(limit: Array, otherwise: float) -> Array:
    return np.where(np.isfinite(limit), limit, otherwise)


def _ends(name: str, value: ArrayLike, nv: int) -> Array:
    array = np.array(real(name, value, "one number per joint"))
    if array.ndim > 1 or np.isnan(array).any():
        raise ParameterError(name, value, "a scalar or one number per joint; ±inf for no bound")
    return np.array(per_joint(name, array, nv))
