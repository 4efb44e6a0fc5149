"""Where the energy of a run went: motors, environment, friction, motion and height."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._common.arrays import Array
from ..exceptions import ModelError
from ..robot.arm_model import ArmModel
from ..trajectories.reference import difference_each
from .result import SimulationResult


class EnergyBalance(NamedTuple):
    """Energies along a run, each of shape (N,) [J]; the works are sums from t = 0 on.

    Attributes:
        motors: Work of tau on the arm.
        environment: Work of tau_ext on the arm; negative where the arm pushes the environment.
        friction: Energy that joint friction took out, never falling.
        kinetic: ½ vᵀM v.
        potential: Height in the gravity field, zero at the run's start.
        residual: motors + environment + stops - friction - the gain in kinetic + potential: what sampling and
            integrator lose.
        stops: Work of the joint stops on the arm; zero without them.
    """

    motors: Array
    environment: Array
    friction: Array
    kinetic: Array
    potential: Array
    residual: Array
    stops: Array


def energy_balance(result: SimulationResult, plant: ArmModel) -> EnergyBalance:
    """Add up the energies of a run.

    The motors hold their torque over a period, so that their work is tau·Δq; the powers of environment and friction,
    and gravity along the motion, go by the trapezoidal rule over the logged ticks. Both are of second order in the
    period; at an impact on a damped wall, where the force jumps, of first.

    Args:
        result: The run.
        plant: The arm that it simulated.

    Raises:
        ModelError: The run simulated another arm.
    """
    if result.provenance["plant"]["digest"] != plant.digest:
        raise ModelError(f"the run did not simulate {plant!r}: give the plant of `simulate`")
    dynamics, rest = plant.raw_dynamics, np.zeros(plant.nv)
    states = list(zip(result.q, result.v, strict=True))
    moved = difference_each(plant, result.q[:-1], result.q[1:])
    gravity = np.array([dynamics.bias(q, rest) for q in result.q])
    kinetic = np.array([0.5 * v @ dynamics.mass_matrix(q) @ v for q, v in states])
    lost = np.array([dynamics.friction(v) @ v for v in result.v])
    steps = np.diff(result.t)
    motors = _sum(np.sum(result.tau[:-1] * _mean_moved(result, moved), axis=1))
    environment = _sum(steps * _midpoints(np.sum(result.tau_ext * result.v, axis=1)))
    stops = _sum(steps * _midpoints(np.sum(result.tau_stop * result.v, axis=1)))
    friction = _sum(steps * _midpoints(lost))
    potential = _sum(np.sum(_midpoints(gravity) * moved, axis=1))
    residual = motors + environment + stops - friction - (kinetic - kinetic[0]) - potential
    return EnergyBalance(motors, environment, friction, kinetic, potential, residual, stops)


def _mean_moved(result: SimulationResult, moved: Array) -> Array:
    """Displacements by which the held torque worked.

    Semi-implicit Euler moves by h·v⁺ but gains energy as if it moved by h·(v + v⁺)/2.
    """
    if result.provenance["integrator"] != "semi-implicit":
        return moved
    h = result.provenance["dt"] / result.provenance["substeps"]
    corrected: Array = moved - h / 2.0 * np.diff(result.v, axis=0)
    return corrected


def _midpoints(samples: Array) -> Array:
    mean: Array = (samples[1:] + samples[:-1]) / 2.0
    return mean


def _sum(parts: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(parts)])
