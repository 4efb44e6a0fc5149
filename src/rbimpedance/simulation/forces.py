"""External forces on the arm of a run, so that its wrenches can be computed afterwards."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._common.arrays import Array
from ..interaction import FrameInteraction, Interaction
from ..interaction.wrenches import JointTorque, Nothing, says_where, wrench_at
from ..robot.arm_model import ArmModel
from ..trajectories.limits import joint_positions
from .joint_stops import JointStops


@dataclass(frozen=True, eq=False)
class Forces:
    """What pushed on the arm.

    Attributes:
        environment: The environment.
        stops: Stops of the joints; None for none.
    """

    environment: Interaction
    stops: JointStops | None = None

    def wrench(self, arm: ArmModel, t: Array, q: Array, v: Array) -> Array:
        """Return the wrench at the tool frame along a motion, shape (N, 6); see `SimulationResult.wrench`."""
        environment = self.environment
        if not says_where(environment):
            return np.full((len(t), 6), np.nan)
        if isinstance(environment, JointTorque | Nothing) or not isinstance(
            environment, FrameInteraction
        ):
            return np.zeros((len(t), 6))
        rows = zip(t.tolist(), q, v, strict=True)
        acting = ((environment.wrenches(arm, *row), row[1]) for row in rows)
        return np.array([wrench_at(arm, None, wrenches, q) for wrenches, q in acting])

    def tau_stop(self, arm: ArmModel, q: Array, v: Array) -> Array:
        """Return the torque of the stops along a motion, shape (N, nv)."""
        if self.stops is None:
            return np.zeros_like(v)
        positions = q if arm.nq == arm.nv else np.array([joint_positions(arm, row) for row in q])
        return self.stops.torques(positions, v)
