"""What a `HardwareController` remembers: rows of numbers, so that compiled code can take them as they are."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .._common.arrays import Array
from .baseline_law import BaselineState
from .estimation.extended_state import JointEstimate
from .estimation.friction_learning import FrictionState
from .estimation.noise_gate import GateState

# Rows of `HardwareState.rows`.
V, DISTURBANCE, TORQUE = 0, 1, 2
OPENING, INNOVATION = 3, 4
PARAMETERS, NORMAL, REGRESSORS = 5, 12, 47  # 7, 35 and 24 rows
Q_E, V_E, TAU_EXT, Q_E_BEFORE, V_E_BEFORE = range(71, 76)
TAU = 76
ROWS = 77


class HardwareState(NamedTuple):
    """What the controller remembers; `observer`, `gate`, `friction` and `filter` are views of it by name.

    Attributes:
        ticks: Number of ticks so far.
        q: Configuration that the observer expects at the tick to come, shape (nq,).
        rows: Everything that has one number a joint, shape (`ROWS`, nv).
        pending: Torques that were sent and do not act yet, the oldest first, shape (delay, nv) [N·m or N].
    """

    ticks: int
    q: Array
    rows: Array
    pending: Array

    @classmethod
    def pack(
        cls,
        ticks: int,
        filter: BaselineState,
        observer: JointEstimate,
        gate: GateState,
        friction: FrictionState,
        tau: Array,
    ) -> HardwareState:
        """Return the state with these parts.

        Args:
            ticks: Number of ticks so far.
            filter: The impedance filter.
            observer: What is expected at the tick to come.
            gate: How far the bandwidth is raised.
            friction: What has been learned.
            tau: Torque of the tick before, shape (nv,) [N·m or N].
        """
        q, v, disturbance, torque, pending = observer
        rows = np.vstack([v, disturbance, torque, *gate, *friction, *filter, tau])
        return cls(ticks, q, rows, pending)

    @property
    def filter(self) -> BaselineState:
        """The impedance filter."""
        return BaselineState(*self.rows[Q_E : V_E_BEFORE + 1])

    @property
    def observer(self) -> JointEstimate:
        """What is expected at the tick to come."""
        v, disturbance, torque = self.rows[V : TORQUE + 1]
        return JointEstimate(self.q, v, disturbance, torque, self.pending)

    @property
    def gate(self) -> GateState:
        """How far the bandwidth is raised."""
        return GateState(*self.rows[OPENING : INNOVATION + 1])

    @property
    def friction(self) -> FrictionState:
        """What has been learned of friction and load."""
        return FrictionState(
            self.rows[PARAMETERS:NORMAL],
            self.rows[NORMAL:REGRESSORS],
            self.rows[REGRESSORS:Q_E],
        )

    @property
    def tau(self) -> Array:
        """Torque of the tick before, shape (nv,) [N·m or N]."""
        tau: Array = self.rows[TAU]
        return tau

    def but(self, **parts: Any) -> HardwareState:
        """Return a copy with other parts, by the names of `pack`."""
        names = "ticks", "filter", "observer", "gate", "friction", "tau"
        return self.pack(**({name: getattr(self, name) for name in names} | parts))
