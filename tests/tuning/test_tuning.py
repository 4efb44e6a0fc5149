"""Proposed gains hold on plants that they have not seen, and a no names the joint, the reason and remedies."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg

import rbimpedance as rbi
from rbimpedance._common.arrays import Array
from rbimpedance.law.input_gain import gain_limit, needed_margin
from rbimpedance.trajectories import Trajectory, cosine, hold
from rbimpedance.tuning import GainProposal, PlantSample, Uncertainty, propose_gains, slowed
from rbimpedance.tuning.gain_design import Design, DesignTask, design, measure_task
from rbimpedance.tuning.gains_file import load_gains, save_gains
from rbimpedance.tuning.mismatch import Mismatch, balanced_model, measure
from rbimpedance.tuning.motions import MotionMargin, sample_motions
from rbimpedance.tuning.torque_demand import RESERVE_ACCELERATION, Exertion

from ..arms import manipulator, pendulum
from ..command_line import call

DT = 4e-3
UNKNOWN = Uncertainty(payload=1.0, inertia_scale=1.1)


def swing(arm: rbi.ArmModel) -> Trajectory:
    return cosine(arm, amplitude=0.2, period=6.0)


def propose(
    arm: rbi.ArmModel, uncertainty: Uncertainty, dt: float = DT, **more: Any
) -> GainProposal:
    """A proposal; remedies are tried only where a test asks for them."""
    settings: dict[str, Any] = {"remedy_time": 0.0} | more
    proposal: GainProposal = propose_gains(
        arm, uncertainty, swing(arm), dt, duration=3.0, samples=8, **settings
    )
    return proposal


@pytest.fixture(scope="module")
def two_link() -> rbi.ArmModel:
    return rbi.load_robot("two_link")


@pytest.fixture(scope="module")
def accepted(two_link: rbi.ArmModel) -> GainProposal:
    return propose(two_link, UNKNOWN)


@pytest.fixture(scope="module")
def refused(two_link: rbi.ArmModel) -> GainProposal:
    return propose(two_link, Uncertainty(payload=8.0, delay=4), dt=2e-2, remedy_time=np.inf)


def late_error(proposal: GainProposal, sample: PlantSample) -> float:
    """Largest true error over the last second of 3 s."""
    arm = proposal.nominal
    controller = sample.wrap(proposal.controller())
    result = rbi.simulate(controller, sample.plant, swing(arm), q0=arm.neutral, duration=3.0)
    late = result.t >= 2.0
    last = zip(result.q[late], result.q_r[late], strict=True)
    return max(float(np.abs(arm.difference(q, q_r)).max()) for q, q_r in last)


def mismatch_of(arm: rbi.ArmModel, uncertainty: Uncertainty) -> Mismatch:
    """Mismatch between an arm and the plants that an uncertainty about it allows."""
    motions = sample_motions(arm, swing(arm), 3.0, DT, 9, seed=0, spread=MotionMargin())
    return measure(arm, uncertainty.sample(arm, 8), motions, DT)


# --- what a margin bears ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("margin", [1.0, 2.0, 4.0, 10.0])
def test_gain_limit_of_a_prompt_loop_has_a_closed_form(margin: float) -> None:
    assert gain_limit(0.5, margin, 0, 0.0) == pytest.approx(
        4.0 * margin**2 / (4.0 * margin - 1.0), rel=1e-6
    )


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("slope", [0.0, 30.0])
def test_scheme_settles_just_below_its_gain_limit_and_not_just_above(
    delay: int, slope: float
) -> None:
    h, margin = 1e-3, 12.0
    limit = gain_limit(1.0, margin, delay, slope * h)
    assert amplitude(0.97 * limit, margin, delay, slope, h) < 1e-12
    assert amplitude(1.03 * limit, margin, delay, slope, h) > 1e-8


def amplitude(g: float, margin: float, delay: int, slope: float, h: float) -> float:
    """Size of s after a long run of the sampled loop ė1 = e2, ė2 = -g·A with the scheme itself."""
    law = rbi.SuperTwisting(k1=8.0, k2=10.0, margin=margin)
    e1, e2 = np.array([1e-6]), np.array([1e-6])
    state, seen = law.start(slope * e1 + e2), [(e1, e2)] * (delay + 1)
    for _ in range(8000):
        late1, late2 = seen[0]
        u, state = law.step(slope * late1 + late2, state, h)
        a = g * (slope * late2 + u) / (1.0 + slope * h / 2.0)
        e1, e2 = e1 + h * e2 - h**2 / 2.0 * a, e2 - h * a
        seen = [*seen[1:], (e1, e2)]
    return float(abs(slope * e1 + e2)[0])


@pytest.mark.parametrize("delay", [0, 2])
def test_needed_margin_bears_the_gains_that_it_is_asked_for_and_is_the_smallest(delay: int) -> None:
    margin = needed_margin(0.4, 3.0, delay, 0.05)
    assert gain_limit(0.4, margin, delay, 0.05) == pytest.approx(3.0, rel=1e-3)


def test_needed_margin_grows_with_delay_and_is_infinite_where_nothing_helps() -> None:
    margins = [needed_margin(0.5, 2.0, delay, 0.05) for delay in range(4)]
    assert margins == sorted(margins)
    assert needed_margin(0.5, 50.0, 5, 0.3) == np.inf


# --- how far plants are from the model ----------------------------------------------------------------------------


def test_links_twice_as_heavy_answer_with_half_the_acceleration(two_link: rbi.ArmModel) -> None:
    arm = two_link.with_friction(0.0, 0.0)
    found = mismatch_of(arm, Uncertainty(inertia_scale=(2.0, 2.0)))
    np.testing.assert_allclose([found.gain_low, found.gain_high], 0.5, rtol=1e-9)
    assert found.rho == pytest.approx(2.0)


def test_torque_constant_is_an_input_gain(two_link: rbi.ArmModel) -> None:
    arm = two_link.with_friction(0.0, 0.0)
    found = mismatch_of(arm, Uncertainty(torque_constant=(1.25, 1.25)))
    np.testing.assert_allclose([found.gain_low, found.gain_high], 1.25, rtol=1e-9)


def test_payload_gains_are_generalised_eigenvalues() -> None:
    arm = manipulator().with_friction(0.0, 0.0)
    plant = arm.with_payload(3.0)
    motions = sample_motions(arm, hold(arm), 1.0, DT, 2, seed=0, spread=MotionMargin())
    found = measure(arm, Uncertainty(payload=(3.0, 3.0)).sample(arm, 1), motions, DT)
    values = np.concatenate(
        [
            scipy.linalg.eigvalsh(arm.mass_matrix(now.q), plant.mass_matrix(now.q))
            for now, _ in motions
        ]
    )
    assert found.gain_low == pytest.approx(values.min(), rel=1e-9)
    assert found.gain_high == pytest.approx(values.max(), rel=1e-9)


def test_missed_torque_of_a_pendulum_is_the_weight_that_it_does_not_know() -> None:
    arm = pendulum()
    motions = sample_motions(
        arm, hold(arm, [np.pi / 2.0]), 1.0, DT, 1, seed=0, spread=MotionMargin()
    )[:1]
    found = measure(arm, Uncertainty(payload=(1.0, 1.0)).sample(arm, 1), motions, DT)
    np.testing.assert_allclose(found.torque, 1.0 * 9.81 * 0.5, rtol=1e-9)
    np.testing.assert_allclose(found.inertia, 3.0 * 0.5**2, rtol=1e-9)
    np.testing.assert_allclose(found.disturbance, 9.81 * 0.5 / (3.0 * 0.25), rtol=1e-9)


def test_carried_payload_balances_the_gain_at_both_ends_of_the_range() -> None:
    """A pendulum with bob M answers a model with bob c by c/M: the balance of [2, 6] kg is √12 - 2 kg of payload."""
    arm = pendulum()
    motions = sample_motions(arm, hold(arm), 1.0, DT, 2, seed=0, spread=MotionMargin())
    _, payload = balanced_model(arm, Uncertainty(payload=4.0), motions, DT)
    assert payload == pytest.approx(np.sqrt(12.0) - 2.0, abs=0.2)


def test_stiff_friction_joins_the_armature_as_a_held_torque_meets_it() -> None:
    """Viscous friction d alone: over a period h the joint answers with M/(M + h·d) of the free acceleration."""
    arm = pendulum().with_friction(viscous=500.0)
    motions = sample_motions(arm, hold(arm), 1.0, DT, 2, seed=0, spread=MotionMargin())
    model, _ = balanced_model(arm, Uncertainty(), motions, DT)
    np.testing.assert_allclose(model.armature, DT * 500.0, rtol=1e-9)
    start = np.zeros(1)
    push = model.inverse_dynamics(start, start, [1.0])
    result = rbi.simulate(HeldTorque(arm, push), arm, hold(arm), q0=start, duration=DT, substeps=1)
    np.testing.assert_allclose(result.v[-1], 1.0 * DT, rtol=1e-6)


class HeldTorque:
    """A controller that gives one torque for ever."""

    def __init__(self, arm: rbi.ArmModel, tau: Array) -> None:
        self.arm, self.dt, self.tau = arm, DT, tau

    def init(self) -> int:
        return 0

    def step(self, state: int, *seen: Any) -> tuple[rbi.ControllerOutput, int]:
        q, rest = np.array(seen[0]), np.zeros(self.arm.nv)
        output: Any = dict.fromkeys(rbi.ControllerOutput._fields, rest)
        return rbi.ControllerOutput(**(output | {"tau": self.tau, "q_r": q})), state

    def impedance_error(self, output: rbi.ControllerOutput, a: Array) -> Array:
        del a
        return output.e1


# --- proposals ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_accepted_gains_hold_on_plants_that_they_have_not_seen(accepted: GainProposal) -> None:
    assert accepted.feasible
    unseen = UNKNOWN.sample(accepted.nominal, 8, seed=99)
    assert max(late_error(accepted, sample) for sample in unseen) < 1e-5


def test_paper_gains_do_not_hold_on_those_plants(accepted: GainProposal) -> None:
    arm = rbi.load_robot("two_link")
    sample = UNKNOWN.sample(arm, 1)[0]
    controller = rbi.ImpedanceController(
        arm,
        impedance=rbi.Impedance(mass=1.0, damping=10.0, stiffness=20.0),
        surface=accepted.surface,
        reaching=rbi.SuperTwisting(k1=0.8, k2=1.0),
        dt=DT,
    )
    result = rbi.simulate(controller, sample.plant, swing(arm), q0=arm.neutral, duration=3.0)
    assert np.abs(result.e1[-1]).max() > 100.0 * late_error(accepted, sample)


def test_accepted_gains_have_a_certificate_and_the_margins_that_they_need(
    accepted: GainProposal,
) -> None:
    assert accepted.certificate is not None
    assert accepted.certificate.feasible.all()
    assert accepted.gain_limit > accepted.mismatch.gain_high
    assert (accepted.k2 * accepted.mismatch.gain_low > accepted.mismatch.disturbance_rate).all()
    assert (accepted.k1**2 * accepted.mismatch.gain_low >= 4.0 * accepted.k2).all()


def test_worst_samples_were_simulated_within_the_accuracy(accepted: GainProposal) -> None:
    assert accepted.worst
    assert all(case.joint is None for case in accepted.worst)
    assert max(float(case.error.max()) for case in accepted.worst) < 1e-3


def test_controller_carries_a_payload_inside_the_range(accepted: GainProposal) -> None:
    assert 0.0 < accepted.payload < 1.0
    q = np.array([0.3, -0.4])
    between = [accepted.nominal.with_payload(m).mass_matrix(q)[0, 0] for m in (0.0, 1.0)]
    assert between[0] < accepted.arm.mass_matrix(q)[0, 0] < between[1]


@pytest.mark.slow
def test_same_seed_proposes_the_same(accepted: GainProposal, two_link: rbi.ArmModel) -> None:
    again = propose(two_link, UNKNOWN)
    np.testing.assert_array_equal(again.k2, accepted.k2)
    np.testing.assert_array_equal(again.worst[0].result.tau, accepted.worst[0].result.tau)


@pytest.mark.slow
def test_gains_for_an_arm_that_is_pushed_hold_while_it_is_pushed(two_link: rbi.ArmModel) -> None:
    """A push of 8 N·m at 1.5 Hz moves the reference of M_d = 1 with up to 8 rad/s² at up to 0.8 rad/s."""
    spread = MotionMargin(position=0.1, velocity=0.8, acceleration=8.0)
    proposal = propose(two_link, UNKNOWN, spread=spread)
    assert proposal.feasible

    def push(t: float) -> Array:
        return np.array([8.0, -8.0]) * float(np.sin(2.0 * np.pi * 1.5 * t))

    sample = UNKNOWN.sample(two_link, 1)[0]
    result = rbi.simulate(
        proposal.controller(),
        sample.plant,
        swing(two_link),
        environment=rbi.JointTorque(push),
        q0=two_link.neutral,
        duration=3.0,
    )
    assert np.abs(result.e1[result.t >= 2.0]).max() < 1e-3


def test_spread_that_cannot_be_is_refused() -> None:
    with pytest.raises(rbi.ParameterError, match="velocity"):
        MotionMargin(velocity=0.0)


@pytest.mark.slow
def test_refusal_names_the_joint_and_the_reason(refused: GainProposal) -> None:
    assert not refused.feasible
    assert refused.joint in refused.nominal.joint_names
    assert f"'{refused.joint}'" in refused.reason
    assert refused.reason in refused.explain()


@pytest.mark.slow
def test_where_no_change_is_enough_alone_several_are_tried_together(refused: GainProposal) -> None:
    assert [str(remedy) for remedy in refused.remedies if remedy.startswith("together: ")]
    assert any("shorter period" in words for words in refused.tried.failed)
    assert any("payload" in words for words in refused.tried.failed)


def test_refused_gains_build_no_controller(refused: GainProposal) -> None:
    with pytest.raises(rbi.ParameterError, match="remedies"):
        refused.controller()


INFEASIBLE: dict[str, dict[str, Any]] = {
    "too slow": {"uncertainty": Uncertainty(payload=2.0, delay=2), "dt": 1e-2},
    "far too slow": {"uncertainty": Uncertainty(payload=8.0, delay=4), "dt": 2e-2},
    "a run that ends too early": {"q0": [1.0, -1.0], "duration": 0.6, "dt": 4e-3},
    "more accuracy than noise allows": {
        "uncertainty": Uncertainty(payload=1.0, position_noise=1e-4, velocity_noise=1e-3, delay=2),
        "dt": 4e-3,
        "duration": 3.0,
        "samples": 8,
        "accuracy": 2e-5,
        "remedy_time": 20.0,
    },
    "a weak shoulder": {"limits": [40.0, 1e6], "dt": 1e-2},
}


@pytest.mark.slow
@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, marks=[] if case.startswith("a run") else pytest.mark.slow)
        for case in INFEASIBLE
    ],
)
def test_every_remedy_that_is_told_is_feasible_when_it_is_followed(
    two_link: rbi.ArmModel, case: str
) -> None:
    asked: dict[str, Any] = {"arm": two_link, "uncertainty": UNKNOWN}
    asked |= {"trajectory": swing(two_link)}
    asked |= {"duration": 2.0, "samples": 6, "remedy_time": np.inf} | INFEASIBLE[case]
    proposal = propose_gains(**asked)
    assert not proposal.feasible
    assert proposal.remedies
    for remedy in proposal.remedies:
        assert propose_gains(**(asked | dict(remedy.changes))).feasible, remedy
        assert remedy in proposal.explain()


@pytest.mark.slow
def test_a_run_that_ends_before_the_arm_has_arrived_is_told_to_last_longer(
    two_link: rbi.ArmModel,
) -> None:
    asked = INFEASIBLE["a run that ends too early"]
    more: dict[str, Any] = {"samples": 6, "remedy_time": np.inf}
    proposal = propose_gains(two_link, UNKNOWN, swing(two_link), **more, **asked)
    assert any(remedy.changes.keys() == {"duration"} for remedy in proposal.remedies)


def test_without_time_no_remedy_is_told_and_the_explanation_says_so(
    two_link: rbi.ArmModel,
) -> None:
    proposal = propose(two_link, Uncertainty(payload=8.0, delay=4), dt=2e-2)
    assert not proposal.remedies
    assert not proposal.tried.complete
    assert "no time" in proposal.explain()


def test_unknown_keyword_is_refused(two_link: rbi.ArmModel) -> None:
    with pytest.raises(TypeError, match="sample"):
        propose(two_link, UNKNOWN, sample=3)


@pytest.mark.parametrize("payload", [2.0, 8.0, 32.0])
@pytest.mark.parametrize("dt", [1e-2, 3e-2])
def test_no_yes_fails_beyond_what_can_be_carried(
    two_link: rbi.ArmModel, payload: float, dt: float
) -> None:
    proposal = propose(two_link, Uncertainty(payload=payload, inertia_scale=1.3), dt=dt)
    if proposal.feasible:
        sample = proposal.uncertainty.sample(two_link, 6, seed=7)[-1]
        assert late_error(proposal, sample) < 1e-3
    else:
        assert proposal.joint in two_link.joint_names


@pytest.mark.slow
def test_gains_shrink_as_noise_grows(two_link: rbi.ArmModel) -> None:
    gains = [
        designed(two_link, position_noise=1e-4 * noise, velocity_noise=1e-3 * noise, delay=1)
        for noise in (0.0, 0.3, 1.0, 3.0, 10.0)
    ]
    for quieter, louder in pairwise(gains):
        assert (louder.k1 < quieter.k1).all()
        assert (louder.k2 < quieter.k2).all()
        assert louder.margin >= quieter.margin


def test_gains_and_bandwidth_shrink_as_delay_grows(two_link: rbi.ArmModel) -> None:
    gains = [designed(two_link, delay=delay) for delay in range(4)]
    for sooner, later in pairwise(gains):
        assert (later.k1 < sooner.k1).all()
        assert (later.k2 < sooner.k2).all()
        assert later.margin > sooner.margin


def designed(arm: rbi.ArmModel, **imperfect: Any) -> Design:
    """What the bounds call for, before any simulation."""
    task = DesignTask(
        arm=arm,
        uncertainty=Uncertainty(payload=1.0, **imperfect),
        trajectory=swing(arm),
        dt=1e-3,
        duration=3.0,
        samples=6,
        instants=9,
    )
    return design(task, measure_task(task))


@pytest.mark.slow
def test_noisy_delayed_loop_stays_bounded(two_link: rbi.ArmModel) -> None:
    uncertainty = Uncertainty(payload=1.0, position_noise=1e-4, velocity_noise=1e-3, delay=2)
    proposal = propose(two_link, uncertainty)
    assert proposal.feasible
    assert any(case.noisy for case in proposal.worst)
    for sample in uncertainty.sample(two_link, 3, seed=11):
        assert late_error(proposal, sample) < 3e-3


def test_light_wrists_are_carried_without_rotors() -> None:
    arm = rbi.load_robot("panda", lock=("panda_finger_joint1", "panda_finger_joint2"))
    uncertainty = Uncertainty(payload=2.0, inertia_scale=1.1)
    proposal = propose(arm, uncertainty)
    assert proposal.feasible
    assert late_error(proposal, uncertainty.sample(arm, 6, seed=3)[-1]) < 1e-4


@pytest.mark.parametrize(
    ("more", "word"),
    [
        ({"samples": 0}, "samples"),
        ({"instants": 0}, "instants"),
        ({"accuracy": 0.0}, "accuracy"),
        ({"seed": -1}, "seed"),
    ],
)
def test_settings_that_cannot_be_are_refused(
    two_link: rbi.ArmModel, more: dict[str, Any], word: str
) -> None:
    with pytest.raises(rbi.ParameterError, match=word):
        propose_gains(two_link, UNKNOWN, swing(two_link), DT, **more)


def test_surface_that_the_theorem_does_not_cover_is_refused(two_link: rbi.ArmModel) -> None:
    surface = rbi.NonsingularTerminalSurface(beta=3.0, exponent=5.0 / 3.0)
    with pytest.raises(rbi.ParameterError, match="surface"):
        propose(two_link, UNKNOWN, surface=surface)


def test_bounded_surface_carries_a_start_far_beyond_what_gains_were_proposed_for(
    two_link: rbi.ArmModel, accepted: GainProposal
) -> None:
    """2 rad off with gains for 0.2 rad: at the speed that the surface has at 0.2 rad, and home."""
    near, stated = accepted.controller(), 0.2
    bounded = rbi.BoundedSurface(near.surface, stated)
    controller = rbi.ImpedanceController(near.arm, near.impedance, bounded, near.reaching, DT)
    far = cosine(two_link, center=[2.0, -2.0], amplitude=stated, period=6.0)
    plant = UNKNOWN.sample(two_link, 1)[0].plant
    speeds = []
    for law in (controller, near):
        result = rbi.simulate(law, plant, far, q0=two_link.neutral, duration=5.0)
        speeds.append(float(np.abs(result.e2).max()))
        assert np.abs(result.e1[-1]).max() < 1e-4
    limit = float(bounded.speed(np.full(2, 2.0)).max())
    assert limit == pytest.approx(float(near.surface.value(np.array([0.2]), np.zeros(1))[0]))
    assert speeds[0] < 1.25 * limit
    assert speeds[1] > 3.0 * limit


# --- torque limits ------------------------------------------------------------------------------------------------


def swing_soon(arm: rbi.ArmModel) -> Trajectory:
    """A motion whose torque comes from inertia as much as from weight."""
    return cosine(arm, amplitude=0.2, period=2.0)


def propose_within(arm: rbi.ArmModel, limits: Any, **changes: Any) -> GainProposal:
    settings: dict[str, Any] = {"uncertainty": UNKNOWN, "trajectory": swing_soon(arm)}
    settings |= {"remedy_time": 0.0} | changes
    proposal: GainProposal = propose_gains(
        arm, dt=DT, duration=3.0, samples=8, limits=limits, **settings
    )
    return proposal


@pytest.fixture(scope="module")
def unhindered(two_link: rbi.ArmModel) -> GainProposal:
    """Limits far away."""
    return propose_within(two_link, 1e6)


@pytest.fixture(scope="module")
def needed(unhindered: GainProposal) -> Array:
    assert unhindered.torque is not None
    return unhindered.torque.needed


@pytest.fixture(scope="module")
def weak_shoulder(two_link: rbi.ArmModel, needed: Array) -> GainProposal:
    return propose_within(two_link, [0.9 * needed[0], 1e6], remedy_time=np.inf)


def test_torque_that_a_pendulum_needs_has_a_closed_form() -> None:
    """Largest abs(m·l²·a + m·g·l·sin q) with all the payload; the reserve is m·l² times its acceleration."""
    arm, heaviest = pendulum(), 3.0
    motion = cosine(arm, amplitude=0.6, period=1.0)
    plants = Uncertainty(payload=1.0).extremes(arm)
    demand = Exertion(plants, motion, 3.0).demand(rbi.Limits(10.0))
    q, a = np.array([(now.q[0], now.a[0]) for now in map(motion, np.linspace(0.0, 3.0, 3001))]).T
    tau = heaviest * (0.25 * a + 9.81 * 0.5 * np.sin(q))
    np.testing.assert_allclose(demand.needed, np.abs(tau).max(), rtol=1e-3)
    np.testing.assert_allclose(demand.reserve, RESERVE_ACCELERATION * heaviest * 0.25)
    np.testing.assert_allclose(demand.rate_needed, np.abs(np.diff(tau) / 1e-3).max(), rtol=1e-2)
    assert demand.plants[0].payload == 1.0
    assert motion(float(demand.time[0])).v[0] == pytest.approx(0.0, abs=0.05)  # where it turns


def test_torque_constant_below_one_asks_for_more_torque() -> None:
    arm = pendulum()
    weak = Uncertainty(torque_constant=(0.5, 0.5)).extremes(arm)
    asked = [
        Exertion(plants, hold(arm, [1.0]), 1.0).demand(rbi.Limits()).needed[0]
        for plants in (weak, Uncertainty().extremes(arm))
    ]
    assert asked[0] == pytest.approx(2.0 * asked[1])


def test_slowed_exertion_is_that_of_the_slowed_motion(two_link: rbi.ArmModel) -> None:
    plants, motion = UNKNOWN.extremes(two_link), swing_soon(two_link)
    fast = Exertion(plants, motion, 2.0).demand(rbi.Limits(), slower=1.7)
    slow = Exertion(plants, slowed(motion, 1.7), 3.4).demand(rbi.Limits())
    np.testing.assert_allclose(fast.needed, slow.needed, rtol=1e-3)
    np.testing.assert_allclose(fast.rate_needed, slow.rate_needed, rtol=3e-2)


@pytest.mark.slow
@pytest.mark.parametrize("joint", [0, 1])
def test_yes_at_the_very_limit_converges(two_link: rbi.ArmModel, needed: Array, joint: int) -> None:
    limits = np.full(2, np.inf)
    limits[joint] = 1.001 * needed[joint]
    proposal = propose_within(two_link, limits)
    assert proposal.feasible
    for sample in UNKNOWN.sample(two_link, 3, seed=5):
        assert error_within(proposal, limits, sample) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("joint", [0, 1])
def test_no_just_below_the_limit_is_right_and_names_the_joint_and_what_it_lacks(
    two_link: rbi.ArmModel, unhindered: GainProposal, needed: Array, joint: int
) -> None:
    limits = np.full(2, 1e6)
    limits[joint] = 0.97 * needed[joint]
    proposal = propose_within(two_link, limits)
    assert not proposal.feasible
    assert proposal.joint == two_link.joint_names[joint]
    assert proposal.torque is not None
    assert proposal.torque.lack[joint] == pytest.approx(0.03 * needed[joint])
    assert f"lacks {0.03 * needed[joint]:.3g} N·m" in proposal.reason
    assert error_within(unhindered, limits, proposal.torque.plants[joint]) > 1e-2


def error_within(proposal: GainProposal, limits: Any, sample: PlantSample) -> float:
    """Largest true error over the last of 4 s with the proposal's gains."""
    arm, controller = proposal.nominal, proposal.controller(limits=limits)
    motion = swing_soon(arm)
    result = rbi.simulate(controller, sample.plant, motion, q0=arm.neutral, duration=4.0)
    late = result.t >= 3.0
    last = zip(result.q[late], result.q_r[late], strict=True)
    return max(float(np.abs(arm.difference(q, q_r)).max()) for q, q_r in last)


