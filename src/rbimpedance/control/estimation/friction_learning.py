"""Friction of every joint and the load of the whole arm, learned from what the observer cannot explain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..._common.arrays import Array, positive_number, size
from ..._common.brief import brief_repr
from ..._common.frozen import set_fields

SMOOTHING = 0.02
"""Estimated speed at which dry friction has reached 76 % [rad/s or m/s]."""

REFERENCE_SMOOTHING = 0.007
"""The same of the reference, which has no noise [rad/s or m/s]."""

RELEASE = 2.0
"""Share of the disturbance that a reversal of the reference takes out, for each unit of its tanh(v/0.007)."""

RISE_SPEED = 0.05
"""Speed at which the rise of dry friction towards standstill has fallen to 37 % [rad/s or m/s]."""

NOISE_VARIANCE = 18.0
"""Variance of the disturbance that nothing explains [N²·m²], as a sum over the ticks of its correlation."""

MEMORY = 10.0
"""Time in motion after which a measurement counts e times less [s]."""

OWN, TERMS = 5, 7
"""Parameters of a joint alone (dry, viscous, constant, sine and cosine of the ripple), and all of them (scale of the
model's torque, load)."""

LATE = 3
"""Low-passes of the observer's bandwidth between a torque and what the observer makes of it."""

PACKED = TERMS * (TERMS + 3) // 2
"""Rows of the normal equations: the upper triangle and the right-hand side, row by row."""

# --- formulas, for all joints at once or for one ------------------------------------------------------------------


def dry_share(v: Array, width: float, rise: float) -> Array:
    """Return dry friction over its value in motion: tanh(v/width)·(1 + rise·e^(-(v/0.05)²)).

    Args:
        v: Speed.
        width: Speed at which dry friction has reached 76 %.
        rise: How much larger it is at rest, relative.
    """
    share: Array = np.tanh(v / width) * (1.0 + rise * np.exp(-((v / RISE_SPEED) ** 2)))
    return share


def released(disturbance: Array, dry: Array, v: Array, before: Array, rise: float) -> Array:
    """Return what a reversal of the reference takes out of the disturbance.

    A joint that sticks winds the disturbance up, by at most its dry friction; when the feed-forward of that friction
    turns, the one would be in the way of the other.

    Args:
        disturbance: Torque that the observer holds against.
        dry: Dry friction in motion.
        v: Speed of the reference.
        before: The same at the tick before.
        rise: How much larger dry friction is at rest, relative.
    """
    turn = np.abs(np.tanh(v / REFERENCE_SMOOTHING) - np.tanh(before / REFERENCE_SMOOTHING))
    most = dry * (1.0 + rise)
    held: Array = np.minimum(np.maximum(disturbance, -most), most)
    release: Array = np.minimum(RELEASE * turn, 1.0) * held
    return release


def waves(angle: Array, periods: Array, torque: Array) -> tuple[Array, Array]:
    """Return what ripple of the motor's torque is made of: sine and cosine at its periods.

    Args:
        angle: Of the joint.
        periods: Of the ripple to a turn.
        torque: Of the motor.
    """
    return torque * np.sin(periods * angle), torque * np.cos(periods * angle)


def mismatch_torque(
    theta: Any, dry: Array, v: Array, sine: Array, cosine: Array, scaled: Array, load: Array
) -> Array:
    """Return what the parameters make of the torque that the model misses.

    Args:
        theta: Dry, viscous and constant part, sine and cosine of the ripple, scale and load.
        dry: From `dry_share`.
        v: Speed.
        sine: From `waves`.
        cosine: The same.
        scaled: Torque of the model, of which theta[5] is missing.
        load: Torque of a unit load.
    """
    own = theta[0] * dry + theta[1] * v + theta[2] + theta[3] * sine + theta[4] * cosine
    torque: Array = own + theta[5] * scaled + theta[6] * load
    return torque


def delay_terms(late: Any, terms: Any, share: Array) -> None:
    """Move every term and the torque that is fed forward behind three low-passes, in place.

    Args:
        late: The eight behind one low-pass, then behind two, then behind three.
        terms: The eight.
        share: By which a low-pass comes closer to its input.
    """
    for i in range(TERMS + 1):
        late[i] += share * (terms[i] - late[i])
        for k in range(TERMS + 1 + i, LATE * (TERMS + 1), TERMS + 1):
            late[k] += share * (late[k - TERMS - 1] - late[k])


def at(i: int, k: int) -> int:
    """Return the row of the packed normal equations that holds entry k of row i, k ≥ i.

    Args:
        i: Row.
        k: Column; `TERMS` is the right-hand side.
    """
    return i * (2 * TERMS + 1 - i) // 2 + k


def gather(normal: Any, x: Any, y: Array, weight: Array, forgotten: float) -> None:
    """Add a measurement y = xᵀθ to the normal equations, in place, and forget a share of the older ones.

    Args:
        normal: Packed normal equations.
        x: Delayed terms.
        y: Torque that the model misses.
        weight: Of the measurement, from 0 to 1.
        forgotten: Share of the older ones that a measurement of full weight replaces.
    """
    keeps, gain = 1.0 - forgotten * weight, weight / NOISE_VARIANCE
    for i in range(TERMS):
        for k in range(i, TERMS):
            normal[at(i, k)] = keeps * normal[at(i, k)] + gain * x[i] * x[k]
        normal[at(i, TERMS)] = keeps * normal[at(i, TERMS)] + gain * x[i] * y


def eliminate(normal: Any) -> None:
    """Eliminate a joint's own parameters from its normal equations, in place; the rest is for the shared ones.

    Args:
        normal: Packed normal equations, positive definite.
    """
    for i in range(OWN):
        for k in range(i + 1, TERMS):
            ratio = normal[at(i, k)] / normal[at(i, i)]
            for m in range(k, TERMS + 1):
                normal[at(k, m)] -= ratio * normal[at(i, m)]


def substitute(normal: Any, theta: Any) -> None:
    """Write a joint's own parameters into theta, whose shared ones are known.

    Args:
        normal: Normal equations after `eliminate`.
        theta: All parameters.
    """
    for i in range(OWN - 1, -1, -1):
        rest = normal[at(i, TERMS)]
        for k in range(i + 1, TERMS):
            rest = rest - normal[at(i, k)] * theta[k]
        theta[i] = rest / normal[at(i, i)]


def shared(a: float, b: float, c: float, x: float, y: float) -> tuple[float, float]:
    """Return the solution of [[a, b], [b, c]]·θ = [x, y].

    Args:
        a: First entry of the matrix.
        b: Second.
        c: Last.
        x: Right-hand side.
        y: The same.
    """
    determinant = a * c - b * b
    return (c * x - b * y) / determinant, (a * y - b * x) / determinant


# --- the learner --------------------------------------------------------------------------------------------------


class Expectation(NamedTuple):
    """What is known of the parameters before the arm moves, each of shape (7, nv); the last two rows are one number.

    Attributes:
        mean: Dry, viscous and constant part, sine and cosine of the ripple, scale, load.
        deviation: Their standard deviations, positive.
    """

    mean: Array
    deviation: Array


class FrictionState(NamedTuple):
    """What has been learned.

    Attributes:
        parameters: Dry [N·m or N], viscous [N·m·s/rad or N·s/m] and constant [N·m or N] part, sine and cosine of the
            ripple over the motor's torque, share of the model's torque that is missing, and load [kg], shape (7, nv);
            the last two are the same for all joints.
        normal: Packed normal equations of each joint, without what was expected, shape (35, nv).
        regressors: The seven terms and the torque that is fed forward behind one low-pass, behind two and behind three,
            shape (24, nv).
    """

    parameters: Array
    normal: Array
    regressors: Array

    def shifted(self, moved: Array) -> FrictionState:
        """Return the state after what is fed forward has changed, and the disturbance by as much.

        Args:
            moved: The change, shape (nv,) [N·m or N].
        """
        late = self.regressors.copy()
        late[TERMS :: TERMS + 1] += moved
        return self._replace(regressors=late)


@brief_repr("nv", "dt", "memory", "stribeck")
@dataclass(frozen=True, eq=False, init=False)
class FrictionLearner:
    """Least squares for the friction of every joint and what the arm carries.

    The torque that the model misses is taken to be, on every joint,

        dry·tanh(v/0.02)·(1 + stribeck·e^(-(v/0.05)²)) + viscous·v + constant + tau·(sine·sin(n·q) + cosine·cos(n·q))
        + scale·tau_model + load·tau_1,

    where tau is the motor's torque, n its ripple's periods to a turn, tau_model the torque of the model itself and
    tau_1 that of one more kilogram at the tool; scale and load are the same for all joints. In a motion in one
    direction a joint alone cannot distinguish dry friction from a constant or from gravity; together with the other
    joints, and with what is expected, it can. The parameters minimize

        Σ weight·e^(-age/memory)·(y - xᵀθ)²/σ² + Σ ((θ - mean)/deviation)²

    with y what observer and feed-forward make of the missed torque, and x the terms behind three low-passes of ω, which
    is what the observer does to a torque. The weight is tanh²(v/0.02): a joint at rest says nothing about its friction,
    and nothing is forgotten there. What a step moves into the parameters is taken out of the disturbance by the caller,
    so that the torque does not jump:

        change = torque after - torque before, both at the reference;    disturbance ← disturbance + change.

    Feed-forward at the speed of the reference acts at a reversal before the arm is held up, which no observer can. The
    method needs a stable innovation, and does not belong on joints with springs.

    Attributes:
        nv: Number of joints.
        dt: Period [s].
        memory: Time in motion after which a measurement counts e times less [s].
        stribeck: How much larger dry friction is at rest, relative.
        expected: Mean and deviation of the parameters before anything is measured.

    Raises:
        ParameterError: A period or memory that is not positive, a rise below 0.

    References:
        K. J. Åström, B. Wittenmark, Adaptive control, 2nd ed., 1995, section 2.2 (forgetting).
    """

    nv: int
    dt: float
    memory: float
    stribeck: float
    expected: Expectation

    def __init__(
        self,
        nv: int,
        dt: float,
        memory: float = MEMORY,
        *,
        stribeck: float = 0.0,
        expected: Expectation | None = None,
    ) -> None:
        set_fields(
            self,
            nv=nv,
            dt=positive_number("dt", dt, "control period in seconds"),
            memory=positive_number("memory", memory, "time in seconds"),
            stribeck=size("stribeck", stribeck),
            expected=nothing_known(nv) if expected is None else expected,
        )

    @property
    def forgotten(self) -> float:
        """Share of the older measurements that a new one replaces."""
        return float(-np.expm1(-self.dt / self.memory))

    @property
    def equations(self) -> Array:
        """Normal equations of what is expected, of a joint's own parameters alone, shape (35, nv)."""
        packed = np.zeros((PACKED, self.nv))
        for i in range(OWN):
            weight = 1.0 / self.expected.deviation[i] ** 2
            packed[at(i, i)], packed[at(i, TERMS)] = weight, weight * self.expected.mean[i]
        return packed

    @property
    def shared_weights(self) -> Array:
        """Weights of what is expected of scale and load, whose mean is 0, shape (2,)."""
        weights: Array = 1.0 / self.expected.deviation[OWN:, 0] ** 2
        return weights

    def init(self) -> FrictionState:
        """Return the state before anything is measured."""
        late = np.zeros((LATE * (TERMS + 1), self.nv))
        return FrictionState(self.expected.mean.copy(), np.zeros((PACKED, self.nv)), late)

    def torque(
        self,
        state: FrictionState,
        v: Array,
        loads: Array | None = None,
        wave: tuple[Array, Array] | None = None,
    ) -> Array:
        """Return the learned torque at a speed that has no noise, shape (nv,) [N·m or N].

        Args:
            state: What has been learned.
            v: Speed of the reference, shape (nv,) [rad/s or m/s].
            loads: Torque of the model, and of one more kilogram, shape (2, nv); zero by default [N·m or N].
            wave: From `waves`; none by default.
        """
        zero = np.zeros(self.nv)
        scaled, load = (zero, zero) if loads is None else loads
        sine, cosine = (zero, zero) if wave is None else wave
        dry = dry_share(v, REFERENCE_SMOOTHING, self.stribeck)
        return mismatch_torque(state.parameters, dry, v, sine, cosine, scaled, load)

    def step(
        self,
        state: FrictionState,
        v: Array,
        disturbance: Array,
        bandwidth: Array,
        fed: Array | None = None,
        loads: Array | None = None,
        wave: tuple[Array, Array] | None = None,
    ) -> FrictionState:
        """Return the state after a tick.

        Args:
            state: From `init` or the tick before.
            v: Estimated speed, shape (nv,) [rad/s or m/s].
            disturbance: Estimated torque that model and feed-forward miss, shape (nv,) [N·m or N].
            bandwidth: Of the observer, shape (nv,) [rad/s].
            fed: Learned torque that is fed forward, shape (nv,); none by default [N·m or N].
            loads: As for `torque`.
            wave: The same.
        """
        zero = np.zeros(self.nv)
        scaled, load = (zero, zero) if loads is None else loads
        sine, cosine = (zero, zero) if wave is None else wave
        dry, one = dry_share(v, SMOOTHING, self.stribeck), np.ones(self.nv)
        late, normal = state.regressors.copy(), state.normal.copy()
        terms = (dry, v, one, sine, cosine, scaled, load, zero if fed is None else fed)
        delay_terms(late, terms, 1.0 - np.exp(-bandwidth * self.dt))
        x = late[(LATE - 1) * (TERMS + 1) :]
        gather(normal, x, x[TERMS] - disturbance, np.tanh(v / SMOOTHING) ** 2, self.forgotten)
        return FrictionState(self._solved(normal), normal, late)

    def _solved(self, normal: Array) -> Array:
        """The parameters."""
        left, theta = normal + self.equations, np.empty((TERMS, self.nv))
        eliminate(left)
        first, second = self.shared_weights
        i, k = OWN, OWN + 1
        a, b, c = (float(left[row].sum()) for row in (at(i, i), at(i, k), at(k, k)))
        x, y = (float(left[at(row, TERMS)].sum()) for row in (i, k))
        theta[i], theta[k] = shared(a + first, b, c + second, x, y)
        substitute(left, theta)
        theta[:2] = np.maximum(theta[:2], 0.0)
        return theta


def nothing_known(nv: int, ripple: ArrayLike = 0.0) -> Expectation:
    """Return what is expected of an arm of which nothing is stated: friction of a few N·m, and its model as it is.

    Args:
        nv: Number of joints.
        ripple: Of the motor's torque, relative, scalar or (nv,).
    """
    deviation = np.full((TERMS, nv), 1e-3)
    deviation[:3], deviation[3:OWN] = 2.0, np.maximum(ripple, 1e-3)
    return Expectation(np.zeros((TERMS, nv)), deviation)
