"""The super-twisting law of a scalar in closed form and by integration; NumPy only.

    ds/dt = -k1·abs(s)^½·sgn(s) + z,    dz/dt = -k2·sgn(s) - dΔ/dt

as it stands, with de1/dt = s - φ(e1) beside it: nothing of the Lyapunov analysis is in here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rate = Callable[[Array, Array, Array], Array]
"""dΔ/dt as a share of d_max, from the time, abs(s)^½·sgn(s) and z, each of shape (count,)."""


class Laws(NamedTuple):
    """Random laws and starts, each of shape (count,)."""

    k1: Array
    k2: Array
    d_max: Array
    s0: Array
    disturbance0: Array


class Reaching(NamedTuple):
    """When s = z = 0 was reached, and the largest abs(s), each of shape (count,)."""

    time: Array
    s_peak: Array


class Settling(NamedTuple):
    """When abs(e1) was last above the tolerance, and its largest value, each of shape (count,)."""

    time: Array
    e1_peak: Array


def peak_gain(k1: Array, k2: Array) -> Array:
    """Largest abs(½/((jω)² + k1·jω/2 + k2/2)) over ω, by golden-section search on a frequency grid."""
    omega = np.sqrt(k2 / 2.0)[:, None] * np.concatenate([[0.0], np.geomspace(1e-3, 3.0, 400)])

    def gain(frequency: Array) -> Array:
        s = 1j * frequency
        magnitude: Array = np.abs(0.5 / (s**2 + k1[:, None] * s / 2.0 + k2[:, None] / 2.0))
        return magnitude

    best = np.argmax(gain(omega), axis=1)
    rows = np.arange(k1.size)
    low = omega[rows, np.maximum(best - 1, 0)][:, None]
    high = omega[rows, np.minimum(best + 1, omega.shape[1] - 1)][:, None]
    golden = (np.sqrt(5.0) - 1.0) / 2.0
    for _ in range(60):
        left, right = high - golden * (high - low), low + golden * (high - low)
        rising = gain(left) < gain(right)
        low, high = np.where(rising, left, low), np.where(rising, high, right)
    return np.maximum(gain(low), gain(omega[:, :1]))[:, 0]


def random_laws(rng: np.random.Generator, count: int) -> Laws:
    """Gains of damping ratio 0.2 to 2, d_max from 0 to 90 % of what they bear, any start."""
    k2 = np.exp(rng.uniform(np.log(1.0), np.log(1000.0), count))
    k1 = rng.uniform(0.2, 2.0, count) * 2.0 * np.sqrt(2.0 * k2)
    d_max = rng.uniform(0.0, 0.9, count) / peak_gain(k1, k2)
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    size = np.exp(rng.uniform(np.log(0.1), np.log(3.0), count))
    x1 = size * np.cos(angle)
    return Laws(k1, k2, d_max, x1 * np.abs(x1), np.sqrt(2.0 * k2) * size * np.sin(angle))


def exact_reaching_time(laws: Laws) -> Array:
    """Reaching time from s = 0 with a constant disturbance.

    abs(dz/dt) = k2 makes it the length of z's path over k2. In the time σ with dt = abs(s)^½·dσ the
    law is linear with damping ratio ζ: s keeps its sign if ζ ≥ 1, else z arrives at each next zero
    of s with the opposite sign and smaller by exp(-πζ/√(1 - ζ²)).
    """
    zeta = np.minimum(laws.k1 / np.sqrt(8.0 * laws.k2), 1.0 - 1e-12)
    shrink = np.exp(-np.pi * zeta / np.sqrt(1.0 - zeta**2))
    time: Array = np.abs(laws.disturbance0) / laws.k2 * (1.0 + shrink) / (1.0 - shrink)
    return time


def disturbances(rng: np.random.Generator, laws: Laws) -> dict[str, Rate]:
    """Sine, square and random rates, and one that decides by a line through the plane of s and z.

    Among the last are those that fight k2 all the time, that drive z outwards, and worse.
    """
    count = laws.k1.size
    unit = np.sqrt(np.abs(laws.s0) + laws.disturbance0**2 / (2.0 * laws.k2)) / np.sqrt(laws.k2)
    angular = rng.uniform(0.5, 50.0, count) / unit
    phase = rng.uniform(0.0, 2.0 * np.pi, count)
    levels = rng.uniform(-1.0, 1.0, (64, count))
    slope = np.sqrt(2.0 * laws.k2) * np.tan(rng.uniform(-1.5, 1.5, count))
    columns = np.arange(count)

    def sine(time: Array, x1: Array, z: Array) -> Array:
        del x1, z
        share: Array = np.sin(angular * time + phase)
        return share

    def random(time: Array, x1: Array, z: Array) -> Array:
        del x1, z
        return levels[np.asarray(10.0 * time / unit, dtype=np.int64) % 64, columns]

    def worst_sign(time: Array, x1: Array, z: Array) -> Array:
        del time
        share: Array = -np.sign(z + slope * x1)
        return share

    return {
        "sine": sine,
        "square": lambda time, x1, z: np.sign(sine(time, x1, z)),
        "random": random,
        "worst-sign": worst_sign,
    }


def measure_reaching(laws: Laws, rate: Rate, step: float = 0.05) -> Reaching:
    """Measure reaching times in the time σ, dt = abs(s)^½·dσ, in which s = z = 0 lies at infinity.

    The right-hand side is smooth there, the fourth-order Runge-Kutta method keeps its accuracy down
    to the origin, and t(∞) is the reaching time: no band around zero blurs it. Runs stop at one
    ten-thousandth of the size of the start, and t is short by about as much.
    """
    k1, k2, d_max, s0, disturbance0 = laws
    h = step / np.sqrt(k2 / 2.0) / np.maximum(1.0, k1 / np.sqrt(8.0 * k2))
    x = np.stack([np.sign(s0) * np.sqrt(np.abs(s0)), -disturbance0, np.zeros_like(s0)])
    scale = np.array([np.ones_like(k2), 1.0 / np.sqrt(2.0 * k2)])

    def derivative(x: Array) -> Array:
        x1, z, time = x
        x1_rate = (-k1 * x1 + z) / 2.0
        z_rate = -k2 * x1 - np.abs(x1) * d_max * rate(time, x1, z)
        return np.stack([x1_rate, z_rate, np.abs(x1)])

    start = np.hypot(*(scale * x[:2]))
    s_peak = x[0] ** 2
    while np.any(np.hypot(*(scale * x[:2])) > 1e-4 * start):
        a = derivative(x)
        b = derivative(x + h / 2.0 * a)
        c = derivative(x + h / 2.0 * b)
        x = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + derivative(x + h * c))
        s_peak = np.maximum(s_peak, x[0] ** 2)
    return Reaching(x[2], s_peak)


def measure_settling(
    laws: Laws,
    rate: Rate,
    phi: Callable[[Array], Array],
    e0: Array,
    tolerance: float,
    horizon: Array,
    steps: int = 20_000,
) -> Settling:
    """Integrate s, z and de1/dt = s - φ(e1) by Euler steps, each run to its own horizon."""
    k1, k2, d_max, s, disturbance0 = laws
    z, e1, h = -disturbance0, e0, horizon / steps
    settling, e1_peak = np.zeros_like(s), np.abs(e1)
    for step in range(1, steps + 1):
        x1 = np.sign(s) * np.sqrt(np.abs(s))
        slope = d_max * rate((step - 1) * h, x1, z)
        e1 = e1 + h * (s - phi(e1))
        s, z = s + h * (z - k1 * x1), z - h * (k2 * np.sign(s) + slope)
        settling = np.where(np.abs(e1) > tolerance, step * h, settling)
        e1_peak = np.maximum(e1_peak, np.abs(e1))
    return Settling(settling, e1_peak)