@pytest.mark.slow
def test_remedies_for_torque_limits_are_enough_and_little_less_is_not(
    two_link: rbi.ArmModel, weak_shoulder: GainProposal
) -> None:
    limits = weak_shoulder.limits
    slower, lighter, stronger = weak_shoulder.remedies
    factor = number_in(r"(\S+) times slower, over", slower)
    payload = number_in(r"payload of (\S+) kg at most", lighter)
    torque = number_in(r"actuators with (\S+) N", stronger)
    motion = swing_soon(two_link)
    assert propose_within(two_link, limits, trajectory=slowed(motion, factor)).feasible
    assert propose_within(two_link, limits, uncertainty=UNKNOWN.but(payload=payload)).feasible
    assert propose_within(two_link, [torque, 1e6]).feasible
    demands = (
        Exertion(UNKNOWN.extremes(two_link), slowed(motion, 0.98 * factor), 3.0 * factor),
        Exertion(UNKNOWN.but(payload=1.02 * payload).extremes(two_link), motion, 3.0),
    )
    assert limits is not None
    assert not any(exertion.demand(limits).with_reserve for exertion in demands)


def number_in(pattern: str, text: str) -> float:
    found = re.search(pattern, text)
    assert found is not None, text
    return float(found[1])


@pytest.mark.slow
def test_no_motion_is_slow_enough_for_a_joint_that_cannot_hold_the_arm(
    two_link: rbi.ArmModel,
) -> None:
    proposal = propose_within(two_link, [10.0, 1e6], remedy_time=np.inf)
    assert not any("slower" in way or "payload" in way for way in proposal.remedies)
    assert any("actuators" in way for way in proposal.remedies)


