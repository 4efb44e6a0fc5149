"""A certificate of the loop that runs: sampled, all joints coupled, with wrong masses, late measurements, lost ticks.

From what is known at a tick (a set of (s, ζ) for each joint, a bound on e1) follows what is known at the next one. That
is repeated from the start until nothing grows any more: the largest values on the way bound the peaks, the last sets
are never left. docs/theory.md, section 9.1, has statement, assumptions and proof.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import (
    Array,
    gain,
    not_negative,
    per_joint,
    positive,
    positive_number,
    whole_number,
)
from .._common.brief import brief_repr
from ..exceptions import DimensionError, ParameterError
from .sampled_loop import Loop, Plants, State, advance, is_verified, is_within
from .sampled_sets import Sets, boxes
from .surfaces import FastTerminalSurface

_TICKS = 1500
_CHECKED_EVERY = 20
_SETTLED = 0.005  # change over that many ticks after which sets are tried that stay
_ROOM = (1.05, 1.3)  # by which their bounds are larger than those reached
_ENTRY = 400  # ticks in which they are entered
_TRIES = 2
_TRACE = 1.0 + 1e-5  # by which each is larger than where the tick before leads
_FAR = 30.0  # s that is lost [rad/s]
_SMALL = 1e-6  # of a unit: the smallest sets
_SHARES = (1.0, 0.1, 0.01)


@brief_repr("feasible", "share", "e1_bound", "e1_peak", "settling_time", "delay", "lost")
@dataclass(frozen=True, eq=False, kw_only=True)
class SampledCertificate:
    """What holds for the sampled loop of all joints together; arrays have shape (nv,), infinite where not feasible.

    Attributes:
        feasible: Whether the joints provably stay together in a bounded set.
        reason: Why not; empty where feasible.
        share: Largest share of the start from which that is proven, of 1, 0.1, 0.01 and 0.
        e1_peak: abs(e1) never exceeds it, from that share of the start on [rad or m].
        s_peak: The same for s [rad/s or m/s].
        settling_time: All bounds below hold from then on [s].
        e1_bound: Bound on abs(e1) that remains [rad or m].
        s_bound: Bound on abs(s) [rad/s or m/s].
        e2_bound: Bound on abs(e2) [rad/s or m/s].
        e3_bound: Bound on the mean of the acceleration error over a period [rad/s² or m/s²].
        delay: Ticks from a measurement to its torque.
        lost: Ticks in a row that may be lost, time and again.
        loop: What it was proven for.
        tube: What is known at every tick; the last one is never left. Empty where not feasible.
    """

    feasible: bool
    reason: str
    share: float
    e1_peak: Array
    s_peak: Array
    settling_time: float
    e1_bound: Array
    s_bound: Array
    e2_bound: Array
    e3_bound: Array
    delay: int
    lost: int
    loop: Loop = field(repr=False)
    tube: tuple[State, ...] = field(repr=False)

    def is_verified(self, *, whole: bool = False) -> bool:
        """Check the proof in interval arithmetic: the last sets are never left.

        Args:
            whole: Check every tick from the start on, too; slower by the number of ticks.
        """
        if not self.feasible:
            return False
        last = self.tube[-1]
        if not is_verified(self.loop, last, last, last):
            return False
        return not whole or all(
            is_verified(self.loop, self.tube[k], _widest(self.tube, k, self.loop.window), after)
            for k, after in enumerate(self.tube[1:-1])
        )

    def impedance_bound(self, mass: ArrayLike, damping: ArrayLike, stiffness: ArrayLike) -> Array:
        """Return the bound on abs(e_im) that remains, eq. (5), shape (nv,) [N·m or N].

        Args:
            mass: M_d, scalar, one number per joint, or a matrix.
            damping: D_d.
            stiffness: K_d.
        """
        errors = self.e3_bound, self.e2_bound, self.e1_bound
        pairs = zip((mass, damping, stiffness), errors, strict=True)
        bound: Array = np.sum([_matrix(M, len(e)) @ e for M, e in pairs], axis=0)
        return bound

    def explain(self) -> str:
        """Explain what is proven, and under which assumptions."""
        if not self.feasible:
            return f"Not proven: {self.reason}."
        verified = "verified" if self.is_verified() else "NOT verified"
        start = "rest on the motion" if self.share == 0.0 else f"{self.share:.0%} of the start"
        lines = [
            f"From {start} no joint's abs(e1) exceeds {self.e1_peak.max():.3g}, and from "
            f"{self.settling_time:.3g} s on {self.e1_bound.max():.3g}; {verified} in interval arithmetic."
        ]
        lines += [
            f"Joint {i}: abs(e1) ≤ {self.e1_bound[i]:.3g}, abs(s) ≤ {self.s_bound[i]:.3g}, on the way "
            f"{self.e1_peak[i]:.3g} and {self.s_peak[i]:.3g}."
            for i in range(len(self.e1_bound))
        ]
        late = f"{self.delay} ticks of delay, and up to {self.lost} lost ticks in a row, time and again"
        return "\n".join([*lines, f"With {late}. {ASSUMPTIONS}"])


ASSUMPTIONS = (
    "This holds as long as the input gains are those that were given, the acceleration that the integral has to hold "
    "stays within its size and rate, torques are applied as computed (no limit reached), a lost tick holds the torque "
    "before, and measurements have no noise."
)


def certify_sampled(
    k1: ArrayLike,
    k2: ArrayLike,
    gains: Sequence[Array],
    rate: ArrayLike,
    *,
    surface: FastTerminalSurface,
    dt: float,
    margin: ArrayLike = 1.0,
    disturbance: ArrayLike = 0.0,
    e0: ArrayLike = 0.0,
    delay: int = 0,
    lost: int = 0,
) -> SampledCertificate:
    """Certify the matched scheme on a sampled plant whose joints are coupled and whose masses are not known.

    Args:
        k1: Gain of the root, scalar or (nv,).
        k2: Gain of the integral.
        gains: G = M_true⁻¹·κ·M_model, the ratio of true to demanded acceleration, for groups of plants: arrays of shape
            (N, nv, nv). What is proven holds for every plant whose G stays, entry by entry, in the range of one group.
        rate: Bound on the rate of the acceleration A* that the integral has to hold [rad/s³ or m/s³].
        surface: Fast terminal surface.
        dt: Control period [s].
        margin: Of the scheme.
        disturbance: Bound on abs(A*); at the start the integral holds nothing of it [rad/s² or m/s²].
        e0: Bound on abs(e1) at the start, where e2 is 0 [rad or m].
        delay: Ticks from a measurement to its torque.
        lost: Ticks in a row that may be lost.

    Returns:
        The certificate for the largest share of that start (e0 and disturbance) for which there is one.

    Raises:
        ParameterError: A number that cannot be, a surface that is not fast terminal, gains that are not positive.
        DimensionError: Shapes that do not agree.
    """
    if not isinstance(surface, FastTerminalSurface):
        raise ParameterError("surface", surface, "a FastTerminalSurface")
    plants = _plants(gains)
    nv = plants.low.shape[1]
    surface.check(nv)
    loop = Loop(
        k1=positive("k1", k1, nv),
        k2=positive("k2", k2, nv),
        margin=per_joint("margin", gain("margin", margin, "at least 1", lambda x: x >= 1.0), nv),
        dt=positive_number("dt", dt, "control period in seconds"),
        surface=surface,
        plants=plants,
        rate=not_negative("rate", rate, nv),
        disturbance=not_negative("disturbance", disturbance, nv),
        delay=whole_number("delay", delay),
        lost=whole_number("lost", lost),
    )
    reason = _premise(loop)
    if reason:
        return _certificate(loop, 0.0, (), reason)
    return _largest_start(loop, not_negative("e0", e0, nv))


def _plants(gains: Sequence[Array]) -> Plants:
    groups = [np.asarray(group, dtype=np.float64) for group in gains]
    for group in groups:
        if (
            group.ndim != 3
            or group.shape[1:] != groups[0].shape[1:]
            or group.shape[1] != group.shape[2]
        ):
            raise DimensionError("gains", "arrays of shape (N, nv, nv)", f"one of {group.shape}")
    own = [group.diagonal(axis1=1, axis2=2) for group in groups]
    size = [np.abs(group) for group in groups]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = [(a / g[:, :, None]).max(axis=0) for a, g in zip(size, own, strict=True)]
    coupling = np.array(cross)
    coupling[:, range(coupling.shape[1]), range(coupling.shape[1])] = 0.0
    low, high = (np.array([pick(g, axis=0) for g in own]) for pick in (np.min, np.max))
    return Plants(low, high, coupling, np.array([a.max(axis=0) for a in size]))


def _premise(loop: Loop) -> str:
    """What the proof needs before it begins, where it is not given."""
    if not (loop.plants.low > 0.0).all():
        joint = int(loop.plants.low.min(axis=0).argmin())
        return f"joint {joint} can answer its own torque the wrong way round"
    steepest = float((loop.surface.rate + loop.surface.gamma * loop.surface.inner_slope).max())
    if steepest * loop.dt >= 1.0:
        return f"the surface's slope, {steepest:.3g} 1/s, is too steep for the period"
    return ""


def _largest_start(loop: Loop, e0: Array) -> SampledCertificate:
    """The certificate from the largest share of the start."""
    rest, last = _tube(loop, 0.0 * e0, 0.0 * loop.disturbance)
    if not rest:
        return _certificate(loop, 0.0, (), _why(loop, last))
    shares = _SHARES if (e0.any() or loop.disturbance.any()) else ()
    for share in shares:
        tube, _ = _tube(loop, share * e0, share * loop.disturbance)
        if tube:
            return _certificate(loop, share, tube, "")
    return _certificate(loop, 0.0 if shares else 1.0, rest, "")


def _tube(loop: Loop, e0: Array, held: Array) -> tuple[tuple[State, ...], State]:
    """What is known at every tick from a start on until sets that are never left, or nothing; and the last state."""
    tube, tries = [_start(loop, e0, held)], 0
    for k in range(_TICKS):
        before = _widest(tube, k, loop.window)
        tube.append(advance(loop, tube[k], before))
        if not (tube[-1].s.max() < _FAR) or tube[-1].e1.max() > np.pi:
            break
        if (k + 1) % _CHECKED_EVERY == 0 and _has_settled(tube):
            entry = _that_stays(loop, _widest(tube, k + 1, loop.window))
            if entry:
                return (*tube, *entry), entry[-1]
            tries += 1
            if tries == _TRIES:
                break
    return (), tube[-1]


def _start(loop: Loop, e0: Array, held: Array) -> State:
    """e1 within ± e0, e2 = 0, and an integral that holds nothing of A* yet."""
    groups = len(loop.plants.low)
    e1 = np.tile(e0, (groups, 1))
    s = loop.surface.terms(e1, np.zeros_like(e1), 0.0)[0]
    steepest = loop.surface.rate + loop.surface.gamma * loop.surface.inner_slope
    zeta = np.tile((1.0 + steepest * loop.dt / 2.0) * held, (groups, 1))
    s_unit, a_unit = np.maximum(s / loop.s_unit, _SMALL), np.maximum(zeta / loop.a_unit, _SMALL)
    # y ≤ 2·s in these units; the feed-forward c·e2 is 0, and A* less its share of ζ is in `disturbance`
    a = (2.0 * s_unit + a_unit) * loop.a_unit + steepest * s
    speed = loop.plants.high * a
    return State(boxes(s_unit.ravel(), a_unit.ravel()), s_unit * loop.s_unit, e1, a, speed)


def _widest(tube: Sequence[State], k: int, window: int) -> State:
    """The largest bounds over the window of ticks that ends with tick k; the sets are those of tick k."""
    recent = tube[max(k + 1 - window, 0) : k + 1]
    bounds = (np.maximum.reduce([state[i] for state in recent]) for i in range(1, 5))
    return State(tube[k].sets, *bounds)


def _has_settled(tube: Sequence[State]) -> bool:
    now, then = tube[-1], tube[-1 - _CHECKED_EVERY]
    return all(
        np.allclose(getattr(now, name), getattr(then, name), rtol=_SETTLED, atol=0.0)
        for name in ("s", "e1")
    )


def _that_stays(loop: Loop, widest: State) -> tuple[State, ...]:
    """Ticks into sets that are never left, under bounds somewhat larger than those reached; empty where they grow."""
    for room in _ROOM:
        # s grows about with the square of accelerations; e1 is slow, and may still be on its way
        s, a = room**2 * widest.s, room**1.5 * widest.a
        bounds = s, room**3 * widest.e1, a, room**1.5 * widest.speed
        ticks = [State(widest.sets, *bounds)]
        for k in range(1, _ENTRY + 1):
            sets = advance(loop, ticks[-1], ticks[-1]).sets
            ticks.append(State(Sets(_TRACE * sets.support, sets.scale), *bounds))
            last = ticks[-1]
            if k % _CHECKED_EVERY == 0 and is_within(
                advance(loop, last, last, last.sets.scale), last
            ):
                return tuple(ticks[1:])
    return ()


def _why(loop: Loop, last: State) -> str:
    """The joint whose s grows most in its own unit, and what it is coupled with."""
    grown = (last.s / loop.s_unit).max(axis=0)
    joint = int(np.nan_to_num(grown, nan=np.inf).argmax())
    coupling = float(loop.plants.cross[:, joint].sum(axis=1).max())
    low, high = loop.plants.low[:, joint].min(), loop.plants.high[:, joint].max()
    return (
        f"the sets grow without end, first at joint {joint}: own gain {low:.2g} to {high:.2g}, coupled by "
        f"{coupling:.2g}, rate {loop.rate[joint] / loop.k2[joint]:.2g} of k2"
    )


def _certificate(
    loop: Loop, share: float, tube: tuple[State, ...], reason: str
) -> SampledCertificate:
    nothing = np.full(len(loop.k2), np.inf)
    fields = dict.fromkeys(
        ("e1_peak", "s_peak", "e1_bound", "s_bound", "e2_bound", "e3_bound"), nothing
    )
    if tube:
        last = tube[-1]
        e2 = last.s + loop.surface.terms(last.e1, np.zeros_like(last.e1), 0.0)[0]
        e3 = np.array([m @ a for m, a in zip(loop.plants.size, last.a, strict=True)])
        bounds = {"e1_bound": last.e1, "s_bound": last.s, "e2_bound": e2, "e3_bound": e3}
        peaks = {
            "e1_peak": np.max([state.e1 for state in tube], axis=0),
            "s_peak": np.max([state.s for state in tube], axis=0),
        }
        fields = {name: bound.max(axis=0) for name, bound in (bounds | peaks).items()}
    time = (len(tube) - 2) * (1 + loop.lost) * loop.dt if tube else np.inf
    return SampledCertificate(
        feasible=bool(tube),
        reason=reason,
        share=share,
        settling_time=time,
        delay=loop.delay,
        lost=loop.lost,
        loop=loop,
        tube=tube,
        **fields,
    )


def _matrix(x: ArrayLike, nv: int) -> Array:
    """Absolute values of a matrix from a scalar, a vector or a matrix."""
    array = np.abs(np.asarray(x, dtype=np.float64))
    return array if array.ndim == 2 else np.diag(np.broadcast_to(array, (nv,)))
