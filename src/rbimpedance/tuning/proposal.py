"""`propose_gains`: from what is not known about an arm to gains that carry it, or to the reason why none do."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, positive_number
from ..controller import ImpedanceController
from ..dynamics import ArmModel
from ..exceptions import GainError
from ..impedance import Impedance
from ..limits import Limits
from ..stability import Certificate, certify
from ..super_twisting import SuperTwisting
from ..surfaces import NonsingularTerminalSurface, Surface
from ..trajectories import Trajectory
from .gain_design import Design, Measured, Task, design, measure_task
from .imperfect import whole_number
from .mismatch import Mismatch
from .motions import Spread
from .uncertainty import Uncertainty
from .ways_out import ways_out
from .worst_case import ExtremeCase, worst_cases

_SLOWER = 1.6  # the margin grows by this where a worst sample chatters or diverges
_ROUNDS = 3


@dataclass(frozen=True, eq=False, kw_only=True)
class GainProposal:
    """Gains for an arm with an uncertainty, or the reason why there are none; arrays have shape (nv,).

    Attributes:
        feasible: Whether bounds, certificate, the scheme's margins and the worst samples all allow these gains.
        reason: Why not; empty where feasible.
        joint: Name of the joint that stands in the way, or None.
        ways_out: What would help, with what it would change.
        nominal: The arm as it was given.
        arm: The model that the controller should carry.
        payload: Payload in that model [kg].
        uncertainty: What is not known.
        trajectory: The motion that it was made for.
        dt: Control period [s].
        surface: Sliding surface.
        k1: Gain of the root [rad^½/s^(3/2)].
        k2: Gain of the integral [rad/s³].
        margin: Of the matched scheme.
        mismatch: The bounds behind the gains.
        gain_limit: Input gain that the scheme bears at this margin and period; 0 where there is none.
        error: Error e1 that the scheme leaves, predicted [rad or m].
        noise_error: Error e1 that the sensors' noise stands for [rad or m].
        noise_torque: Torque that it stands for, about [N·m or N].
        certificate: Theorem 1 for the effective gains at the smallest input gain; None where the margin is infinite.
        worst: The simulated worst samples; empty where the bounds alone say no.
    """

    feasible: bool
    reason: str
    joint: str | None
    ways_out: tuple[str, ...]
    nominal: ArmModel
    arm: ArmModel
    payload: float
    uncertainty: Uncertainty
    trajectory: Trajectory
    dt: float
    surface: Surface
    k1: Array
    k2: Array
    margin: Array
    mismatch: Mismatch
    gain_limit: float
    error: Array
    noise_error: Array
    noise_torque: Array
    certificate: Certificate | None
    worst: tuple[ExtremeCase, ...]

    def controller(
        self, impedance: Impedance | None = None, *, limits: Limits | ArrayLike | None = None
    ) -> ImpedanceController:
        """Build the controller that was proposed.

        Args:
            impedance: Target impedance; M_d = 1, D_d = 10, K_d = 20 by default, as in the paper.
            limits: Of the actuators; see `ImpedanceController`.

        Raises:
            GainError: The proposal is not feasible.
        """
        if not self.feasible:
            raise GainError("proposal", self.reason, "feasible; see its ways_out")
        reaching = SuperTwisting(self.k1, self.k2, "matched", self.margin)
        impedance = _usual_impedance() if impedance is None else impedance
        return ImpedanceController(
            self.arm, impedance, self.surface, reaching, self.dt, limits=limits
        )

    def explain(self) -> str:
        """Say in plain language what is proposed, or why nothing is and what would help."""
        mismatch = self.mismatch
        if not self.feasible:
            ways = "\n".join(f"- {way}" for way in self.ways_out)
            return f"No gains: {self.reason}.\nWays out:\n{ways}"
        return (
            f"The controller carries {self.payload:.3g} kg. A plant answers with {mismatch.gain_low:.2g} to "
            f"{mismatch.gain_high:.2g} times the acceleration that the model expects; the scheme bears up to "
            f"{self.gain_limit:.2g} with margin {float(self.margin.max()):.3g} at dt = {self.dt:g} s. The error that "
            f"remains is about {self.error.max():.2g} rad."
        )


def propose_gains(
    arm: ArmModel,
    uncertainty: Uncertainty,
    trajectory: Trajectory,
    dt: float,
    *,
    impedance: Impedance | None = None,
    surface: Surface | None = None,
    q0: ArrayLike | None = None,
    spread: Spread | None = None,
    duration: float = 5.0,
    accuracy: float = 1e-3,
    samples: int = 24,
    instants: int = 25,
    seed: int = 0,
    on_tick: Callable[[int, int], None] | None = None,
) -> GainProposal:
    """Propose gains for an arm from what is not known about it.

    Bounds come from sampled plants on sampled motions around the trajectory; the gains follow from them, are checked
    by `certify` and against the scheme's margins for input gain and noise at this period, and the worst samples are
    simulated. docs/tuning.md tells how, and what is not covered.

    Args:
        arm: The arm as it is modelled.
        uncertainty: What is not known.
        trajectory: Desired motion.
        dt: Control period [s].
        impedance: Target impedance that the samples are simulated with; M_d = 1, D_d = 10, K_d = 20 by default.
        surface: Sliding surface; by default a fast terminal one with the smoothing that leaves the smallest error.
        q0: Initial configuration, shape (nq,); `arm.neutral` by default.
        spread: How far motions leave the trajectory; give the acceleration of pushes where the arm will be pushed.
        duration: Length of the motion that counts, and of the simulations [s].
        accuracy: Error abs(e1) that is asked for once the reaching phase is over [rad or m].
        samples: Number of plants that the bounds are taken over, extremes first.
        instants: Number of instants along the trajectory.
        seed: Of everything random.
        on_tick: Called with (ticks done, ticks in all) of every simulation, for a progress bar.

    Returns:
        The proposal: yes with the numbers behind it, or no with the joint, the reason and the ways out.

    Raises:
        GainError: A period, duration, accuracy or count that cannot be, or a surface that Theorem 1 does not cover.
        DimensionError: A range, the surface or q0 is for another number of joints.
        ModelError: The arm has no such payload frame.
    """
    if isinstance(surface, NonsingularTerminalSurface):
        raise GainError("surface", surface, "one with s = φ(e1) + e2, power or fast terminal")
    task = Task(
        arm=arm,
        uncertainty=uncertainty,
        trajectory=trajectory,
        dt=positive_number("dt", dt, "control period in seconds"),
        surface=surface,
        duration=positive_number("duration", duration, "length in seconds"),
        accuracy=positive_number("accuracy", accuracy, "error"),
        samples=whole_number("samples", samples, 1),
        instants=whole_number("instants", instants, 1),
        seed=whole_number("seed", seed),
        spread=Spread() if spread is None else spread,
    )
    q0 = np.array(arm.neutral if q0 is None else arm.check_configuration("q0", q0))
    measured = measure_task(task)
    target = _usual_impedance() if impedance is None else impedance
    found, certificate, worst = _checked(task, measured, target, q0, on_tick)
    return _proposal(task, found, certificate, worst)


def _checked(
    task: Task,
    measured: Measured,
    impedance: Impedance,
    q0: Array,
    on_tick: Callable[[int, int], None] | None,
) -> tuple[Design, Certificate | None, tuple[ExtremeCase, ...]]:
    """Design gains, simulate the worst samples, and slow the scheme down where one of them chatters or diverges."""
    slower, certificate = 1.0, None
    worst: tuple[ExtremeCase, ...] = ()
    for _ in range(_ROUNDS):
        found = design(task, measured, slower=slower)
        if np.isfinite(found.margin):
            certificate = _certificate(task, found, q0)
            found = _certified(task, found, certificate)
        if found.joint is not None:
            so_far = f"{worst[-1].reason}, and slower, " if worst else ""
            found = replace(found, reason=so_far + found.reason)
            break
        worst = _until_failure(worst_cases(task, found, impedance, q0, on_tick))
        failed = worst[-1]
        if failed.joint is None:
            break
        found = replace(found, joint=failed.joint, reason=failed.reason)
        if not failed.unstable:
            break
        slower *= _SLOWER
    return found, certificate, worst


def _until_failure(cases: Iterator[ExtremeCase]) -> tuple[ExtremeCase, ...]:
    """The cases up to the first one that failed, that one included."""
    seen = []
    for case in cases:
        seen.append(case)
        if case.joint is not None:
            break
    return tuple(seen)


def _certificate(task: Task, found: Design, q0: Array) -> Certificate:
    """Theorem 1 for the gains that are left at the smallest input gain, from the start of the motion."""
    mismatch, start = found.measured.mismatch, task.trajectory(0.0)
    e1 = task.arm.unchecked.difference(q0, start.q)
    return certify(
        mismatch.gain_low * found.k1,
        mismatch.gain_low * found.k2,
        mismatch.disturbance_rate,
        s0=found.surface.value(e1, np.asarray(start.v)),
        disturbance0=mismatch.disturbance,
        surface=found.surface,
        e0=e1,
    )


def _certified(task: Task, found: Design, certificate: Certificate) -> Design:
    """The design, refused where Theorem 1 does not hold."""
    if certificate.feasible.all() or found.joint is not None:
        return found
    joint = int(np.argmin(certificate.feasible))
    reason = (
        f"joint '{task.arm.joint_names[joint]}' has no certificate: {certificate.reason[joint]}"
    )
    return replace(found, joint=joint, reason=reason)


def _proposal(
    task: Task, found: Design, certificate: Certificate | None, worst: tuple[ExtremeCase, ...]
) -> GainProposal:
    feasible = found.joint is None
    margin = np.full(task.arm.nv, found.margin)
    for array in (found.k1, found.k2, margin):
        array.setflags(write=False)
    return GainProposal(
        feasible=feasible,
        reason=found.reason,
        joint=None if found.joint is None else task.arm.joint_names[found.joint],
        ways_out=() if feasible else ways_out(task, found),
        nominal=task.arm,
        arm=found.measured.model,
        payload=found.measured.payload,
        uncertainty=task.uncertainty,
        trajectory=task.trajectory,
        dt=task.dt,
        surface=found.surface,
        k1=found.k1,
        k2=found.k2,
        margin=margin,
        mismatch=found.measured.mismatch,
        gain_limit=found.gain_limit,
        error=found.error,
        noise_error=found.noise_error,
        noise_torque=found.noise_torque,
        certificate=certificate,
        worst=worst,
    )


def _usual_impedance() -> Impedance:
    """The target of the paper's section 4."""
    return Impedance(mass=1.0, damping=10.0, stiffness=20.0)