@pytest.mark.slow
def test_torque_that_may_not_change_fast_enough_is_refused(
    two_link: rbi.ArmModel, unhindered: GainProposal
) -> None:
    assert unhindered.torque is not None
    rate = np.array([1e6, 0.9 * unhindered.torque.rate_needed[1]])
    proposal = propose_within(two_link, rbi.Limits(rate=rate))
    assert proposal.joint == two_link.joint_names[1]
    assert "N·m/s" in proposal.reason


@pytest.mark.slow
def test_pushes_ask_for_torque_too(two_link: rbi.ArmModel, needed: Array) -> None:
    pushed = MotionMargin(position=0.1, velocity=0.8, acceleration=8.0)
    proposal = propose_within(two_link, 1.2 * needed, spread=pushed)
    assert not proposal.feasible
    assert propose_within(two_link, 1.2 * needed).feasible


def test_feasible_controller_keeps_the_limits_that_it_was_proposed_with(
    two_link: rbi.ArmModel, needed: Array
) -> None:
    proposal = propose_within(two_link, 1.2 * needed)
    limits = proposal.controller().limits
    assert limits is not None
    np.testing.assert_array_equal(limits.effort, 1.2 * needed)
    result = rbi.simulate(
        proposal.controller(), two_link, swing_soon(two_link), q0=two_link.neutral, duration=0.5
    )
    assert (np.abs(result.tau) <= 1.2 * needed).all()
    assert result.saturated.any()


