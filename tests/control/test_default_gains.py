"""`ImpedanceController(arm)` is complete on every kind of arm, and tolerates what its text states."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance._common.arrays import Array
from rbimpedance.control import default_gains
from rbimpedance.control.default_gains import FRICTION, default_law
from rbimpedance.control.imperfect import ImperfectController
from rbimpedance.law.input_gain import gain_limit

from ..arms import LIMIT, arm_from_urdf, follower, pendulum, spinner, urdf, urdf_joint, urdf_link

FINGERS = ("panda_finger_joint1", "panda_finger_joint2")


def random_arm(seed: int) -> rbi.ArmModel:
    """A chain of two to six joints of any kind with links from 0.3 to 10 kg."""
    rng = np.random.default_rng(seed)
    elements, parent = [], "base"
    for i in range(int(rng.integers(2, 7))):
        kind = str(rng.choice(["revolute", "prismatic", "continuous"]))
        axis = str(rng.choice(["1 0 0", "0 1 0", "0 0 1", "1 1 0"]))
        more = LIMIT if kind != "continuous" else ""
        elements.append(urdf_joint(f"j{i}", kind, parent, f"l{i}", axis, more))
        elements.append(urdf_link(f"l{i}", float(np.exp(rng.uniform(-1.2, 2.3)))))
        parent = f"l{i}"
    return arm_from_urdf(urdf(*elements), tool_frame=parent)


ARMS: dict[str, Callable[[], rbi.ArmModel]] = {
    "panda": lambda: rbi.load_robot("panda", lock=FINGERS),
    "panda with fingers": lambda: rbi.load_robot("panda"),
    "ur5": lambda: rbi.load_robot("ur5"),
    "z1": lambda: rbi.load_robot("z1"),
    "two_link": lambda: rbi.load_robot("two_link"),
    "spinner": spinner,
    "mimic": follower,
    "pendulum": pendulum,
    **{f"random {seed}": lambda seed=seed: random_arm(seed) for seed in range(3)},  # type: ignore[misc]
}


QUICK = {
    ("z1", "light"),
    ("panda with fingers", "heavy"),
    ("spinner", "heavy"),
    ("random 0", "heavy"),
}
CASES = [
    pytest.param(name, corner, marks=[] if (name, corner) in QUICK else pytest.mark.slow)
    for name in ARMS
    for corner in ("heavy", "light")
]


def worst_plants(arm: rbi.ArmModel) -> dict[str, rbi.ArmModel]:
    """The corners of what the defaults state that they tolerate."""
    payload = default_law(arm, 1e-3).payload
    friction = np.minimum(FRICTION, 0.05 * arm.effort_limit)
    heavy = arm.with_scaled_inertia(1.1).with_friction(
        1.3 * arm.viscous, 1.3 * arm.coulomb + friction
    )
    light = arm.with_scaled_inertia(0.9).with_friction(0.7 * arm.viscous, 0.7 * arm.coulomb)
    return {"heavy": heavy.with_payload(payload) if payload else heavy, "light": light}


def middle(arm: rbi.ArmModel) -> tuple[Array, Array]:
    """A configuration amid the limits, and an amplitude that stays within them."""
    low, high = arm.joint_limits()
    bounded = np.isfinite(low) & np.isfinite(high)
    low, high = np.where(bounded, low, -1.0), np.where(bounded, high, 1.0)
    center = arm.integrate(arm.zero, (low + high) / 2.0)
    return center, np.minimum(0.2, 0.2 * (high - low))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "corner"), CASES)
def test_defaults_track_with_the_stated_payload_friction_and_delay_and_do_not_chatter(
    name: str, corner: str
) -> None:
    arm = ARMS[name]()
    plant, (q, amplitude) = worst_plants(arm)[corner], middle(arm)
    motion = rbi.trajectories.cosine(arm, center=q, amplitude=amplitude, period=6.0)
    controller = ImperfectController(rbi.ImpedanceController(arm), delay=1)
    result = rbi.simulate(controller, plant, motion, q0=motion(0.0).q, duration=1.2)
    late = result.t >= 0.8
    pairs = zip(result.q[late], result.q_r[late], strict=True)
    assert max(np.abs(plant.difference(q, q_r)).max() for q, q_r in pairs) < 5e-3
    needed = np.array([plant.inverse_dynamics(*motion(t)) for t in result.t[late][::10].tolist()])
    needed_variation = np.abs(np.diff(needed, axis=0)).sum() / 0.4
    variation = result.metrics(after=0.8)["tau_variation"].sum()
    assert variation < 1.5 * needed_variation + 1.0


@pytest.mark.parametrize("name", ["ur5", "z1", "spinner"])
def test_default_gains_follow_from_the_stated_bounds(name: str) -> None:
    """k2 = 3·τ̄/m, k1² ≥ 4·k2, and a margin that tolerates links 10 % lighter with a period of delay."""
    arm = ARMS[name]()
    law = default_law(arm, 1e-3)
    reaching = law.reaching
    assert (reaching.k1**2 >= 4.0 * reaching.k2).all()
    slope_step = float(default_gains.slope_at_zero(law.surface, arm.nv).max()) * 1e-3
    margin = float(np.max(reaching.margin))
    assert gain_limit(1.0, margin, 1, slope_step) > 1.0 / 0.9
    least = np.minimum(FRICTION, 0.05 * arm.effort_limit)
    effective = [1.0 / np.diag(np.linalg.inv(arm.mass_matrix(middle(arm)[0])))]
    assert (reaching.k2 > 3.0 * least / (1.2 * np.max(effective, axis=0) + 1e-2)).all()


def test_default_surface_comes_at_most_at_half_the_velocity_limit() -> None:
    arm = ARMS["panda with fingers"]()
    surface = rbi.ImpedanceController(arm).surface
    far = np.full(arm.nv, 2.0)
    assert (surface.speed(far) <= 0.5 * arm.velocity_limit + 1e-3).all()


def test_default_target_is_critically_damped_and_no_lighter_than_the_arm() -> None:
    arm = ARMS["ur5"]()
    target = rbi.ImpedanceController(arm).impedance
    assert isinstance(target, rbi.Impedance)
    assert target.damping_ratio == 1.0
    assert (target.mass >= np.diag(arm.mass_matrix(arm.neutral)) - 1e-9).all()


def test_each_part_can_be_given_beside_the_defaults() -> None:
    arm, whole = ARMS["two_link"](), rbi.ImpedanceController(ARMS["two_link"]())
    target, surface = rbi.Impedance(1.0, stiffness=50.0), rbi.FastTerminalSurface()
    reaching = rbi.SuperTwisting(k1=20.0, k2=50.0)
    controller = rbi.ImpedanceController(arm, target)
    assert controller.impedance is target
    assert vars(controller.reaching).keys() == vars(whole.reaching).keys()
    for name, value in vars(whole.reaching).items():
        np.testing.assert_array_equal(getattr(controller.reaching, name), value)
    assert rbi.ImpedanceController(arm, surface=surface).surface is surface
    assert rbi.ImpedanceController(arm, reaching=reaching).reaching is reaching
    assert rbi.ImpedanceController(arm, reaching=reaching).arm is arm


def test_an_arm_whose_friction_is_not_stiff_is_the_model_itself() -> None:
    arm = ARMS["ur5"]()
    assert rbi.ImpedanceController(arm).arm is arm


def test_friction_that_is_stiff_against_the_period_joins_the_armature_of_the_default_model() -> (
    None
):
    """A joint of 1 kg·m² with d = 2000: over h = 1 ms it answers as one of 1 + h·d, viscous friction alone."""
    arm = pendulum()
    inertia = arm.mass_matrix(arm.neutral)[0, 0]
    sticky = arm.with_friction(viscous=2000.0 * inertia)
    model = rbi.ImpedanceController(sticky).arm
    np.testing.assert_allclose(model.armature, 1e-3 * 2000.0 * inertia, rtol=1e-9)


def test_longer_periods_get_a_gentler_surface() -> None:
    arm = ARMS["ur5"]()
    slopes = [
        float(default_gains.slope_at_zero(rbi.ImpedanceController(arm, dt=dt).surface, 6).max())
        for dt in (1e-3, 4e-3)
    ]
    assert slopes[0] > slopes[1]


def test_a_period_without_default_gains_is_refused() -> None:
    arm = ARMS["ur5"]()
    with pytest.raises(rbi.ParameterError, match="dt"):
        rbi.ImpedanceController(arm, surface=rbi.FastTerminalSurface(smoothing=1e-5), dt=1e-2)


def test_surface_without_default_gains_asks_for_them() -> None:
    surface = rbi.NonsingularTerminalSurface(beta=3.0, exponent=5.0 / 3.0)
    with pytest.raises(rbi.ParameterError, match="reaching"):
        rbi.ImpedanceController(ARMS["two_link"](), surface=surface)


@pytest.mark.parametrize("missing", [{}, {"k1": 1.0}, {"k2": 1.0}])
def test_super_twisting_without_gains_says_what_to_call(missing: dict[str, Any]) -> None:
    with pytest.raises(rbi.ParameterError, match=r"ImpedanceController\(arm\).*propose_gains"):
        rbi.SuperTwisting(**missing)
