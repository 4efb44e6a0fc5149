"""What linear theory says: the sampled loop about s = 0 with a whole arm behind its drives, as one matrix.

About s = 0 the matched scheme is u = (2/H)·s + W, W⁺ = W + (h/H²)·s with H = margin·h, and a surface has a slope c. The
arm is its mass matrices at one configuration, the model's with the rotors in it and the links' own; springs, torque
lag and differentiated velocities are exact, ripple and rounding are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import expm

Array = np.ndarray[Any, np.dtype[np.float64]]

ROUNDING = 1e-9
"""What a spectral radius of 1 may lose to rounding."""


@dataclass(frozen=True)
class Linear:
    """Arm and drives about a configuration, behind one law.

    Attributes:
        model: Mass matrix of the controller's model, shape (nv, nv).
        links: Mass matrix of the true links without rotors, shape (nv, nv).
        viscous: Friction on the links, shape (nv,).
        rotor: Inertia of the rotors, shape (nv,).
        stiffness: Of the springs, shape (nv,); None for rigid joints.
        damping: Of the springs, shape (nv,).
        time_constant: Of the torque [s].
        side: "motor" or "link": where the encoders are.
        is_differentiated: Whether velocities are differences of positions.
        slope: Of the surface at e1 = 0 [1/s].
        margin: Of the matched scheme.
        h: Period [s].
    """

    model: Array
    links: Array
    viscous: Array
    rotor: Array
    stiffness: Array | None
    damping: Array
    time_constant: float
    side: str
    is_differentiated: bool
    slope: float
    margin: float
    h: float

    def is_stable(self) -> bool:
        """Whether the loop is stable."""
        return self.radius() <= 1.0 + ROUNDING

    def radius(self) -> float:
        """Largest absolute eigenvalue of the loop's transition matrix."""
        A, B = self._arm()
        n, size = len(self.rotor), len(A)
        exact = expm(self.h * np.block([[A, B], [np.zeros((n, size + n))]]))
        S = np.zeros((size + 2 * n, size + 2 * n))
        S[:size, :size] = exact[:size, :size]
        law, S[size : size + n], S[size + n :] = self._law(size)
        S[:size] += exact[:size, size:] @ self.model @ law
        return float(np.abs(np.linalg.eigvals(S)).max())

    def _arm(self) -> tuple[Array, Array]:
        """ẋ = A x + B tau with x = (q, v) or (q, v, θ, θ̇), and the torque where it lags."""
        n = len(self.rotor)
        zero, one, friction = np.zeros((n, n)), np.eye(n), np.diag(self.viscous)
        if self.stiffness is None:
            inverse = np.linalg.inv(self.links + np.diag(self.rotor))
            A, B = np.block([[zero, one], [zero, -inverse @ friction]]), np.vstack([zero, inverse])
        else:
            K, D, rotor = np.diag(self.stiffness), np.diag(self.damping), np.diag(1.0 / self.rotor)
            inverse = np.linalg.inv(self.links)
            link = [-inverse @ K, -inverse @ (D + friction), inverse @ K, inverse @ D]
            motor = [rotor @ K, rotor @ D, -rotor @ K, -rotor @ D]
            A = np.block([[zero, one, zero, zero], link, [zero, zero, zero, one], motor])
            B = np.vstack([zero, zero, zero, rotor])
        if self.time_constant > 0.0:
            rate = one / self.time_constant
            A = np.block([[A, B], [np.zeros((n, len(A))), -rate]])
            B = np.vstack([np.zeros((len(A) - n, n)), rate])
        return A, B

    def _law(self, size: int) -> tuple[Array, Array, Array]:
        """Rows of the acceleration that is asked for, of W⁺ and of the position kept, over (x, W, position before)."""
        n, h, c, H = len(self.rotor), self.h, self.slope, self.margin * self.h
        first = 2 * n if self.side == "motor" and self.stiffness is not None else 0
        position, velocity, W = np.zeros((3, n, size + 2 * n))
        one = np.eye(n)
        position[:, first : first + n] = one
        W[:, size : size + n] = one
        if self.is_differentiated:
            velocity[:] = position / h
            velocity[:, size + n :] = -one / h
        else:
            velocity[:, first + n : first + 2 * n] = one
        s = -(c * position + velocity)
        law = (-c * velocity + 2.0 / H * s + W) / (1.0 + c * h / 2.0)
        return law, W + h / H**2 * s, position
