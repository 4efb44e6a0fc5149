"""How far two engines agree on one arm."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..._common.arrays import Array
from ...interaction import as_interaction
from ...robot.arm_model import ArmModel
from .mujoco_plant import MujocoPlant, differences
from .rigid import RigidPlant


class EngineAgreement(NamedTuple):
    """Largest differences between MuJoCo and Pinocchio.

    Attributes:
        mass_matrix: Of M, each row relative to its largest entry.
        bias: Of C v + g + viscous friction, relative to its largest entry.
        jacobian: Of the tool's, relative to its largest entry.
        motion: Of the configurations after free motion, q (-) q [rad or m].
    """

    mass_matrix: float
    bias: float
    jacobian: float
    motion: float


def engine_agreement(
    arm: ArmModel, *, states: int = 5, duration: float = 1.0, h: float = 2.5e-4, seed: int = 0
) -> EngineAgreement:
    """Compare MuJoCo with Pinocchio: M, bias and tool Jacobian, and free motion by equal steps.

    The motion begins at rest at `arm.neutral`, without torque, limits and contact. Coulomb friction, which the engines
    have each in their own form, is left out.

    Args:
        arm: The arm.
        states: Number of random states for M, bias and Jacobian.
        duration: Length of the free motion [s].
        h: Length of a step [s].
        seed: Of the random states.

    Raises:
        MissingExtraError: MuJoCo is not installed.
        ModelError: As `MujocoPlant`.
    """
    plant = MujocoPlant(arm.with_friction(coulomb=0.0), limits=False)
    rng = np.random.default_rng(seed)
    shares = [[share.max() for _, share in differences(plant, rng)] for _ in range(states)]
    motion = free_motion_apart(plant, arm.neutral, np.zeros(arm.nv), round(duration / h), h)
    mass_matrix, bias, jacobian = np.max(shares, axis=0).tolist()
    return EngineAgreement(mass_matrix, bias, jacobian, motion)


def free_motion_apart(plant: MujocoPlant, q: Array, v: Array, steps: int, h: float) -> float:
    """Return how far free motion by ABA ends from that of a plant [rad or m].

    Args:
        plant: A plant without limits, contact and Coulomb friction.
        q: Configuration to begin with, shape (nq,).
        v: Velocity to begin with, shape (nv,) [rad/s or m/s].
        steps: Number of steps.
        h: Length of a step [s].
    """
    arm, nothing, rest = plant.arm, as_interaction(None), np.zeros(plant.arm.nv)
    rigid = RigidPlant(arm, friction_at_end=True)
    ours, theirs = rigid.begin(q, v, h), plant.begin(q, v, h)
    for k in range(steps):
        ours = rigid.step(ours, rest, nothing, k * h, h)
        theirs = plant.step(theirs, rest, nothing, k * h, h)
    return float(np.abs(arm.raw_dynamics.difference(ours.q, plant.motion(theirs).q)).max())
