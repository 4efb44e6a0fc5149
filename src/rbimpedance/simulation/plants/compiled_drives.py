"""Steps of an arm behind drives by compiled code, where its joints are rigid."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any

import numpy as np

from ..._common.arrays import Array
from ..._common.pool import Pool
from ...control.backends import is_available
from ...exceptions import UnsupportedJointError
from ...law.lag import lag_of
from .protocol import SPEED_BOUND
from .rigid import RigidPlant
from .sticking import StickingPlant


def compiled_step(plant: Any, h: float) -> Step | None:
    """Return the step of a `DrivenPlant`; None where it has no compiled form.

    Args:
        plant: The plant.
        h: Length of the step [s].
    """
    known = _STEPS.setdefault(plant, {})
    if h not in known:
        known[h] = _new_step(plant, h)
    return known[h]


def can_compile(plant: Any) -> bool:
    """Whether a `DrivenPlant` has a compiled form: rigid joints, and friction that sticks or none.

    Args:
        plant: The plant.
    """
    links, arm = plant.links, plant.arm
    smooth = isinstance(links, RigidPlant) and (
        links.integrator != "semi-implicit" or bool(arm.viscous.any() or arm.coulomb.any())
    )
    known = isinstance(links, RigidPlant | StickingPlant)
    return known and not smooth and not plant.elastic.any() and is_available("compiled")


def drive_tables(
    plant: Any, h: float, count: Array | None = None, target: Array | None = None
) -> Any:
    """Return a `DrivenPlant` as tables.

    Args:
        plant: One that `can_compile`.
        h: Length of a step [s].
        count: Of the encoders, shape (nv,); None for exact ones [rad or m].
        target: Diagonals of M_d, D_d and K_d for e_im, shape (3, nv); None where it is not wanted.

    Raises:
        UnsupportedJointError: A joint that the tables do not support.
        ModelError: The compiled dynamics of the arm are not Pinocchio's.
    """
    from ...robot.compiled.dynamics import CompiledDynamics  # noqa: PLC0415 (Numba is loaded when needed)
    from ..compiled.driven import DriveTables  # noqa: PLC0415

    arm, links = plant.arm, plant.links
    joints = np.array(
        [
            *lag_of(plant.time_constant, h),
            *(plant.ripple, plant.cogging, plant.ripple_periods, arm.coulomb, arm.viscous),
        ]
    )
    free = CompiledDynamics(arm.with_friction(0.0, 0.0)).tables
    rise = links.stribeck if isinstance(links, StickingPlant) else 0.0
    return DriveTables(
        free,
        joints,
        np.array(arm.neutral),
        np.zeros(arm.nv) if count is None else np.array(count),
        np.zeros((3, arm.nv)) if target is None else target,
        np.array([h, rise, SPEED_BOUND]),
    )


class Step:
    """One kernel; threads may share it.

    Args:
        tables: From `drive_tables`.
        nq: Entries of a configuration.
        nv: Joints.
    """

    def __init__(self, tables: Any, nq: int, nv: int) -> None:
        from ..._numba.layouts.tables import hold  # noqa: PLC0415 (Numba is loaded when needed)
        from ..compiled.driven import DriveWords, drive_space, step_kernel  # noqa: PLC0415

        self._kernel: Callable[..., int] = step_kernel()
        self._free = Pool(lambda: hold(DriveWords(tables, drive_space(nq, nv))))

    def __call__(
        self, tau: Array, tau_ext: Array, q: Array, v: Array, torque: Array, pending: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Return q, v, the motors' torque and the torques on their way after a step.

        Args:
            tau: Torque that is sent, shape (nv,) [N·m or N].
            tau_ext: Of the environment, shape (nv,) [N·m or N].
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,) [rad/s or m/s].
            torque: Of the motors, shape (nv,) [N·m or N].
            pending: On their way, shape (·, nv) [N·m or N].
        """
        after = q.copy(), v.copy(), torque.copy(), pending.copy()
        words = self._free.take()
        try:
            self._kernel(words, tau, tau_ext, *after)
        finally:
            self._free.append(words)
        return after


def _new_step(plant: Any, h: float) -> Step | None:
    if not can_compile(plant):
        return None
    try:
        return Step(drive_tables(plant, h), plant.arm.nq, plant.arm.nv)
    except UnsupportedJointError:
        return None


_STEPS: weakref.WeakKeyDictionary[Any, dict[float, Step | None]] = weakref.WeakKeyDictionary()
