"""Sampled plants lie in the stated ranges, extremes among them; sensors and actuators err as they are told to."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import ArrayLike

import rbimpedance as rbi
from rbimpedance._common.arrays import Array
from rbimpedance.control.controller import ControllerOutput
from rbimpedance.control.imperfect import ImperfectController, ImperfectState
from rbimpedance.tuning import Uncertainty

from ..arms import manipulator, pendulum, spinner

G, ROD, BOB = 9.81, 0.5, 2.0


class Seen(NamedTuple):
    """What the probe was shown at a tick."""

    q: Array
    v: Array
    tau_ext: Array


class Probe:
    """A controller that does nothing but remember its inputs; its torque is the velocity that it sees."""

    def __init__(self, arm: rbi.ArmModel) -> None:
        self.arm = arm
        self.dt = 1e-3

    def init(self) -> tuple[Seen, ...]:
        return ()

    def step(
        self,
        state: tuple[Seen, ...],
        q: ArrayLike,
        v: ArrayLike,
        reference: rbi.Reference,
        tau_ext: ArrayLike,
    ) -> tuple[ControllerOutput, tuple[Seen, ...]]:
        del reference
        seen = Seen(np.array(q), np.array(v), np.array(tau_ext))
        output: Any = dict.fromkeys(ControllerOutput._fields, np.zeros(self.arm.nv))
        return ControllerOutput(**(output | {"tau": seen.v})), (*state, seen)

    def impedance_error(self, output: ControllerOutput, a: Array) -> Array:
        del a
        return output.e1


def drive(
    controller: ImperfectController, ticks: int
) -> tuple[list[ControllerOutput], ImperfectState]:
    """Let the arm stand in neutral with v = tau_ext = k at tick k."""
    arm, state, outputs = controller.arm, controller.init(), []
    rest = rbi.Reference(arm.neutral, np.zeros(arm.nv), np.zeros(arm.nv))
    for k in range(ticks):
        signal = np.full(arm.nv, float(k))
        output, state = controller.step(state, arm.neutral, signal, rest, signal)
        outputs.append(output)
    return outputs, state


def test_one_number_stands_for_all_from_as_modelled_to_it() -> None:
    uncertainty = Uncertainty(payload=2.0, inertia_scale=0.9, viscous=0.3, torque_constant=0.1)
    np.testing.assert_array_equal(uncertainty.payload, [0.0, 2.0])
    np.testing.assert_array_equal(uncertainty.inertia_scale, [0.9, 1.0])
    np.testing.assert_array_equal(uncertainty.viscous, [0.0, 0.3])
    np.testing.assert_allclose(uncertainty.torque_constant, [0.9, 1.1])


def test_nothing_uncertain_gives_the_arm_itself() -> None:
    arm = manipulator()
    (sample,) = Uncertainty().sample(arm, 1)
    assert sample.plant.digest == arm.digest


def test_payload_adds_its_weight_at_its_lever() -> None:
    arm = pendulum()
    uncertainty = Uncertainty(payload=(1.5, 1.5), payload_com=(0.0, 0.0, -0.2))
    (sample,) = uncertainty.sample(arm, 1)
    q = 0.7
    expected = G * np.sin(q) * (BOB * ROD + 1.5 * (ROD + 0.2))
    np.testing.assert_allclose(sample.plant.bias([q], [0.0]), [expected], rtol=1e-12)


def test_payload_with_extent_turns_harder_and_weighs_the_same() -> None:
    """m·(l² + r²) about the pivot; a cube of edge a has m·a²/6 about its centre, r = a/√6."""
    arm, edge = pendulum(), 0.3
    radius = edge / np.sqrt(6.0)
    body = Uncertainty(payload=(1.5, 1.5), payload_gyration=(radius, radius))
    plant = body.sample(arm, 1)[0].plant
    q = np.array([0.7])
    wanted = (2.0 + 1.5) * 0.5**2 + 1.5 * edge**2 / 6.0
    assert plant.mass_matrix(q)[0, 0] == pytest.approx(wanted)
    zero = np.zeros(1)
    assert plant.bias(q, zero)[0] == pytest.approx(3.5 * 9.81 * 0.5 * np.sin(0.7))


def test_links_friction_and_rotors_enter_the_equation_of_motion() -> None:
    uncertainty = Uncertainty(
        inertia_scale=(1.3, 1.3), viscous=(0.4, 0.4), coulomb=(0.2, 0.2), armature=(0.1, 0.1)
    )
    (sample,) = uncertainty.sample(pendulum(), 1)
    q, v, a = 0.4, 2.0, -1.5
    inertia, weight = 1.3 * BOB * ROD**2 + 0.1, 1.3 * BOB * ROD * G * np.sin(q)
    friction = 0.4 * v + 0.2 * np.tanh(v / 0.05)
    np.testing.assert_allclose(
        sample.plant.inverse_dynamics([q], [v], [a]), [inertia * a + weight + friction], rtol=1e-12
    )


def test_unknown_friction_comes_on_top_of_the_arms_own() -> None:
    arm = manipulator()
    (sample,) = Uncertainty(viscous=(0.2, 0.2)).sample(arm, 1)
    np.testing.assert_allclose(sample.plant.viscous, arm.viscous + 0.2)
    np.testing.assert_array_equal(sample.plant.coulomb, arm.coulomb)


def test_first_samples_are_all_corners_of_the_ranges() -> None:
    uncertainty = Uncertainty(payload=(0.5, 2.0), inertia_scale=(0.9, 1.2), viscous=(0.0, 1.0))
    corners = {
        (s.payload, s.inertia_scale, float(s.viscous[0]))
        for s in uncertainty.sample(manipulator(), 8)
    }
    assert corners == {(m, f, d) for m in (0.5, 2.0) for f in (0.9, 1.2) for d in (0.0, 1.0)}


def test_samples_fill_the_ranges_and_never_leave_them() -> None:
    uncertainty = Uncertainty(payload=(0.5, 2.0), coulomb=(0.1, 0.4), torque_constant=0.1)
    samples = uncertainty.sample(spinner(), 100, seed=3)
    payloads = np.array([s.payload for s in samples])
    coulomb = np.array([s.coulomb for s in samples])
    constants = np.array([s.torque_constant for s in samples])
    assert payloads.min() == 0.5
    assert payloads.max() == 2.0
    assert np.histogram(payloads, bins=4)[0].min() >= 10
    assert ((coulomb >= 0.1) & (coulomb <= 0.4)).all()
    assert ((constants >= 0.9) & (constants <= 1.1)).all()


def test_longer_draw_begins_with_the_shorter_one() -> None:
    arm, uncertainty = manipulator(), Uncertainty(payload=2.0, inertia_scale=1.1)
    short, long = uncertainty.sample(arm, 6, seed=5), uncertainty.sample(arm, 12, seed=5)
    assert [s.plant.digest for s in short] == [s.plant.digest for s in long[:6]]


def test_another_seed_draws_other_plants() -> None:
    arm, uncertainty = manipulator(), Uncertainty(payload=2.0)
    first, second = (uncertainty.sample(arm, 6, seed=seed)[-1] for seed in (1, 2))
    assert first.payload != second.payload


def test_gravity_tilts_by_at_most_the_angle_and_keeps_its_size() -> None:
    arm = pendulum()
    angles = []
    for sample in Uncertainty(gravity_tilt=0.1).sample(arm, 20):
        gravity = sample.plant.model.gravity.linear
        np.testing.assert_allclose(np.linalg.norm(gravity), G, rtol=1e-12)
        angles.append(np.arccos(-gravity[2] / G))
    assert max(angles) == pytest.approx(0.1, rel=1e-9)


def test_torque_arrives_with_the_torque_constant() -> None:
    outputs, _ = drive(ImperfectController(Probe(pendulum()), torque_constant=[1.2]), 4)
    np.testing.assert_allclose([output.tau[0] for output in outputs], 1.2 * np.arange(4.0))


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_controller_sees_the_measurement_of_delay_ticks_ago(delay: int) -> None:
    _, state = drive(ImperfectController(Probe(pendulum()), delay=delay), 8)
    expected = np.maximum(np.arange(8.0) - delay, 0.0)
    np.testing.assert_array_equal([seen.v[0] for seen in state.inner], expected)
    np.testing.assert_array_equal([seen.tau_ext[0] for seen in state.inner], expected)


def test_noise_has_the_stated_deviation_and_no_mean() -> None:
    arm, ticks = manipulator(), 2000
    noisy = ImperfectController(Probe(arm), position_noise=1e-4, velocity_noise=1e-3, seed=1)
    _, state = drive(noisy, ticks)
    on_q = np.array([seen.q - arm.neutral for seen in state.inner])
    on_v = np.array([seen.v for seen in state.inner]) - np.arange(ticks)[:, None]
    for noise, deviation in ((on_q, 1e-4), (on_v, 1e-3)):
        count = noise.size
        assert noise.std() == pytest.approx(deviation, rel=5.0 / np.sqrt(2.0 * count))
        assert abs(noise.mean()) < 5.0 * deviation / np.sqrt(count)
        lag_one = np.mean(noise[1:] * noise[:-1]) / deviation**2
        assert abs(lag_one) < 5.0 / np.sqrt(count)


def test_noise_stays_on_the_manifold_of_continuous_joints() -> None:
    arm = spinner()
    _, state = drive(ImperfectController(Probe(arm), position_noise=0.3), 20)
    pairs = np.array([seen.q[:2] for seen in state.inner])
    np.testing.assert_allclose(np.linalg.norm(pairs, axis=1), 1.0, rtol=1e-12)
    assert pairs.std(axis=0).max() > 0.05


def test_step_is_pure_noise_included() -> None:
    noisy = ImperfectController(Probe(pendulum()), velocity_noise=0.1, delay=2)
    _, state = drive(noisy, 5)
    rest = rbi.Reference(np.zeros(1), np.zeros(1), np.zeros(1))
    first, second = (noisy.step(state, [0.1], [0.2], rest, [0.0]) for _ in range(2))
    np.testing.assert_array_equal(first[0].tau, second[0].tau)
    assert len(first[1].pending) == 2


def test_perfect_loop_leaves_the_controller_alone() -> None:
    probe = Probe(pendulum())
    assert Uncertainty(payload=1.0).sample(probe.arm, 1)[0].wrap(probe) is probe


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"payload": -1.0}, "payload"),
        ({"payload": (2.0, 1.0)}, "payload"),
        ({"payload": np.nan}, "payload"),
        ({"inertia_scale": 0.0}, "inertia_scale"),
        ({"viscous": (0.0, -1.0)}, "viscous"),
        ({"torque_constant": 1.5}, "torque_constant"),
        ({"gravity_tilt": -0.1}, "gravity_tilt"),
        ({"delay": 1.5}, "delay"),
        ({"delay": -1}, "delay"),
        ({"position_noise": (1e-4, 1e-3)}, "position_noise"),
    ],
)
def test_ranges_that_cannot_be_are_refused(settings: dict[str, Any], word: str) -> None:
    with pytest.raises(rbi.ParameterError, match=word):
        Uncertainty(**settings)


@pytest.mark.parametrize(
    "settings", [{"payload": (1.0, 2.0, 3.0)}, {"payload_com": (0.0, 1.0)}, {"viscous": "soft"}]
)
def test_ranges_of_the_wrong_kind_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(rbi.DimensionError):
        Uncertainty(**settings)


def test_range_for_another_number_of_joints_is_refused() -> None:
    with pytest.raises(rbi.DimensionError, match="viscous"):
        Uncertainty(viscous=([0.0, 0.0], [1.0, 1.0])).sample(pendulum(), 1)


def test_unknown_payload_frame_is_refused() -> None:
    with pytest.raises(rbi.ModelError, match="no_such"):
        Uncertainty(payload=1.0, payload_frame="no_such").sample(pendulum(), 1)


def test_sample_needs_at_least_one() -> None:
    with pytest.raises(rbi.ParameterError, match="count"):
        Uncertainty().sample(pendulum(), 0)