def test_limits_for_another_number_of_joints_are_refused(two_link: rbi.ArmModel) -> None:
    with pytest.raises(rbi.DimensionError, match="effort"):
        propose_within(two_link, [1.0, 2.0, 3.0])


# --- files and the command line -----------------------------------------------------------------------------------


def test_gains_come_back_from_their_file(accepted: GainProposal, tmp_path: Path) -> None:
    gains = load_gains(save_gains(accepted, tmp_path / "gains.json"))
    impedance = rbi.Impedance(mass=1.0, damping=10.0, stiffness=20.0)
    torques = []
    for controller in (
        accepted.controller(impedance),
        gains.controller(accepted.nominal, impedance),
    ):
        reference = swing(accepted.nominal)(0.0)
        output, _ = controller.step(
            controller.init(), [0.1, 0.2], [0.3, 0.0], reference, [0.0, 1.0]
        )
        torques.append(output.tau)
    np.testing.assert_array_equal(torques[0], torques[1])


def test_limits_come_back_from_the_file_of_the_gains(
    two_link: rbi.ArmModel, needed: Array, tmp_path: Path
) -> None:
    limits = [1.1 * needed[0], np.inf]
    path = save_gains(propose_within(two_link, limits), tmp_path / "gains.json")
    table = json.loads(path.read_text("utf-8"))["torque"]
    assert table["needed"] == needed.tolist()
    assert table["limit"] == [limits[0], None]
    assert table["lack"] == [0.0, 0.0]
    impedance = rbi.Impedance(mass=1.0, damping=10.0, stiffness=20.0)
    kept = load_gains(path).controller(two_link, impedance).limits
    assert kept is not None
    np.testing.assert_array_equal(kept.effort, limits)


