"""Dry and viscous friction, learned from what the observer cannot explain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from ..._common.arrays import Array, positive_number
from ..._common.brief import brief_repr
from ..._common.frozen import set_fields

SMOOTHING = 0.02
"""Estimated speed at which dry friction has reached 76 % [rad/s or m/s]."""

REFERENCE_SMOOTHING = 0.01
"""The same of the reference, which has no noise [rad/s or m/s]."""

NOISE_VARIANCE = 18.0
"""Variance of the disturbance that friction does not explain [N²·m²], as a sum over the ticks of its correlation."""

START = (4.0, 4.0, 25.0)
"""Variance of the three parameters before anything is known."""

LARGEST_VARIANCE = 50.0
"""Bound on each of these later: a joint that rests would lose it."""

MEMORY = 3.3
"""Time after which a measurement counts e times less [s]."""

Numbers: TypeAlias = tuple[Array, ...]

# --- formulas, for all joints at once or for one ------------------------------------------------------------------


def friction_torque(dry: Array, viscous: Array, constant: Array, v: Array, width: float) -> Array:
    """Return dry·tanh(v/width) + viscous·v + constant.

    Args:
        dry: Coulomb friction.
        viscous: Viscous friction.
        constant: Constant part.
        v: Speed.
        width: Speed at which dry friction has reached 76 %.
    """
    return dry * np.tanh(v / width) + viscous * v + constant


def learned(
    parameters: Numbers,
    covariance: Numbers,
    regressors: Numbers,
    v: Array,
    disturbance: Array,
    bandwidth: Array,
    h: float,
    forgetting: float,
) -> tuple[Numbers, Numbers, Numbers]:
    """Return parameters, covariance and regressors after a step of the recursive least squares.

    With x the regressors (tanh(v/width), v, 1) behind two low-passes that start from zero, and y = P·x,

        θ ← θ - y·d/(λ·σ² + xᵀy),    P ← (P - y·yᵀ/(λ·σ² + xᵀy))/λ,

    where -d is the error of θ's prediction: what of the friction is not compensated yet.

    Args:
        parameters: θ, dry, viscous and constant part.
        covariance: P as P00, P01, P02, P11, P12, P22.
        regressors: tanh(v/width), v and 1 behind one low-pass, then behind two.
        v: Estimated speed.
        disturbance: d, estimated.
        bandwidth: Of the observer [rad/s].
        h: Period [s].
        forgetting: λ.
    """
    share = 1.0 - np.exp(-bandwidth / 1.5 * h)
    sign, speed, one, x0, x1, x2 = regressors
    sign = sign + share * (np.tanh(v / SMOOTHING) - sign)
    speed = speed + share * (v - speed)
    one = one + share * (1.0 - one)
    x0, x1, x2 = x0 + share * (sign - x0), x1 + share * (speed - x1), x2 + share * (one - x2)
    p00, p01, p02, p11, p12, p22 = covariance
    y0 = p00 * x0 + p01 * x1 + p02 * x2
    y1 = p01 * x0 + p11 * x1 + p12 * x2
    y2 = p02 * x0 + p12 * x1 + p22 * x2
    scale = forgetting * NOISE_VARIANCE + x0 * y0 + x1 * y1 + x2 * y2
    dry, viscous, constant = parameters
    dry = np.maximum(dry - y0 * disturbance / scale, 0.0)
    viscous = np.maximum(viscous - y1 * disturbance / scale, 0.0)
    constant = constant - y2 * disturbance / scale
    p00, p11 = (p00 - y0 * y0 / scale) / forgetting, (p11 - y1 * y1 / scale) / forgetting
    p22, p01 = (p22 - y2 * y2 / scale) / forgetting, (p01 - y0 * y1 / scale) / forgetting
    p02, p12 = (p02 - y0 * y2 / scale) / forgetting, (p12 - y1 * y2 / scale) / forgetting
    fits = LARGEST_VARIANCE / np.maximum(np.maximum(p00, p11), np.maximum(p22, LARGEST_VARIANCE))
    after = (p00 * fits, p01 * fits, p02 * fits, p11 * fits, p12 * fits, p22 * fits)
    return (dry, viscous, constant), after, (sign, speed, one, x0, x1, x2)


# --- the learner --------------------------------------------------------------------------------------------------


class FrictionState(NamedTuple):
    """What has been learned.

    Attributes:
        parameters: Dry [N·m or N], viscous [N·m·s/rad or N·s/m] and constant [N·m or N] part, shape (3, nv).
        covariance: Of these, its upper triangle row by row, shape (6, nv).
        regressors: tanh(v/width), v and 1 behind one low-pass, then behind two, shape (6, nv).
    """

    parameters: Array
    covariance: Array
    regressors: Array


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class FrictionLearner:
    """Recursive least squares for the friction of every joint: dry·tanh(v/0.02) + viscous·v + constant.

    What the observer takes for a disturbance is -(friction - what is compensated already), late by 3/ω. The same low-
    passes, two of ω/1.5, delay the regressors alike. What a step of the least squares moves into the friction model
    is taken out of the disturbance by the caller, so that the torque does not jump:

        change = friction after - friction before, both at the reference's speed;    disturbance ← disturbance + change.

    Feed-forward at the speed of the reference acts at a reversal before the arm is held up, which no observer can. A
    load that is not known moves into the constant part. Old measurements are forgotten with a time constant of
    `memory`. The method needs a stable innovation, and does not belong on joints with springs.

    Attributes:
        nv: Number of joints.
        dt: Period [s].
        memory: Time after which a measurement counts e times less [s].

    Raises:
        ParameterError: A period or memory that is not positive.

    References:
        K. J. Åström, B. Wittenmark, Adaptive control, 2nd ed., 1995, section 2.2 (forgetting).
    """

    nv: int
    dt: float
    memory: float

    def __init__(self, nv: int, dt: float, memory: float = MEMORY) -> None:
        set_fields(
            self,
            nv=nv,
            dt=positive_number("dt", dt, "control period in seconds"),
            memory=positive_number("memory", memory, "time in seconds"),
        )

    @property
    def forgetting(self) -> float:
        """Factor on the weight of what was measured a tick earlier."""
        return float(np.exp(-self.dt / self.memory))

    def init(self) -> FrictionState:
        """Return the state before anything is known: no friction."""
        covariance = np.zeros((6, self.nv))
        covariance[[0, 3, 5]] = np.array(START)[:, None]
        return FrictionState(np.zeros((3, self.nv)), covariance, np.zeros((6, self.nv)))

    def torque(self, state: FrictionState, v: Array) -> Array:
        """Return the learned friction at a speed that has no noise, shape (nv,) [N·m or N].

        Args:
            state: What has been learned.
            v: Speed of the reference, shape (nv,) [rad/s or m/s].
        """
        dry, viscous, constant = state.parameters
        return friction_torque(dry, viscous, constant, v, REFERENCE_SMOOTHING)

    def step(
        self, state: FrictionState, v: Array, disturbance: Array, bandwidth: Array
    ) -> FrictionState:
        """Return the state after a tick.

        Args:
            state: From `init` or the tick before.
            v: Estimated speed, shape (nv,) [rad/s or m/s].
            disturbance: Estimated torque that model and learned friction miss, shape (nv,) [N·m or N].
            bandwidth: Of the observer, shape (nv,) [rad/s].
        """
        theta, P, x = (tuple(rows) for rows in state)
        after = learned(theta, P, x, v, disturbance, bandwidth, self.dt, self.forgetting)
        return FrictionState(*map(np.stack, after))
