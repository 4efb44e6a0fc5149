"""Theorem 1 of the paper as numbers: by when s is zero, and by when the error has settled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, BoolArray, gain, per_joint, positive
from .._common.brief import brief_repr
from ..exceptions import DimensionError, NonFiniteError
from . import certificate_words as words
from .lyapunov import Law, admissible_rate, solve
from .surfaces import Surface

_MARGIN = (
    1e-12  # in units of k2: a d_max this close to the admissible one is not distinguished from it
)
_BISECTIONS = 60


@brief_repr("feasible", "d_max", "d_max_admissible", "reaching_time", "sliding_time", "total_time")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Certificate:
    """What Theorem 1 guarantees, joint by joint.

    The law is ṡ = -k1·abs(s)^½·sgn(s) - k2·∫sgn(s) - Δ with abs(dΔ/dt) ≤ d_max, the paper's eq. (9).
    All times are upper bounds; infinity means that no finite one is known or exists, and `reason`
    says why. Arrays are read-only.

    Attributes:
        k1: Gain of the root, shape (nv,).
        k2: Gain of the integral, shape (nv,).
        d_max: Bound on the disturbance's rate, shape (nv,) [rad/s³ or m/s³].
        d_max_admissible: The gains tolerate every d_max below it, shape (nv,): the H∞ condition of
            (13) in closed form.
        feasible: Whether the theorem applies and (13) has a solution, shape (nv,), bool.
        P: Lyapunov matrix of (13) for x = (abs(s)^½·sgn(s), z2), shape (nv, 2, 2); zero where not
            feasible.
        epsilon: Its ε, shape (nv,) [(rad/s)^½/s]; zero where not feasible.
        reaching_time: s = 0 from this time on, shape (nv,) [s]: 2·(V(0)·C·P⁻¹·Cᵀ)^½/ε. Better
            than (18) in two ways: abs(x1) is bounded by (V·C·P⁻¹·Cᵀ)^½ instead of
            (V/λ_min(P))^½, and P and ε are those that make it smallest for this very start.
        reaching_time_paper: T0 as printed, 2·V(0)^½/(ε·λ_min(P)^½), shape (nv,)
            [s], with the P and ε that suit it best among the solutions of the Riccati equation of
            (13) and the P above; never below `reaching_time`.
        s_bound: abs(s) never exceeds it, shape (nv,); infinite where not feasible.
        e1_bound: abs(e1) never exceeds it, shape (nv,); infinite without a surface and where not
            feasible.
        sliding_time: Time from s = 0 until e1 has settled, from the largest e1 that the reaching
            phase can leave behind (`e1_bound`), shape (nv,) [s]; infinite without a surface.
        total_time: reaching_time + sliding_time, shape (nv,) [s].
        settled: Definition of settled on this surface, as text.
        reason: One entry per joint: why a guarantee is missing and the remedy, else empty.
    """

    k1: Array
    k2: Array
    d_max: Array
    d_max_admissible: Array
    feasible: BoolArray
    P: Array
    epsilon: Array
    reaching_time: Array
    reaching_time_paper: Array
    s_bound: Array
    e1_bound: Array
    sliding_time: Array
    total_time: Array
    settled: str
    reason: tuple[str, ...]

    def explain(self) -> str:
        """Explain what is guaranteed and by when, what is not, and the remedy."""
        joints = [f"Joint {i}: {self._explain_joint(i)}" for i in range(self.k1.size)]
        return "\n".join([*joints, words.ASSUMPTIONS])

    def _explain_joint(self, i: int) -> str:
        sentences = []
        if self.feasible[i]:
            sentences += [
                f"s is zero from t = {self.reaching_time[i]:.4g} s on at the latest (the paper's "
                f"formula says {self.reaching_time_paper[i]:.4g} s).",
                f"abs(s) never exceeds {self.s_bound[i]:.4g}.",
                f"The disturbance may change at up to {self.d_max[i]:.4g} per second; k1 = "
                f"{self.k1[i]:.4g} and k2 = {self.k2[i]:.4g} tolerate any rate below "
                f"{self.d_max_admissible[i]:.4g}.",
            ]
        if np.isfinite(self.e1_bound[i]):
            sentences.append(f"abs(e1) never exceeds {self.e1_bound[i]:.4g}.")
        if np.isfinite(self.total_time[i]):
            sentences.append(
                f"e1 has settled by t = {self.total_time[i]:.4g} s at the latest: {self.settled}."
            )
        if self.reason[i]:
            sentences.append(f"Not guaranteed: {self.reason[i]}.")
        return " ".join(sentences)


def certify(
    k1: ArrayLike,
    k2: ArrayLike,
    d_max: ArrayLike,
    *,
    s0: ArrayLike,
    disturbance0: ArrayLike,
    surface: Surface | None = None,
    e0: ArrayLike | None = None,
) -> Certificate:
    """Certify the super-twisting reaching law, joint by joint (paper, Theorem 1).

    Each argument is a scalar or one number per joint. The certificate holds for this very start.
    If only the sizes of s0 and disturbance0 are known, certify equal and opposite signs and take
    the larger times: a convex V takes its largest value at a corner, so all between is covered.

    Args:
        k1: Gain of the root, positive.
        k2: Gain of the integral, positive.
        d_max: Bound on abs(dΔ/dt), not negative [rad/s³ or m/s³].
        s0: s at the start [rad/s or m/s].
        disturbance0: Δ at the start [rad/s² or m/s²]; z2(0) = -Δ(0), the integral starts at zero.
        surface: Sliding surface, for the time that the error takes; goes with `e0`.
        e0: e1 at the start [rad or m]; goes with `surface`.

    Returns:
        The certificate. Without a surface nothing is known of e1: `e1_bound`, `sliding_time` and
        `total_time` are infinite.

    Raises:
        ParameterError: k1 or k2 not positive and finite, d_max negative or not finite.
        DimensionError: Shapes that do not agree; one of `surface` and `e0` without the other.
        NonFiniteError: NaN or infinity in s0, disturbance0 or e0.
    """
    if (surface is None) != (e0 is None):
        raise DimensionError("surface and e0", "given together or not at all", "one of them alone")
    joints = _spread(
        k1=positive("k1", k1),
        k2=positive("k2", k2),
        d_max=gain("d_max", d_max, "zero or positive", lambda x: x >= 0.0),
        s0=_start("s0", s0),
        disturbance0=_start("disturbance0", disturbance0),
        e0=_start("e0", 0.0 if e0 is None else e0),
    )
    admissible = admissible_rate(joints.k1, joints.k2)
    applies = _theorem_applies(surface, joints.e0)
    feasible = applies & (admissible - joints.d_max > _MARGIN * joints.k2)
    reaching = _reaching_phase(joints, feasible)
    e1_bound, sliding_time = _sliding_phase(surface, joints.e0, reaching)
    fields: dict[str, Any] = {
        "k1": joints.k1,
        "k2": joints.k2,
        "d_max": joints.d_max,
        "d_max_admissible": admissible,
        "feasible": feasible,
        **reaching._asdict(),
        "e1_bound": e1_bound,
        "sliding_time": sliding_time,
        "total_time": reaching.reaching_time + sliding_time,
    }
    for array in fields.values():
        array.setflags(write=False)
    reason = _reasons(surface, joints, applies, feasible, np.isfinite(sliding_time))
    return Certificate(**fields, settled=words.settled(surface), reason=reason)


class _Joints(NamedTuple):
    """The arguments of `certify`, each of shape (nv,)."""

    k1: Array
    k2: Array
    d_max: Array
    s0: Array
    disturbance0: Array
    e0: Array

    def law(self, i: int) -> Law:
        """The reaching law of joint i."""
        return Law(float(self.k1[i]), float(self.k2[i]), float(self.d_max[i]))


class _Reaching(NamedTuple):
    """The fields of `Certificate` that the reaching phase fills."""

    P: Array
    epsilon: Array
    reaching_time: Array
    reaching_time_paper: Array
    s_bound: Array


def _start(name: str, value: ArrayLike) -> Array:
    """Check that an initial value is a finite real scalar or vector."""
    expected = "a real scalar or one number per joint, shape (nv,)"
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DimensionError(name, expected, repr(value)) from error
    if array.ndim > 1:
        raise DimensionError(name, expected, f"shape {array.shape}")
    if not np.isfinite(array).all():
        raise NonFiniteError(name, np.flatnonzero(~np.isfinite(array)).tolist())
    return array


def _spread(**values: Array) -> _Joints:
    """MotionMargin scalars over the joints; the longest vector says how many there are."""
    nv = max(value.size for value in values.values())
    return _Joints(**{name: per_joint(name, value, nv).copy() for name, value in values.items()})


def _theorem_applies(surface: Surface | None, e1: Array) -> BoolArray:
    """Whether s = φ(e1) + e2, so that the reaching law acts on s as (9) has it; probed."""
    applies = np.ones(e1.size, dtype=np.bool_)
    if surface is None:
        return applies
    for position in (np.zeros_like(e1), e1):
        for speed in (1.0, -2.0):
            e2 = np.full_like(e1, speed)
            part = _value(surface, position, e2) - _value(surface, position, np.zeros_like(e2))
            applies &= np.isclose(part, e2, rtol=1e-9, atol=0.0)
    return applies


def _value(surface: Surface, e1: Array, e2: Array) -> Array:
    """Value of a surface whose own gains have to fit the number of joints."""
    expected = f"a surface for as many joints as the other arguments, nv = {e1.size}"
    try:
        s = surface.value(e1, e2)
    except ValueError as error:
        raise DimensionError("surface", expected, str(error)) from error
    if s.shape != e1.shape:
        raise DimensionError("surface", expected, f"one for {s.size}")
    return s


def _reaching_phase(joints: _Joints, feasible: BoolArray) -> _Reaching:
    """Solve the matrix inequality (13) of every feasible joint."""
    nv = feasible.size
    phase = _Reaching(
        P=np.zeros((nv, 2, 2)),
        epsilon=np.zeros(nv),
        reaching_time=np.full(nv, np.inf),
        reaching_time_paper=np.full(nv, np.inf),
        s_bound=np.full(nv, np.inf),
    )
    x1 = np.sign(joints.s0) * np.sqrt(np.abs(joints.s0))  # paper, eq. 10
    x0 = np.column_stack([x1, -joints.disturbance0])
    for i in np.flatnonzero(feasible).tolist():
        solution = solve(joints.law(i), x0[i])
        phase.P[i] = solution.P
        phase.epsilon[i] = solution.epsilon
        phase.reaching_time[i] = solution.reaching_time
        phase.reaching_time_paper[i] = solution.reaching_time_paper
        phase.s_bound[i] = solution.s_bound
    return phase


def _sliding_phase(surface: Surface | None, e0: Array, reaching: _Reaching) -> tuple[Array, Array]:
    """Bound abs(e1) over the reaching phase, and the time that e1 takes from there on s = 0.

    ė1 = s - φ(e1) and abs(s) ≤ S·(1 - t/T)² with S = s_bound, T = reaching_time: abs(e1) gains at
    most S·T/3 in all, and it does not grow where φ(abs(e1)) ≥ S.
    """
    e1_bound, sliding_time = np.full(e0.shape, np.inf), np.full(e0.shape, np.inf)
    known = np.isfinite(reaching.reaching_time)
    if surface is None or not known.any():
        return e1_bound, sliding_time
    s_bound = np.where(known, reaching.s_bound, 0.0)
    low = np.abs(e0)
    high = low + s_bound * np.where(known, reaching.reaching_time, 0.0) / 3.0
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        grows = _value(surface, middle, np.zeros_like(middle)) < s_bound
        low, high = np.where(grows, middle, low), np.where(grows, high, middle)
    e1_bound[known] = high[known]
    sliding_time[known] = surface.sliding_time(high)[known]
    return e1_bound, sliding_time


def _reasons(
    surface: Surface | None,
    joints: _Joints,
    applies: BoolArray,
    feasible: BoolArray,
    settles: BoolArray,
) -> tuple[str, ...]:
    """Say of each joint why a guarantee is missing, or nothing."""
    reasons = [""] * feasible.size
    for i in range(feasible.size):
        if not applies[i]:
            reasons[i] = words.why_theorem_fails(surface)
        elif not feasible[i]:
            reasons[i] = words.why_infeasible(joints.law(i))
        elif surface is not None and not settles[i]:
            reasons[i] = words.why_unsettled(surface)
    return tuple(reasons)