def test_surface_of_ones_own_is_refused_by_the_file_and_named(
    accepted: GainProposal, tmp_path: Path
) -> None:
    class Own(rbi.FastTerminalSurface):
        pass

    path = tmp_path / "gains.json"
    with pytest.raises(rbi.ParameterError, match="FastTerminalSurface, PowerSurface"):
        save_gains(replace(accepted, surface=Own()), path)
    assert not path.exists()


def test_body_that_the_model_carries_comes_back_from_the_file(tmp_path: Path) -> None:
    arm = rbi.load_robot("two_link")
    body = Uncertainty(payload=1.0, payload_com=(0.0, 0.0, 0.05), payload_gyration=(0.1, 0.1))
    proposal = propose(arm, body)
    gains = load_gains(save_gains(proposal, tmp_path / "gains.json"))
    model = gains.controller(arm, rbi.Impedance(1.0, 10.0, 20.0)).arm
    q = np.array([0.3, -0.4])
    np.testing.assert_array_equal(model.mass_matrix(q), proposal.arm.mass_matrix(q))


@pytest.mark.slow
def test_refused_gains_are_not_read(refused: GainProposal, tmp_path: Path) -> None:
    path = save_gains(refused, tmp_path / "gains.json")
    assert json.loads(path.read_text("utf-8"))["joint"] == refused.joint
    with pytest.raises(rbi.ParameterError, match="refused"):
        load_gains(path)


