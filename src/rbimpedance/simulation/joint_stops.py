"""Stops at the position limits of a simulated arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._common.arrays import Array
from .._common.brief import brief_repr
from ..robot.arm_model import ArmModel
from ..trajectories.limits import joint_positions

FREQUENCY = 500.0
"""Natural frequency of a joint on its stop [rad/s]: 1 rad/s is stopped within about 2 mrad."""

STEP_SHARE = 0.2
"""Largest natural frequency times physics step, far from where the integrators become unstable."""

DAMPING_RATIO = 0.5

_POSTURES = 16  # at which effective inertias are compared


@brief_repr()
@dataclass(frozen=True, eq=False)
class JointStops:
    """A stiff spring and damper at every position limit, that push back and never pull.

    Where a joint is δ beyond its limit, it feels max(0, k·δ + d·δ̇) back towards its range. k and d follow from the
    natural frequency and the damping ratio of the joint alone on its stop, by the smallest effective inertia
    1/(M⁻¹)_jj that it has at a number of postures: a step of the physics is stable also with all joints on their stops.
    Stops are part of the arm: no sensor measures them, `tau_ext` is without them.

    Attributes:
        lower: Position limits, shape (nv,) [rad or m]; -inf where there is none.
        upper: Position limits, shape (nv,) [rad or m]; inf where there is none.
        stiffness: k, shape (nv,) [N·m/rad or N/m].
        damping: d, shape (nv,) [N·m·s/rad or N·s/m].
    """

    lower: Array
    upper: Array
    stiffness: Array
    damping: Array

    @classmethod
    def at_limits(cls, arm: ArmModel, h: float) -> JointStops:
        """Return the stops of an arm.

        Args:
            arm: The simulated arm.
            h: Physics step [s]; stops are softer where it is longer than 0.4 ms.
        """
        inertia, frequency = _effective_inertia(arm), min(FREQUENCY, STEP_SHARE / h)
        return cls(
            *arm.joint_limits(),
            stiffness=inertia * frequency**2,
            damping=2.0 * DAMPING_RATIO * inertia * frequency,
        )

    def torque(self, arm: ArmModel, t: float, q: Array, v: Array) -> Array:
        """Return what the stops do to the joints, shape (nv,); see `Interaction.torque`."""
        del t
        return self.torques(joint_positions(arm, q), v)

    def torques(self, positions: Array, v: Array) -> Array:
        """Return the torques at one or many states, of the shape of v.

        Args:
            positions: One number per joint [rad or m].
            v: Velocities [rad/s or m/s].
        """
        above, below = positions - self.upper, self.lower - positions
        push = self._push(below, -v) - self._push(above, v)
        return np.asarray(push)

    def _push(self, depth: Array, rate: Array) -> Array:
        inside = depth <= 0.0
        size = np.maximum(0.0, self.stiffness * np.where(inside, 0.0, depth) + self.damping * rate)
        push: Array = np.where(inside, 0.0, size)
        return push


def _effective_inertia(arm: ArmModel) -> Array:
    """The smallest 1/(M⁻¹)_jj at some postures, shape (nv,) [kg·m² or kg]."""
    rng = np.random.default_rng(0)
    postures = [arm.ready, *(arm.random_configuration(rng) for _ in range(_POSTURES))]
    mobility = [np.diag(np.linalg.inv(arm.mass_matrix(q))) for q in postures]
    inertia: Array = 1.0 / np.max(mobility, axis=0)
    return inertia
