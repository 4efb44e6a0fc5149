"""One run, and its figures."""

from __future__ import annotations

from typing import Any

import numpy as np

import rbimpedance as rbi
from benchmarks.arms import Array
from rbimpedance.control.cartesian_base import CartesianControllerBase, ToolMeasured

from .task import DURATION, FREE, LAWS, UNDER_PUSH, Circle, case, push

NOISE = (1e-5, 1e-3, 0.1)
"""Standard deviations of noise on q [rad], v [rad/s] and the force [N]; a twentieth of the last on the moment."""


class Noisy(CartesianControllerBase[Any]):
    """A controller at the tool whose measurements are noisy, the same at every run."""

    def __init__(self, inside: CartesianControllerBase[Any]) -> None:
        self.__dict__.update(vars(inside) | {"inside": inside})

    @property
    def _target(self) -> Any:
        return self.__dict__["inside"]._target

    def init(self) -> Any:
        """Return the state before the first tick."""
        return self.__dict__["inside"].init()

    def _step(self, state: Any, given: ToolMeasured) -> Any:
        rng = np.random.default_rng(state.ticks)
        on_q, on_v, on_force = NOISE
        q = self.arm.integrate(given.q, on_q * rng.standard_normal(self.arm.nv))
        v = given.v + on_v * rng.standard_normal(self.arm.nv)
        wrench = given.wrench + on_force * rng.standard_normal(6) * np.repeat([1.0, 0.05], 3)
        return self.__dict__["inside"].step(state, q, v, given.desired, wrench)

    def _elapsed(self, state: Any, period: float) -> Any:
        return self.__dict__["inside"].elapsed(state, period)


def measured(robot: str, law: str, *, noisy: bool = False) -> dict[str, Any]:
    """Run one law on one arm."""
    arm, q, _ = setting = case(robot)
    controller, plant = LAWS[law](setting), setting.plant()
    start = rbi.Pose(*arm.frame_placement(q))
    row: dict[str, Any] = {"robot": robot, "law": law, "noisy": noisy}
    try:
        result = rbi.simulate(
            Noisy(controller) if noisy else controller,
            plant,
            Circle(start),
            environment=push,
            q0=q,
            duration=DURATION,
            substeps=2,
            integrator="rk4",  # semi-implicit Euler adds about 1e-6 m and 5e-6 rad of its own
        )
    except rbi.DivergenceError as error:
        return row | {"diverged": error.time}
    return row | figures(result, plant)


def first_torque(law: str, away: float) -> float:
    """Largest torque beyond gravity's at the first tick of a panda whose tool is that far from its reference [N·m]."""
    setting = case("panda")
    arm, q, _ = setting
    controller, still = LAWS[law](setting), np.zeros(arm.nv)
    R, p = arm.frame_placement(q)
    pose = rbi.Pose(R, p + np.array([0.0, away, 0.0]))
    far = rbi.CartesianReference(pose, np.zeros(6), np.zeros(6))
    output, _ = controller.step(controller.init(), q, still, far, np.zeros(6))
    return float(np.abs(output.tau - arm.bias(q, still)).max())


def figures(result: rbi.SimulationResult, plant: rbi.ArmModel) -> dict[str, Any]:
    """Deviations from x_r, and the torque's variation over what the motion needs.

    With noise the true deviation counts: the pose of the plant from the reference.
    """
    log = result.tool
    assert log is not None
    position = np.linalg.norm(log.position_r - true_positions(result, plant), axis=1)
    rotation = np.linalg.norm(log.e1[:, 3:], axis=1)
    free, pushed = ((result.t >= a) & (result.t < b) for a, b in (FREE, UNDER_PUSH))
    need = needed_torque(result, plant)
    return {
        "free_position": position[free].max(),
        "free_rotation": rotation[free].max(),
        "free_position_rms": np.sqrt(np.mean(position[free] ** 2)),
        "push_position": position[pushed].max(),
        "push_rotation": rotation[pushed].max(),
        "variation": variation(result.tau[free], result.t[free]),
        "variation_needed": variation(need[free], result.t[free]),
        "peak": np.abs(result.tau).max(),
    }


def true_positions(result: rbi.SimulationResult, plant: rbi.ArmModel) -> Array:
    """Origins of the tool, shape (N, 3)."""
    return np.array([plant.frame_placement(q)[1] for q in result.q])


def needed_torque(result: rbi.SimulationResult, plant: rbi.ArmModel) -> Array:
    """Torque of the motion that took place, by the plant's inverse dynamics, shape (N, nv)."""
    a = np.gradient(result.v, result.t, axis=0)
    rows = zip(result.q, result.v, a, strict=True)
    return np.array([plant.inverse_dynamics(*row) for row in rows])


def variation(tau: Array, t: Array) -> float:
    """Total variation of all torques in a second [N·m/s]."""
    return float(np.abs(np.diff(tau, axis=0)).sum() / (t[-1] - t[0]))
