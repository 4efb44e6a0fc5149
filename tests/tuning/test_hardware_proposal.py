"""Gains for an arm on its hardware: what bounds them, what is promised, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.tuning import hardware_proposal
from rbimpedance.tuning.hardware_bandwidths import (
    HardwareDemand,
    bandwidths,
    spring_bound,
    variation_of_motion,
)

from ..arms import manipulator, pendulum

USUAL: dict[str, Any] = {"encoder_bits": 19, "torque_lag": 2e-3, "delay": 1, "stribeck": 0.2}


def demand(**changes: float) -> HardwareDemand:
    values = {"delay": 3.5e-3, "inertia": 0.2, "mass": 0.3, "jump": 4.8, "count": 1.2e-5}
    values |= {"spring": np.inf} | changes
    one = {name: np.array([value]) for name, value in values.items()}
    return HardwareDemand(**one, need=10.0, accuracy=0.7e-3)


def test_slow_hardware_is_bound_by_its_delay() -> None:
    found = bandwidths(demand(delay=20e-3, count=0.0))
    assert found.bound == ("delay",)
    assert found.alert == pytest.approx(0.3 / 20e-3)


def test_joint_without_much_friction_gets_no_more_bandwidth_than_it_needs() -> None:
    found = bandwidths(demand(jump=0.2, inertia=2.0, count=0.0))
    assert found.bound == ("friction",)
    assert found.jump_error == pytest.approx(0.7e-3)


def test_noise_at_the_quiet_bandwidth_is_its_share_of_the_need_whatever_the_count() -> None:
    for count in (6e-6, 1.2e-5, 2.4e-5):
        found = bandwidths(demand(count=count))
        assert found.bound == ("noise",)
        assert found.noise == pytest.approx(0.3 * 10.0, rel=1e-9)


def test_a_bit_less_costs_a_fifth_of_the_bandwidth() -> None:
    fine, coarse = (float(bandwidths(demand(count=c)).quiet[0]) for c in (1.2e-5, 2.4e-5))
    assert coarse / fine == pytest.approx(2.0 ** (-1.0 / 3.0), rel=1e-9)


def test_predicted_noise_is_that_of_an_observer_on_counts() -> None:
    """The formula's torque variation against a loop of one joint: counts, observer and law, without a disturbance."""
    arm = pendulum().with_gravity(np.zeros(3)).with_armature(0.2)
    hardware, omega = rbi.Hardware(encoder_bits=17), 30.0
    law = rbi.HardwareController(
        arm, hardware, bandwidths=(omega, omega), k2=1e3, learns_friction=False
    )
    speed = 0.1
    motion = lambda t: rbi.Reference(arm.neutral + speed * t, np.array([speed]), np.zeros(1))  # noqa: E731
    result = rbi.simulate(law, arm, motion, v0=np.array([speed]), hardware=hardware, duration=3.0)
    late = result.t >= 1.0
    seen = float(np.abs(np.diff(result.tau[late], axis=0)).sum() / 2.0)
    M = arm.mass_matrix(arm.neutral)[0, 0]
    predicted = 0.23 * (1.0 + 2.0 + 1.0 / 3.0) * M * hardware.count(arm)[0] * (3.0 * omega) ** 3
    assert 0.3 < seen / predicted < 3.0


def test_ripple_adds_to_what_a_motion_needs_in_proportion() -> None:
    arm = manipulator()
    motion = rbi.trajectories.cosine(arm, amplitude=0.1, period=4.0)
    smooth, some, twice = (
        variation_of_motion(arm, rbi.Hardware(ripple=r), motion, 4.0) for r in (0.0, 0.03, 0.06)
    )
    assert some > 1.1 * smooth
    assert twice - smooth == pytest.approx(2.0 * (some - smooth))


def proposed(hardware: Any, **more: Any) -> Any:
    arm = manipulator().with_armature(0.1)
    unknown = rbi.Uncertainty(inertia_scale=1.1, coulomb=1.0, viscous=0.5)
    motion = rbi.trajectories.cosine(arm, amplitude=0.1, period=2.0)
    settings: dict[str, Any] = {"duration": 2.0} | more
    return rbi.propose_gains(arm, unknown, motion, 1e-3, hardware=hardware, **settings)


def test_proposal_keeps_its_promise_on_a_plant_that_it_has_not_seen() -> None:
    found = proposed(rbi.Hardware(**USUAL))
    assert found.feasible
    assert found.error.max() < 5e-3
    arm = manipulator().with_armature(0.1).with_scaled_inertia(1.05).with_friction(0.2, 0.7)
    result = rbi.simulate(
        found.controller(),
        arm,
        rbi.trajectories.cosine(arm, amplitude=0.1, period=2.0),
        hardware=found.hardware,
        duration=2.0,
    )
    late = result.t >= 1.0
    pairs = zip(result.q[late], result.q_r[late], strict=True)
    error = np.max([np.abs(arm.difference(q, q_r)) for q, q_r in pairs])
    assert error < 1.2 * found.error.max()
    assert "rad/s" in found.explain()


