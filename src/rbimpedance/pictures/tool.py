"""What pictures show of a run at the tool: both frames, and how compliant the target is in which direction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from .._common.arrays import Array
from ..simulation.result import SimulationResult


class Compliance(NamedTuple):
    """The compliance of a target impedance in translation, as an ellipsoid.

    Attributes:
        axes: Its principal axes as columns, in world axes, or in those of the reference, shape (3, 3).
        sizes: Compliance along them, shape (3,) [m/N].
        turns: Whether the axes are those of the reference.
    """

    axes: Array
    sizes: Array
    turns: bool

    def rotation(self, reference: Array) -> Array:
        """Return the principal axes as columns in world axes, shape (3, 3).

        Args:
            reference: Axes of the reference, shape (3, 3).
        """
        rotation: Array = reference @ self.axes if self.turns else self.axes
        return rotation


def compliance_of(result: SimulationResult) -> Compliance | None:
    """Return the compliance of the target of a run at the tool; None where its controller does not say one.

    Args:
        result: The run, also one from a file.
    """
    target = _target(result.provenance["controller"])
    if target is None:
        return None
    K = np.array(target["stiffness"], dtype=np.float64)
    K = np.diag(K[:3]) if K.ndim == 1 else K[:3, :3]
    sizes, axes = np.linalg.eigh(np.linalg.inv(K))
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] = -axes[:, 0]
    given = target["axes"]
    turn = np.eye(3) if isinstance(given, str) else np.array(given)
    return Compliance(turn @ axes, sizes, turns=given == "reference")


def poses_of(result: SimulationResult, k: int, compliance: Compliance | None) -> Array | None:
    """Return the poses of tool, reference and compliance at a sample; None for a run without `tool`.

    Args:
        result: The run.
        k: Number of the sample.
        compliance: Of its target.

    Returns:
        x, y, z [m] and the quaternion x, y, z, w of each, shape (3, 7).
    """
    log = result.tool
    if log is None:
        return None
    R_r, p_r = log.rotation_r[k], log.position_r[k]
    R_k = R_r if compliance is None else compliance.rotation(R_r)
    pairs = (log.rotation[k], log.position[k]), (R_r, p_r), (R_k, p_r)
    return np.array([pin.SE3ToXYZQUAT(pin.SE3(*pair)) for pair in pairs])


def _target(controller: Any) -> Mapping[str, Any] | None:
    """The impedance with axes, of the controller or of the one that it wraps."""
    while isinstance(controller, Mapping):
        impedance = controller.get("impedance")
        if isinstance(impedance, Mapping) and "axes" in impedance:
            return impedance
        controller = controller.get("controller")
    return None
