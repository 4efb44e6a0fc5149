"""Arms that are pushed: gains for them, walls, and the target impedance alone against the same wall."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import eigh

import rbimpedance as rbi
from benchmarks import arms
from benchmarks.arms import DT, Array
from rbimpedance.interaction import Wall, impedance_for_wall, recommended_mass
from rbimpedance.trajectories import Reference, Trajectory

from .common import simulate

ARMATURE = 0.1  # kg·m²
PAYLOAD = 2.0  # kg, unknown to the controller
WALL = 1e4  # N/m
SPEED = 0.2  # m/s
TOOL_STIFFNESS = 500.0  # N/m
DEPTH = 0.04  # m: how far the reference ends up in the wall
UP = np.array([0.0, 0.0, 1.0])


class Setting(NamedTuple):
    """An arm before a wall.

    Attributes:
        arm: Name of the arm.
        pose: Where it touches, shape (nq,).
    """

    arm: str
    pose: tuple[float, ...]

    @property
    def q(self) -> Array:
        """The pose as an array."""
        return np.array(self.pose)


SETTINGS = {
    "panda, middle": Setting("panda", (0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.8)),
    "panda, stretched": Setting("panda", (0.5, 0.2, 0.3, -1.8, 0.2, 2.0, 0.0)),
    "panda, folded": Setting("panda", (-0.6, -0.8, 0.4, -2.4, -0.4, 1.7, 1.0)),
    "ur5": Setting("ur5", (0.8, -0.9, 1.3, -1.9, -1.4, 0.5)),
}
"""The first one is that of the measurements with estimators and with old readings."""
FIRST = next(iter(SETTINGS))


def load(name: str) -> rbi.ArmModel:
    """An arm with rotors and without friction.

    The descriptions of z1, xarm7 and talos_arm give 1 to 10 N·m·s/rad and 1 to 2 N·m on every joint, wrists included.
    Plant and controller would share it, and the figures would be about friction compensation.
    """
    arm = arms.load(name, armature=ARMATURE, lock=arms.GRIPPERS.get(name, ()))
    return arm.with_friction(0.0, 0.0)


def heavy(arm: rbi.ArmModel) -> rbi.ArmModel:
    """The arm with links 10 % heavier and the payload."""
    return arm.with_scaled_inertia(1.1).with_payload(PAYLOAD)


def at_wall(
    setting: Setting, seed: int, mass: float | None = None, damping_ratio: float = 1.0
) -> tuple[rbi.ArmModel, rbi.Impedance, Wall, rbi.SuperTwisting]:
    """Arm, impedance (the recommended one unless a mass is given), wall and gains."""
    arm, q = load(setting.arm), setting.q
    mass = recommended_mass(WALL, TOOL_STIFFNESS, DT) if mass is None else mass
    impedance = impedance_for_wall(
        arm,
        q,
        UP,
        mass=mass,
        stiffness=TOOL_STIFFNESS,
        wall_stiffness=WALL,
        damping_ratio=damping_ratio,
    )
    wall = Wall(arm.frame_placement(q)[1], UP, WALL)
    return arm, impedance, wall, recipe(arm, [arm, heavy(arm)], q, seed)


def recipe(
    model: rbi.ArmModel, plants: list[rbi.ArmModel], center: Array, seed: int
) -> rbi.SuperTwisting:
    """Gains for an arm that is pushed: k2 = 3·tau/m and k1 = 2.2·√(k2·ρ).

    tau is the largest torque mismatch of a joint (at least 0.5 N·m) and m its smallest inertia 1/(M⁻¹)ᵢᵢ over sampled
    motions with abs(v) ≤ 1 rad/s and abs(a) ≤ 8 rad/s², as the pushes here cause them; ρ bounds the eigenvalues of
    M_true⁻¹·M_model and their inverses.
    """
    rng = np.random.default_rng(seed)
    mismatch, inertia, rho = np.full(model.nv, 0.5), np.full(model.nv, np.inf), 1.0
    for plant in plants:
        for _ in range(200):
            q = model.integrate(center, 0.3 * rng.uniform(-1.0, 1.0, model.nv))
            v, a = rng.uniform(-1.0, 1.0, model.nv), 8.0 * rng.uniform(-1.0, 1.0, model.nv)
            lack = plant.inverse_dynamics(q, v, a) - model.inverse_dynamics(q, v, a)
            mismatch = np.maximum(mismatch, np.abs(lack))
            true, known = plant.mass_matrix(q), model.mass_matrix(q)
            inertia = np.minimum(inertia, 1.0 / np.diag(np.linalg.inv(true)))
            ratios = eigh(known, true, eigvals_only=True)
            rho = max(rho, float(ratios[-1]), 1.0 / float(ratios[0]))
    k2 = 3.0 * mismatch / inertia
    return rbi.SuperTwisting(2.2 * np.sqrt(k2 * rho), k2, "matched")


def law(
    model: rbi.ArmModel, impedance: rbi.Impedance, reaching: rbi.SuperTwisting
) -> rbi.ImpedanceController:
    """The usual law with another impedance."""
    return arms.law(model, reaching, impedance)


def approach(arm: rbi.ArmModel, q: Array, way: float) -> Trajectory:
    """Move down at SPEED over a way to the wall, which q touches, and brake to rest DEPTH below it."""
    direction = np.linalg.pinv(arm.jacobian(q)[:3]) @ -UP
    reach, brake = way / SPEED, 2.0 * DEPTH / SPEED

    def trajectory(t: float) -> Reference:
        late = float(np.clip(t - reach, 0.0, brake))
        x = SPEED * min(t, reach) + SPEED * late * (1.0 - late / (2.0 * brake)) - way
        speed = SPEED * (1.0 - late / brake)
        slowing = -SPEED / brake if 0.0 < t - reach < brake else 0.0
        return Reference(arm.integrate(q, x * direction), speed * direction, slowing * direction)

    return trajectory


def target_alone(
    arm: rbi.ArmModel,
    impedance: rbi.Impedance,
    trajectory: Trajectory,
    wall: Wall,
    ticks: int,
) -> Array:
    """Contact force of the target impedance itself at every tick: no arm, no controller, 20 steps per period."""
    steps = 20
    target = impedance.filter(arm.nv, DT / steps)
    q_e, v_e, force = np.zeros(arm.nv), np.zeros(arm.nv), np.empty(ticks)
    for k in range(ticks * steps):
        t = k * DT / steps
        desired = trajectory(t)
        q, v = arm.raw_dynamics.integrate(desired.q, q_e), desired.v + v_e
        if k % steps == 0:
            force[k // steps] = wall.force(arm, t, q, v)
        q_e, v_e = target.advance(q_e, v_e, wall.torque(arm, t, q, v))
    return force


def met(
    law: rbi.ImpedanceController,
    plant: rbi.ArmModel,
    trajectory: Trajectory,
    wall: Wall,
    **settings: Any,
) -> rbi.SimulationResult:
    """A run that begins on the trajectory and meets the wall; more settings are those of `simulate`."""
    q0, v0, _ = trajectory(0.0)
    return simulate(law, plant, trajectory, environment=wall, q0=q0, v0=v0, **settings)


def forces(result: rbi.SimulationResult, arm: rbi.ArmModel, wall: Wall) -> Array:
    """Contact force along a run."""
    samples = zip(result.t, result.q, result.v, strict=True)
    return np.array([wall.force(arm, t, q, v) for t, q, v in samples])


def contacts(force: Array) -> int:
    """How often the tool comes to the wall."""
    return int(np.count_nonzero(np.diff((force > 0.0).astype(int), prepend=0) == 1))
