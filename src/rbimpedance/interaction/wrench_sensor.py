"""A six-axis force sensor in the wrist: bias, the tool's weight, a low-pass, and how to find the first two."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, size, vector
from .._common.brief import brief_repr
from .._common.frozen import set_fields
from ..exceptions import DimensionError, ParameterError
from ..robot.arm_model import ArmModel
from .sensors import LowPass
from .wrenches import FrameInteraction, wrench_at


class WristState(NamedTuple):
    """What a simulated wrist sensor remembers.

    Attributes:
        ticks: Number of ticks so far.
        wrench: Filtered wrench in the sensor's axes, shape (6,), or None before the first tick.
    """

    ticks: int
    wrench: Array | None


@brief_repr("arm", "frame", "tool_mass", "tool_com", "low_pass")
@dataclass(frozen=True, eq=False, init=False)
class WrenchSensor:
    """A six-axis sensor in the wrist, and what to do with its readings before a controller may use them.

    A reading is the wrench on the sensor's frame in its own axes: the contact's, plus the weight of the tool beyond the
    sensor, plus a bias. `torque` takes off bias and weight and returns Jᵀ w. The tool's inertia forces are not taken
    off: moving with acceleration a, it reads m·a more.

    Attributes:
        arm: The arm, the tool's mass included.
        frame: Frame of the sensor; the arm's tool frame by default.
        tool_mass: Mass beyond the sensor [kg].
        tool_com: Its centre in the sensor's axes, shape (3,) [m].
        bias: What the sensor reads with nothing on it, shape (6,) [N, N·m].
        low_pass: Filter on the wrench in the sensor's axes, or None; its `phase_loss` is what contact pays for it.

    Raises:
        ParameterError: A negative tool mass.
        DimensionError: A centre or a bias of wrong shape or kind.
        NonFiniteError: One that holds NaN or infinity.
        ModelError: No such frame.
    """

    arm: ArmModel
    frame: str
    tool_mass: float
    tool_com: Array
    bias: Array
    low_pass: LowPass | None
    _gravity: Array

    def __init__(
        self,
        arm: ArmModel,
        frame: str | None = None,
        *,
        tool_mass: float = 0.0,
        tool_com: ArrayLike = (0.0, 0.0, 0.0),
        bias: ArrayLike = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        low_pass: LowPass | None = None,
    ) -> None:
        arm.frame_placement(arm.neutral, frame)  # raises where there is no such frame
        set_fields(
            self,
            arm=arm,
            frame=frame or arm.tool_frame,
            tool_mass=size("tool_mass", tool_mass),
            tool_com=vector("tool_com", tool_com, 3, "x, y, z").copy(),
            bias=vector("bias", bias, 6, "force, moment").copy(),
            low_pass=low_pass,
            _gravity=np.array(arm.model.gravity.linear),
        )

    def weight(self, q: ArrayLike) -> Array:
        """Return the tool's weight as the sensor reads it, in its own axes, shape (6,) [N, N·m].

        Args:
            q: Configuration, shape (nq,).
        """
        rotation, _ = self.arm.frame_placement(q, self.frame)
        force = self.tool_mass * rotation.T @ self._gravity
        return np.concatenate([force, np.cross(self.tool_com, force)])

    def reading(self, q: ArrayLike, wrench: ArrayLike) -> Array:
        """Return what the sensor reads while a wrench acts beyond it, shape (6,) [N, N·m].

        Args:
            q: Configuration, shape (nq,).
            wrench: Wrench of the environment at the frame's origin in world axes, shape (6,).
        """
        rotation, _ = self.arm.frame_placement(q, self.frame)
        w = vector("wrench", wrench, 6, "force, moment")
        local = np.concatenate([rotation.T @ w[:3], rotation.T @ w[3:]])
        return local + self.weight(q) + self.bias

    def contact(self, q: ArrayLike, reading: ArrayLike) -> Array:
        """Return the contact's wrench in the sensor's axes: the reading less bias and weight, shape (6,).

        Args:
            q: Configuration, shape (nq,).
            reading: What the sensor reads, shape (6,) [N, N·m].
        """
        return vector("reading", reading, 6, "force, moment") - self.bias - self.weight(q)

    def torque(
        self, state: Array | None, q: ArrayLike, reading: ArrayLike
    ) -> tuple[Array, Array | None]:
        """Turn a reading into the tau_ext that a controller takes.

        Args:
            state: None at the first tick, then what the tick before returned.
            q: Configuration, shape (nq,).
            reading: What the sensor reads, shape (6,) [N, N·m].

        Returns:
            tau_ext, shape (nv,) [N·m or N], and the filter's state.
        """
        wrench = self.contact(q, reading)
        if self.low_pass is not None:
            wrench = self.low_pass.smooth(state, wrench)
        return self.arm.external_torque(q, wrench, self.frame, "local"), wrench

    def mounted(self, contact: FrameInteraction, dt: float, *, believed: WrenchSensor) -> Mounted:
        """Return the `Sensor` for `simulate` that is this hardware, read by someone's belief about it.

        Args:
            contact: What acts beyond the sensor; what acts before it, the sensor does not feel.
            dt: Control period [s].
            believed: Bias, tool and low-pass by which the readings are processed.
        """
        return Mounted(self, contact, dt, believed)


@dataclass(frozen=True, eq=False)
class Mounted:
    """A wrench sensor on a simulated arm; made by `WrenchSensor.mounted`.

    Attributes:
        hardware: What produces the readings.
        contact: What acts beyond the sensor.
        dt: Control period [s].
        believed: How they are processed.
    """

    hardware: WrenchSensor
    contact: FrameInteraction
    dt: float
    believed: WrenchSensor

    def init(self) -> WristState:
        """Return the state before the first tick."""
        return WristState(0, None)

    def step(
        self, state: WristState, q: Array, v: Array, tau: Array, tau_ext: Array
    ) -> tuple[Array, WristState]:
        """Return Jᵀ w of the processed reading; see `Sensor.step`."""
        del tau, tau_ext
        acting = self._at_the_sensor(state.ticks * self.dt, q, v)
        told, wrench = self.believed.torque(state.wrench, q, self.hardware.reading(q, acting))
        return told, WristState(state.ticks + 1, wrench)

    def _at_the_sensor(self, t: float, q: Array, v: Array) -> Array:
        """The contact's wrenches moved to the sensor's origin, in world axes."""
        arm = self.hardware.arm
        return wrench_at(arm, self.hardware.frame, self.contact.wrenches(arm, t, q, v), q)


class ToolCalibration(NamedTuple):
    """What `calibrate_tool` found.

    Attributes:
        mass: Mass beyond the sensor [kg].
        com: Its centre in the sensor's axes, shape (3,) [m].
        bias: Reading with nothing on it, shape (6,) [N, N·m].
        residual: Root-mean-square of what the three do not explain, forces and moments apart, shape (2,) [N, N·m].
    """

    mass: float
    com: Array
    bias: Array
    residual: Array


def calibrate_tool(
    arm: ArmModel, configurations: ArrayLike, readings: ArrayLike, frame: str | None = None
) -> ToolCalibration:
    """Find tool mass, centre of mass and bias from readings at rest without contact.

    A reading is bias + (m·g, c × m·g) with g gravity in the sensor's axes: linear in bias and m, then in m·c.

    Args:
        arm: The arm.
        configurations: Poses, shape (N, nq), N ≥ 3, in which the sensor is turned differently.
        readings: What the sensor read in each, shape (N, 6) [N, N·m].
        frame: Frame of the sensor; the arm's tool frame by default.

    Raises:
        DimensionError: Not one reading for each of the poses.
        ParameterError: The poses do not separate bias and weight.
    """
    poses, measured = np.atleast_2d(configurations), np.atleast_2d(readings)
    if len(poses) != len(measured) or measured.shape[1:] != (6,):
        raise DimensionError("readings", f"shape ({len(poses)}, 6)", f"shape {measured.shape}")
    gravity = np.array(arm.model.gravity.linear)
    seen = [arm.frame_placement(q, frame)[0].T @ gravity for q in poses]
    forces = np.vstack([np.column_stack([np.eye(3), g]) for g in seen])
    moments = np.vstack([np.column_stack([np.eye(3), -_skew(g)]) for g in seen])
    by_force, lack_f = _solve(forces, measured[:, :3].ravel())
    by_moment, lack_m = _solve(moments, measured[:, 3:].ravel())
    mass, bias = float(by_force[3]), np.append(by_force[:3], by_moment[:3])
    com = by_moment[3:] / mass if mass > 0.0 else np.zeros(3)
    return ToolCalibration(mass, com, bias, np.array([lack_f, lack_m]))


def _solve(rows: Array, right: Array) -> tuple[Array, float]:
    """Least squares (bias first), and the root-mean-square residual."""
    found, _, rank, _ = np.linalg.lstsq(rows, right, rcond=1e-8)
    if rank < rows.shape[1]:
        words = "poses in which gravity, seen from the sensor, points in at least three directions"
        raise ParameterError("configurations", f"{len(rows) // 3} poses", words)
    lack = float(np.sqrt(np.mean((rows @ found - right) ** 2)))
    return np.asarray(found, dtype=np.float64), lack


def _skew(x: Array) -> Array:
    """The matrix of x × ·."""
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])
