"""The compiled dynamics of one arm behind plain calls, held to Pinocchio's before they serve."""

from __future__ import annotations

import functools
import weakref
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import types

from ..._common.arrays import Array
from ..._numba.compile import kernel
from ..._numba.layouts.arrays import Borrowed
from ...exceptions import ModelError
from ..arm_model import ArmModel
from . import rigid_body
from .rigid_body import friction, place_joints
from .tables import ArmTables, Workspace, arm_tables, workspace

AGREEMENT = 1e-12
"""Largest difference to Pinocchio's result, relative to the largest entry of it, with which an arm is served."""

STATES = 20
"""Random states at which that is looked at."""

VECTOR_IN = Borrowed(types.float64, 1, readonly=True)
"""Type of a vector from outside: checked."""

OWN_VECTOR = Borrowed(types.float64, 1, trusted=True)
OWN_MATRIX = Borrowed(types.float64, 2, trusted=True)
OWN_INTEGERS = Borrowed(types.int64, 2, trusted=True)
"""Types of arrays that this package makes itself."""

ARM = types.NamedTuple((OWN_MATRIX, OWN_INTEGERS, OWN_VECTOR), ArmTables)
SPACE = types.NamedTuple((OWN_VECTOR, OWN_VECTOR, OWN_VECTOR, OWN_MATRIX), Workspace)


_AGREED: weakref.WeakKeyDictionary[ArmModel, ArmTables] = weakref.WeakKeyDictionary()
"""Tables that have been held to Pinocchio's results: once for each arm, however many controllers it gets."""


class CompiledDynamics:
    """RNEA, ABA and CRBA of one arm, friction included, compiled.

    Same meaning as `PinocchioDynamics`; inputs are not checked beyond their type. Each instance owns its work space;
    two threads must not share one.

    Attributes:
        tables: What the recursions read.
        space: What they write.

    Args:
        arm: The arm.
        states: Number of random states at which it is compared.

    Raises:
        UnsupportedJointError: A joint that the tables do not support (mimic, screw).
        ModelError: At one of some random states the results are not Pinocchio's.
    """

    def __init__(self, arm: ArmModel, states: int = STATES) -> None:
        known = _AGREED.get(arm)
        self.tables = arm_tables(arm) if known is None else known
        self.space = workspace(arm.nv)
        self._kernels = kernels()
        if known is None:
            self._check(arm, states)
            _AGREED[arm] = self.tables

    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> Array:
        """M a + bias by one RNEA, shape (nv,)."""
        tau = np.empty(len(v))
        self._kernels.inverse_dynamics(self.tables, self.space, q, v, a, tau)
        return tau

    def forward_dynamics(self, q: Array, v: Array, torque: Array) -> Array:
        """Acceleration under the sum of all joint torques, by ABA, shape (nv,)."""
        a = np.empty(len(v))
        self._kernels.forward_dynamics(self.tables, self.space, q, v, torque, a)
        return a

    def mass_matrix(self, q: Array) -> Array:
        """M(q) with the armature on its diagonal, by CRBA, shape (nv, nv)."""
        M = np.empty((len(self.tables.joints),) * 2)
        self._kernels.mass_matrix(self.tables, self.space, q, M)
        return M

    def _check(self, arm: ArmModel, states: int) -> None:
        judge = arm.raw_dynamics
        for step, v, a, tau in _random_states(arm.nv, states):
            q = judge.integrate(arm.neutral, step)
            pairs = {
                "RNEA": (self.inverse_dynamics(q, v, a), judge.inverse_dynamics(q, v, a)),
                "ABA": (self.forward_dynamics(q, v, tau), judge.forward_dynamics(q, v, tau)),
                "CRBA": (self.mass_matrix(q), judge.mass_matrix(q)),
            }
            for name, (mine, truth) in pairs.items():
                difference = np.abs(mine - truth).max() / np.abs(truth).max()
                if not difference <= AGREEMENT:
                    raise ModelError(
                        f"compiled {name} of '{arm.name}' differs from Pinocchio's by {difference:.1e} (relative), "
                        f'more than {AGREEMENT:g}; use backend="pinocchio"'
                    )


@functools.lru_cache(maxsize=64)
def _random_states(nv: int, states: int) -> list[Array]:
    """Steps from neutral, velocities, accelerations and torques, each of shape (4, nv)."""
    rng, found = np.random.default_rng(1), []
    for _ in range(states):
        found.append(np.array([rng.uniform(-1.0, 1.0, nv), *rng.normal(size=(3, nv))]))
    return found


class DynamicsKernels(NamedTuple):
    """Compiled entry points, each called with `ArmTables`, `Workspace`, and then its own arguments."""

    inverse_dynamics: Callable[..., Any]
    forward_dynamics: Callable[..., Any]
    mass_matrix: Callable[..., Any]


@functools.cache
def kernels() -> DynamicsKernels:
    """Compile the entry points, or load them from the disk."""
    return DynamicsKernels(
        kernel(_inverse_dynamics, (ARM, SPACE, VECTOR_IN, VECTOR_IN, VECTOR_IN, OWN_VECTOR)),
        kernel(_forward_dynamics, (ARM, SPACE, VECTOR_IN, VECTOR_IN, VECTOR_IN, OWN_VECTOR)),
        kernel(_mass_matrix, (ARM, SPACE, VECTOR_IN, OWN_MATRIX)),
    )


def _inverse_dynamics(
    arm: ArmTables, space: Workspace, q: Array, v: Array, a: Array, tau: Array
) -> int:
    place_joints(arm, space, q)
    rigid_body.inverse_dynamics(arm, space, v, a, tau)
    for j in range(len(v)):
        tau[j] += friction(arm.joints, j, v[j])
    return 0


def _forward_dynamics(
    arm: ArmTables, space: Workspace, q: Array, v: Array, torque: Array, a: Array
) -> int:
    place_joints(arm, space, q)
    for j in range(len(v)):
        a[j] = torque[j] - friction(arm.joints, j, v[j])
    rigid_body.forward_dynamics(arm, space, v, a, a)
    return 0


def _mass_matrix(arm: ArmTables, space: Workspace, q: Array, M: Array) -> int:
    place_joints(arm, space, q)
    rigid_body.mass_matrix(arm, space, M)
    return 0
