"""A log in the terms of an arm, as observers and identification take it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._common.arrays import Array
from ..exceptions import LogError
from ..robot.arm_model import ArmModel
from ..robot.rigid_bodies import movable_joints
from ..trajectories.reference import integrate_each
from .findings import LogFinding
from .samples import Samples, to_seconds

_OTHER_UNIT = 3.0  # times the middle of the range to a limit: no joint stands there
_TURNS = 4.0 * np.pi  # beyond the limits by more than this is no multi-turn count either


@dataclass(frozen=True, eq=False)
class ArmLog:
    """A log in the terms of an arm.

    Attributes:
        t: Times from the first sample on, shape (N,) [s].
        q: Configurations, shape (N, nq).
        v: Velocities, shape (N, nv) [rad/s or m/s]; differences of positions where they were not measured.
        tau: Motor torques, shape (N, nv) [N·m or N], or None where they were not measured.
        tau_ext: Torques of the environment, shape (N, nv) [N·m or N], or None.
        wrench: Wrench at the tool, shape (N, 6) [N, N·m], or None.
        findings: What was found in the log.
        source: Where it is from.
    """

    t: Array
    q: Array
    v: Array
    tau: Array | None
    tau_ext: Array | None
    wrench: Array | None
    findings: tuple[LogFinding, ...]
    source: str


def on_arm(
    samples: Samples, arm: ArmModel, findings: tuple[LogFinding, ...], source: str
) -> ArmLog:
    """Return samples, whose joints are the arm's in its order, in the terms of the arm.

    Raises:
        LogError: Positions must be in another unit.
    """
    found = list(findings)
    found += _limits(samples, arm, source)
    t: Array = to_seconds(samples.stamps - samples.stamps[0])
    v = samples.velocity
    if v is None:
        v = np.gradient(samples.position, t, axis=0)
        found.append(
            LogFinding("missing", "velocity is the central difference of positions: noisy")
        )
    return ArmLog(
        t=t,
        q=integrate_each(arm, arm.zero[None], samples.position),
        v=v,
        tau=samples.effort,
        tau_ext=samples.external,
        wrench=samples.wrench,
        findings=tuple(found),
        source=source,
    )


def positions(arm: ArmModel, q: Array) -> Array:
    """Return configurations as joint positions, shape (N, nv) [rad or m]; continuous joints count their turns.

    Args:
        arm: The arm.
        q: Configurations, shape (N, nq).
    """
    model = arm.raw_dynamics.model
    columns = []
    for j in movable_joints(model):
        i, joint = model.joints[j].idx_q, model.joints[j]
        columns.append(np.unwrap(np.arctan2(q[:, i + 1], q[:, i])) if joint.nq == 2 else q[:, i])
    return np.stack(columns, axis=1)


def _limits(samples: Samples, arm: ArmModel, source: str) -> list[LogFinding]:
    lower, upper = arm.joint_limits()
    with np.errstate(invalid="ignore"):
        beyond = np.maximum(
            samples.position.max(axis=0) - upper, lower - samples.position.min(axis=0)
        )
        middle, half = (lower + upper) / 2.0, (upper - lower) / 2.0
        far = np.abs(samples.position - middle).max(axis=0) > _OTHER_UNIT * half
    if (far & (beyond > _TURNS)).any():
        joint = int(np.argmax(far))
        raise LogError(
            source,
            f"joint '{arm.joint_names[joint]}' is {beyond[joint]:.3g} beyond its position limit",
            'positions are in rad or m; give unit="deg" where the file has degrees',
        )
    return [
        LogFinding(
            "limit",
            f"joint '{arm.joint_names[i]}' is up to {beyond[i]:.3g} {arm.position_units[i]} beyond its limit",
        )
        for i in np.flatnonzero(beyond > 0.0)
    ]
