"""How far plants are from the controller's model, measured over sampled motions around a trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .._common.arrays import Array
from ..robot.arm_model import ArmModel
from ..robot.pinocchio_dynamics import COULOMB_SMOOTHING
from ..trajectories import Reference
from .motions import Motion
from .plant_sample import PlantSample, with_body
from .uncertainty import Uncertainty

_SHARES = np.array([0.0, 0.003, 0.01, 0.02, 0.03, 0.05, 0.07, *np.linspace(0.1, 1.0, 10)])
"""Of the payload's range that the model may hold; finer where it is light, for bodies that a wrist hardly weighs."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Mismatch:
    """What plants and model differ by at most over the sampled motions; arrays have shape (nv,).

    G = M_true⁻¹·κ·M_model is the ratio of true to demanded acceleration, with κ the torque
    constants; friction adds h·D(v) to M_true, because a torque held for a period h works against it.

    Attributes:
        torque: Largest torque that the model misses [N·m or N].
        disturbance: Largest corresponding acceleration, of M_true⁻¹·(torque missed) [rad/s² or m/s²].
        disturbance_rate: Largest rate of that, on the trajectory and around it [rad/s³ or m/s³].
        inertia: Smallest effective inertia 1/(M_true⁻¹)ᵢᵢ [kg·m² or kg].
        gain_low: Smallest eigenvalue of G.
        gain_high: Largest eigenvalue of G.
        joint_low: Joint that takes the largest part in the motion of the smallest eigenvalue.
        joint_high: The same for the largest one.
        rho: The larger one of gain_high and 1/gain_low.
        extremes: Indices of the samples with the largest and smallest gain, the smallest gain of a joint on itself, the
            largest torque mismatch in proportion to inertia, and the largest rate.
    """

    torque: Array
    disturbance: Array
    disturbance_rate: Array
    inertia: Array
    gain_low: float
    gain_high: float
    joint_low: int
    joint_high: int
    extremes: tuple[int, ...]

    @property
    def rho(self) -> float:
        """The larger one of gain_high and 1/gain_low."""
        return max(self.gain_high, 1.0 / self.gain_low)


class _Seen(NamedTuple):
    """What one sample shows over all motions."""

    torque: Array
    disturbance: Array
    rate: Array
    inertia: Array
    gains: Array
    low: tuple[float, int]
    high: tuple[float, int]


def measure(
    model: ArmModel, samples: Sequence[PlantSample], motions: Sequence[Motion], dt: float
) -> Mismatch:
    """Measure the largest mismatch between a model and plants; see `measure_with_gains`."""
    return measure_with_gains(model, samples, motions, dt)[0]


def measure_with_gains(
    model: ArmModel, samples: Sequence[PlantSample], motions: Sequence[Motion], dt: float
) -> tuple[Mismatch, Array]:
    """Measure the largest mismatch between a model and plants.

    Args:
        model: The controller's.
        samples: Plants.
        motions: From `sample_motions`.
        dt: Control period [s].

    Returns:
        The mismatch, and G of every sample at every motion, shape (N, nv, nv).
    """
    known = _Modelled(_mass_matrices(model, motions), _torques(model, motions))
    seen = [_look(known, sample, motions, dt) for sample in samples]
    inertia = np.min([one.inertia for one in seen], axis=0)
    lows, highs = [one.low[0] for one in seen], [one.high[0] for one in seen]
    accelerations = [float((one.torque / inertia).max()) for one in seen]
    rates = [float(one.rate.max()) for one in seen]
    own = [float(one.gains.diagonal(axis1=1, axis2=2).min()) for one in seen]
    extremes = (
        *(np.argmax(highs), np.argmin(lows), np.argmin(own)),
        *(np.argmax(accelerations), np.argmax(rates)),
    )
    mismatch = Mismatch(
        torque=np.max([one.torque for one in seen], axis=0),
        disturbance=np.max([one.disturbance for one in seen], axis=0),
        disturbance_rate=np.max([one.rate for one in seen], axis=0),
        inertia=inertia,
        gain_low=min(lows),
        gain_high=max(highs),
        joint_low=seen[int(extremes[1])].low[1],
        joint_high=seen[int(extremes[0])].high[1],
        extremes=tuple(dict.fromkeys(int(i) for i in extremes)),
    )
    return mismatch, np.concatenate([one.gains for one in seen])


