"""Encoders: whole counts on the manifold, velocities from differences, and what both cost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance import QuantizedEncoders
from rbimpedance._common.arrays import Array
from rbimpedance.control.encoders import EncoderState
from rbimpedance.control.snapshot import fingerprint
from rbimpedance.simulation.plants import RigidPlant
from rbimpedance.tuning import ImperfectController

from .. import laws
from ..arms import manipulator, spinner

DT = 1e-3


def law(arm: rbi.ArmModel) -> rbi.ImpedanceController:
    return laws.controller(arm, dt=DT)


class Told:
    """A controller that keeps what it is told."""

    def __init__(self, arm: rbi.ArmModel) -> None:
        self.arm, self.dt = arm, DT
        self.q: list[Array] = []
        self.v: list[Array] = []
        self.tau_ext: list[Array] = []

    def init(self) -> None:
        return None

    def step(self, state: None, q: Any, v: Any, reference: Any, tau_ext: Any) -> tuple[Any, None]:
        del state, reference
        self.q.append(q)
        self.v.append(v)
        self.tau_ext.append(tau_ext)
        return None, None

    def impedance_error(self, output: Any, a: Array) -> Array:
        del output
        return a


def told(
    arm: rbi.ArmModel, angles: NDArray[np.floating[Any]], **settings: Any
) -> tuple[Array, Array]:
    """Positions and velocities that a controller is told on a motion of all joints alike."""
    inner: Any = Told(arm)
    encoders = QuantizedEncoders(inner, **settings)
    reference: Any = None
    state = encoders.init()
    for angle in angles:
        q = arm.integrate(arm.neutral, np.full(arm.nv, angle))
        v, tau_ext = np.full(arm.nv, 7.0), np.full(arm.nv, 0.1234567)
        _, state = encoders.step(state, q, v, reference, tau_ext)
        assert inner.tau_ext[-1] is tau_ext
    return np.array(inner.q), np.array(inner.v)


# --- positions ----------------------------------------------------------------------------------------------------


def test_position_is_the_nearest_whole_count_on_the_manifold() -> None:
    arm, counts = spinner(), np.array([2.0 * np.pi / 1000.0, 3e-3, 0.02])
    angles = np.linspace(-7.0, 7.0, 333)  # the continuous joint turns more than twice
    q, _ = told(arm, angles, resolution=counts)
    for angle, seen in zip(angles, q, strict=True):
        there = arm.integrate(arm.neutral, np.full(3, angle))
        assert (np.abs(arm.difference(there, seen)) <= counts / 2.0 + 1e-12).all()
        whole = arm.difference(arm.neutral, seen) / counts
        np.testing.assert_allclose(whole, np.rint(whole), atol=1e-9)


def test_count_that_divides_the_turn_has_no_seam() -> None:
    arm = spinner()
    fast = np.arange(2500) * 2.0 * np.pi / 1000.0  # a count a tick
    _, v = told(arm, fast, resolution=2.0 * np.pi / 1000.0)
    np.testing.assert_allclose(v[1:, 0], 2.0 * np.pi, rtol=1e-9)


# --- velocities ---------------------------------------------------------------------------------------------------


def test_velocity_is_the_difference_of_counts_and_zero_at_first() -> None:
    arm, count = manipulator(), 1e-4
    angles = 0.37 * DT * np.arange(200)
    _, v = told(arm, angles, resolution=count)
    by_hand = np.diff(np.rint(angles / count)) * count / DT
    np.testing.assert_array_equal(v[0], 0.0)
    np.testing.assert_allclose(v[1:, 0], by_hand, atol=1e-9)
    np.testing.assert_allclose(v[1:].mean(), 0.37, rtol=0.01)


@pytest.mark.parametrize("bandwidth", [None, 40.0])
def test_late_tick_gives_the_velocity_over_the_measured_period(bandwidth: float | None) -> None:
    """At a constant speed the velocity is that speed, whatever the periods; a low-pass forgets as they are long."""
    arm = manipulator()
    inner: Any = Told(arm)
    encoders = QuantizedEncoders(inner, resolution=1e-9, bandwidth=bandwidth)
    state, angle, zero = encoders.init(), 0.0, np.zeros(arm.nv)
    inner.elapsed = lambda state, _period: state
    reference: Any = None
    for period in (DT, 7.0 * DT, DT, 3.0 * DT):
        angle += 0.37 * period
        q = arm.integrate(arm.neutral, np.full(arm.nv, angle))
        _, state = encoders.step(state, q, zero, reference, zero, period)
    passed = 0.0 if bandwidth is None else np.exp(-2.0 * np.pi * bandwidth * 11.0 * DT)
    np.testing.assert_allclose(inner.v[-1], 0.37 * (1.0 - passed), rtol=1e-5)


def test_measured_velocity_passes() -> None:
    _, v = told(spinner(), np.linspace(0.0, 1.0, 20), velocity="measured")
    np.testing.assert_array_equal(v, 7.0)


@pytest.mark.slow
@pytest.mark.parametrize("bandwidth", [None, 50.0, 200.0])
def test_rounding_is_the_noise_that_it_is_said_to_be(bandwidth: float | None) -> None:
    arm, count = manipulator(), 1e-5
    angles = 0.5 * np.sin(0.7 * np.arange(6_000) * DT) + np.sqrt(2.0)
    exact: Any = Told(arm)
    encoders = QuantizedEncoders(exact, resolution=count, bandwidth=bandwidth)
    q, v = told(arm, angles, resolution=count, bandwidth=bandwidth)
    _, smooth = told(arm, angles, resolution=1e-13, bandwidth=bandwidth)
    off = np.array([arm.difference(arm.neutral, x)[0] for x in q]) - angles
    assert off.std() == pytest.approx(encoders.position_noise[0], rel=0.03)
    noise = (v - smooth)[1000:, 0].std()
    assert noise == pytest.approx(encoders.velocity_noise[0], rel=0.06)


@pytest.mark.parametrize("bandwidth", [None, 40.0])
@pytest.mark.parametrize("frequency", [5.0, 50.0])
def test_velocity_lags_by_the_phase_that_is_said(bandwidth: float | None, frequency: float) -> None:
    arm, omega = manipulator(), 2.0 * np.pi * frequency
    t = DT * np.arange(2000)
    _, v = told(arm, 0.1 * np.sin(omega * t), resolution=1e-12, bandwidth=bandwidth)
    late = slice(1000, None)  # a whole number of periods
    lag = -np.angle(np.mean(v[late, 0] * np.exp(-1j * omega * t[late])))  # of a cosine
    inner: Any = Told(arm)
    encoders = QuantizedEncoders(inner, bandwidth=bandwidth)
    assert float(encoders.phase_loss(frequency)) == pytest.approx(lag, abs=1e-6)


def test_measured_velocity_behind_no_filter_has_no_lag_and_no_noise() -> None:
    encoders = QuantizedEncoders(law(spinner()), velocity="measured")
    np.testing.assert_array_equal(encoders.phase_loss([1.0, 100.0]), 0.0)
    np.testing.assert_array_equal(encoders.velocity_noise, 0.0)


# --- in the loop --------------------------------------------------------------------------------------------------


def run(controller: Any, arm: rbi.ArmModel) -> rbi.SimulationResult:
    trajectory = rbi.trajectories.cosine(arm, amplitude=0.2, period=2.0)
    return rbi.simulate(controller, RigidPlant(arm), trajectory, duration=0.3)


def test_fine_encoders_are_none() -> None:
    arm = spinner()
    bare = run(law(arm), arm)
    fine = run(QuantizedEncoders(law(arm), resolution=1e-12, velocity="measured"), arm)
    np.testing.assert_allclose(fine.q, bare.q, atol=1e-9)
    coarse = run(QuantizedEncoders(law(arm), resolution=1e-3, velocity="measured"), arm)
    assert np.abs(coarse.q - bare.q).max() > 1e-6


def test_encoders_and_delay_compose() -> None:
    arm = spinner()
    late = ImperfectController(QuantizedEncoders(law(arm), resolution=1e-4), delay=2)
    counted = QuantizedEncoders(ImperfectController(law(arm), delay=2), resolution=1e-4)
    a, b = run(late, arm), run(counted, arm)
    assert a.provenance["controller"]["controller"]["type"] == "QuantizedEncoders"
    assert b.provenance["controller"]["type"] == "QuantizedEncoders"
    np.testing.assert_array_equal(a.e1[3], b.e1[3])  # positions are counted, then late, either way


def test_step_is_pure_and_its_state_is_kept_in_snapshots(tmp_path: Path) -> None:
    arm = spinner()
    encoders = QuantizedEncoders(law(arm), resolution=1e-4, bandwidth=50.0)
    reference = rbi.trajectories.cosine(arm, amplitude=0.2, period=2.0)(0.0)
    state: EncoderState = encoders.init()
    q, rest = arm.integrate(arm.neutral, [0.1, 0.02, 0.3]), np.zeros(3)
    for _ in range(3):
        q = arm.integrate(q, [1e-3, 2e-4, -1e-3])
        first, following = encoders.step(state, q, rest, reference, rest)
        again, _ = encoders.step(state, q, rest, reference, rest)
        assert first.tau.tobytes() == again.tau.tobytes()
        state = following
    rbi.save_snapshot(tmp_path / "state", encoders, state)
    loaded = rbi.load_snapshot(tmp_path / "state", encoders)
    assert loaded.q is not None
    assert state.q is not None
    assert loaded.q.tobytes() == state.q.tobytes()
    assert fingerprint(encoders) != fingerprint(QuantizedEncoders(law(arm), resolution=1e-4))


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"resolution": 0.0}, "resolution must be positive"),
        ({"resolution": np.nan}, "resolution must be positive"),
        ({"velocity": "guessed"}, "velocity must be"),
        ({"bandwidth": -1.0}, "cutoff must be a positive"),
    ],
)
def test_parameter_that_cannot_be_is_refused(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(rbi.ParameterError, match=words):
        QuantizedEncoders(law(spinner()), **settings)


def test_resolution_for_another_arm_is_refused() -> None:
    with pytest.raises(rbi.DimensionError, match="resolution"):
        QuantizedEncoders(law(spinner()), resolution=[1e-4, 1e-4])


def test_input_that_is_not_finite_is_refused() -> None:
    arm = spinner()
    encoders = QuantizedEncoders(law(arm))
    reference = rbi.trajectories.cosine(arm, amplitude=0.2, period=2.0)(0.0)
    with pytest.raises(rbi.NonFiniteError):
        encoders.step(encoders.init(), arm.neutral, [np.nan, 0.0, 0.0], reference, np.zeros(3))