def test_perfect_hardware_gives_back_the_usual_proposal() -> None:
    perfect, usual = proposed(rbi.Hardware()), proposed(None)
    assert isinstance(perfect, rbi.GainProposal)
    assert np.array_equal(perfect.k2, usual.k2)
    assert np.array_equal(perfect.margin, usual.margin)


def test_accuracy_beyond_the_hardware_is_refused_with_what_binds() -> None:
    found = proposed(rbi.Hardware(**USUAL | {"encoder_bits": 16}), accuracy=1e-5)
    assert not found.feasible
    assert found.joint in found.arm.joint_names
    assert "mrad" in found.reason
    assert found.remedies
    with pytest.raises(rbi.ParameterError, match="feasible"):
        found.controller()


def test_promise_of_a_loud_proposal_rests_on_every_plant(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its softer ones end at the first plant that is too loud; the one that is returned does not."""
    monkeypatch.setattr(hardware_proposal, "LOUDEST", 0.0)
    monkeypatch.setattr(hardware_proposal, "_FLOOR", 0.0)
    found = proposed(rbi.Hardware(**USUAL), duration=1.0)
    assert found.feasible
    assert len({id(run.sample) for run in found.runs}) == 11


def largest_real_part(omega: float, B: float, m: float, K: float, side: str) -> float:
    """Of the eigenvalues of rotor and link on a damped spring, under observer and law in continuous time."""
    damping = 0.1 * np.sqrt(K / (1.0 / B + 1.0 / m))
    rotor, rotor_speed, link, link_speed, q, v, d = range(7)
    A, observed, states = np.zeros((7, 7)), 3.0 * omega, np.eye(7)
    u = (B + m) * -(omega**2 * states[q] + 2.0 * omega * states[v] + states[d])
    spring = K * (states[rotor] - states[link])
    spring += damping * (states[rotor_speed] - states[link_speed])
    A[rotor], A[rotor_speed] = states[rotor_speed], (u - spring) / B
    A[link], A[link_speed] = states[link_speed], spring / m
    innovation = states[rotor if side == "motor" else link] - states[q]
    A[q] = states[v] + 3.0 * observed * innovation
    A[v] = u / (B + m) + states[d] + 3.0 * observed**2 * innovation
    A[d] = observed**3 * innovation
    return float(np.linalg.eigvals(A).real.max())


@pytest.mark.parametrize("side", ["motor", "link"])
@pytest.mark.parametrize(("B", "m", "K"), [(0.1, 5.0, 1e4), (0.1, 0.2, 1e4), (0.5, 5.0, 1e5)])
def test_spring_bound_is_within_two_and_a_half_times_of_where_the_spring_sings(
    B: float, m: float, K: float, side: Any
) -> None:
    hardware = rbi.Hardware(joint_stiffness=K, rotor_inertia=B, encoder_side=side)
    inertia = np.array([B + m])
    omega = float(spring_bound(hardware, pendulum().with_armature(B), inertia, inertia)[0])
    assert largest_real_part(omega, B, m, K, side) < 0.0
    assert largest_real_part(2.5 * omega, B, m, K, side) > 0.0


def test_joints_without_springs_and_with_torque_sensors_have_no_such_bound() -> None:
    for hardware in (rbi.Hardware(), rbi.Hardware(joint_stiffness=1e4, torque_sensor=0.02)):
        assert np.isinf(spring_bound(hardware, pendulum(), *np.ones((2, 1)))).all()


@pytest.mark.slow
@pytest.mark.parametrize("side", ["motor", "link"])
def test_springs_without_a_torque_sensor_get_a_soft_law_that_says_so(side: Any) -> None:
    found = proposed(rbi.Hardware(**USUAL, joint_stiffness=1e4, encoder_side=side), duration=1.5)
    assert found.feasible
    assert "spring" in found.bandwidths.bound
    assert "Springs without a torque sensor" in found.explain()
    assert ("do not see the springs yield" in found.explain()) == (side == "motor")


@pytest.mark.slow
def test_springs_behind_a_torque_loop_are_held_with_a_small_error() -> None:
    hardware = rbi.Hardware(
        **USUAL | {"torque_lag": 3e-4},
        joint_stiffness=1e4,
        rotor_inertia=0.3,
        torque_sensor=0.02,
        encoder_side="link",
    )
    found = proposed(hardware, duration=1.5)
    assert found.feasible
    assert found.error.max() < 5e-3
    assert not found.controller().learns_friction