def test_gains_of_another_arm_are_not_taken(accepted: GainProposal, tmp_path: Path) -> None:
    gains = load_gains(save_gains(accepted, tmp_path / "gains.json"))
    with pytest.raises(rbi.ParameterError, match="manipulator"):
        gains.controller(manipulator(), rbi.Impedance(mass=1.0, damping=10.0, stiffness=20.0))


@pytest.mark.parametrize("text", ["", "{}", '{"format": 9}', '{"format": 2, "feasible": true}'])
def test_damaged_gains_file_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "gains.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(rbi.ModelError, match=r"gains\.json"):
        load_gains(path)


@pytest.mark.slow
def test_tune_writes_gains_that_run_reads(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, times = ("--out", str(tmp_path)), ("--dt", "0.004", "--duration", "2")
    assert call(monkeypatch, "tune", "two_link", "--payload", "1", *times, *out, "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert said["feasible"]
    assert (tmp_path / "worst_samples.png").stat().st_size > 0
    gains = ("--gains", str(tmp_path / "gains.json"), "--payload", "1", "--duration", "2")
    assert call(monkeypatch, "run", "two_link", *gains, "--json", *out) == 0
    metrics = json.loads(capsys.readouterr().out)["metrics"]
    assert max(metrics["e1_final"]) < 1e-3
    made_by = rbi.SimulationResult.load(tmp_path / "result.npz").provenance
    assert made_by["dt"] == 0.004
    assert made_by["controller"]["reaching"]["k2"] == said["k2"]


@pytest.mark.slow
def test_tune_that_finds_no_gains_is_exit_code_1_with_the_reason(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--payload", "8", "--delay", "4", "--dt", "0.02", "--out", str(tmp_path))
    assert call(monkeypatch, "tune", "two_link", *options) == 1
    printed = capsys.readouterr().out
    assert "No gains: joint" in printed
    assert "tried and " in printed


@pytest.mark.slow
def test_tune_with_limits_prints_what_each_joint_lacks(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--limits", "60,20", "--dt", "0.004", "--out", str(tmp_path))
    assert call(monkeypatch, "tune", "two_link", "--payload", "2", *options) == 1
    printed = capsys.readouterr().out
    assert "lacks [N·m]" in printed
    assert re.search(r"No gains: joint 'joint[12]' needs .* N·m with a payload of 2 kg", printed)


def test_tune_says_that_a_description_has_no_limits(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--limits", "urdf", "--out", str(tmp_path))
    assert call(monkeypatch, "tune", "two_link", *options) == 2
    assert "without effort limits" in capsys.readouterr().err