def balanced_model(
    arm: ArmModel, uncertainty: Uncertainty, motions: Sequence[Motion], dt: float
) -> tuple[ArmModel, float]:
    """Return the model that the controller should use, and the payload in it [kg].

    Payload and armature are inside their ranges where the input gain is wrong by about the same factor at both ends.
    Friction that is stiff against the period joins the armature, as a torque held for a period meets it.

    Args:
        arm: The arm as it is modelled.
        uncertainty: What is not known.
        motions: From `sample_motions`.
        dt: Control period [s].
    """
    samples = uncertainty.extremes(arm)
    few = motions[:: max(len(motions) // 6, 1)]
    com = uncertainty.payload_com.mean(axis=0)
    gyration = float(uncertainty.payload_gyration.mean())
    best, best_rho, held = arm, np.inf, 0.0
    for share in (_SHARES if _is_uncertain(uncertainty) else _SHARES[:1]).tolist():
        payload = float(_between(uncertainty.payload, share))
        model = with_body(arm, payload, com, gyration, uncertainty.payload_frame)
        if uncertainty.armature is not None:
            model = model.with_armature(_between(uncertainty.armature, share))
        model = _with_friction_over_period(model, uncertainty, few, dt)
        rho = measure(model, samples, few, dt).rho
        if rho < best_rho:
            best, best_rho, held = model, rho, payload
    return best, held


def _look(
    known: _Modelled,
    sample: PlantSample,
    motions: Sequence[Motion],
    dt: float,
) -> _Seen:
    """Measure one plant."""
    slopes = [dt * slope for slope in _friction_slopes(sample.plant)]
    slopes = slopes if (slopes[1] > slopes[0]).any() else slopes[:1]
    M = _mass_matrices(sample.plant, motions)
    missed = _torques(sample.plant, motions) - sample.torque_constant * known.torques
    M_held = np.concatenate([M[:, 0] + np.diag(slope) for slope in slopes])
    asked = sample.torque_constant[:, None] * known.mass[:, 0]
    gains = np.linalg.solve(M_held, np.concatenate([asked] * len(slopes)))
    pushed = np.linalg.solve(M + np.diag(slopes[0]), missed[..., None])[..., 0]
    softest_held = np.linalg.inv(M_held[: len(motions)]).diagonal(axis1=1, axis2=2)
    return _Seen(
        np.abs(missed[:, 0]).max(axis=0),
        np.abs(pushed[:, 0]).max(axis=0),
        np.abs(pushed[:, 1] - pushed[:, 0]).max(axis=0) / dt,
        (1.0 / softest_held).min(axis=0),
        gains,
        *_extreme_gains(M_held, gains),
    )


class _Modelled(NamedTuple):
    """What the model has at the motions, now and then: mass matrices (N, 2, nv, nv) and torques (N, 2, nv)."""

    mass: Array
    torques: Array


def _mass_matrices(arm: ArmModel, motions: Sequence[Motion]) -> Array:
    mass = arm.raw_dynamics.mass_matrix
    return np.array([[mass(now.q), mass(then.q)] for now, then in motions])


def _torques(arm: ArmModel, motions: Sequence[Motion]) -> Array:
    torque = arm.raw_dynamics.inverse_dynamics
    return np.array([[torque(*now), torque(*then)] for now, then in motions])


def missed_torque(
    model: ArmModel, sample: PlantSample, motion: Reference, held: Array
) -> tuple[Array, Array]:
    """Return the torque error of the model on a motion, and the corresponding acceleration, each of shape (nv,).

    Args:
        model: The controller's.
        sample: The plant.
        motion: Configuration, velocity and acceleration.
        held: What friction adds to the inertia over a period, shape (nv,).
    """
    asked = sample.torque_constant * model.raw_dynamics.inverse_dynamics(*motion)
    missed = sample.plant.raw_dynamics.inverse_dynamics(*motion) - asked
    M = sample.plant.raw_dynamics.mass_matrix(motion.q) + np.diag(held)
    return missed, np.asarray(np.linalg.solve(M, missed), dtype=np.float64)


def _extreme_gains(M_true: Array, gains: Array) -> tuple[tuple[float, int], tuple[float, int]]:
    """Smallest and largest eigenvalue of G, each with the joint that moves most of its energy."""
    values, vectors = np.linalg.eig(gains)
    joints = np.abs(vectors * (M_true @ vectors)).argmax(axis=1)
    sizes = np.abs(values)
    low, high = (np.unravel_index(k, sizes.shape) for k in (sizes.argmin(), sizes.argmax()))
    return (float(sizes[low]), int(joints[low])), (float(sizes[high]), int(joints[high]))


def _with_friction_over_period(
    model: ArmModel, uncertainty: Uncertainty, motions: Sequence[Motion], dt: float
) -> ArmModel:
    """Add to the armature what friction does over a period, between its softest and its stiffest, geometrically."""
    softest, stiffest = _friction_slopes(model)
    viscous, coulomb = uncertainty.viscous, uncertainty.coulomb
    softest = softest + viscous[0]
    stiffest = stiffest + viscous[1] + coulomb[1] / COULOMB_SMOOTHING
    if not (stiffest > 0.0).any():
        return model
    effective = [1.0 / np.diag(np.linalg.inv(model.mass_matrix(now.q))) for now, _ in motions]
    inertia = np.min(effective, axis=0)
    added = np.sqrt((inertia + dt * softest) * (inertia + dt * stiffest)) - inertia
    return model.with_armature(model.armature + added)


def _friction_slopes(arm: ArmModel) -> tuple[Array, Array]:
    """Slope of friction over speed, far from standstill and at it, each of shape (nv,)."""
    return arm.viscous, arm.viscous + arm.coulomb / COULOMB_SMOOTHING


def _is_uncertain(uncertainty: Uncertainty) -> bool:
    ranges = [uncertainty.payload] + (
        [] if uncertainty.armature is None else [uncertainty.armature]
    )
    return any((low != high).any() for low, high in ranges)


def _between(range_: Array, share: float) -> Array:
    between: Array = range_[0] + share * (range_[1] - range_[0])
    return between
