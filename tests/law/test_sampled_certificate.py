"""The certificate of the sampled loop holds against plants as bad as it allows, and its check refuses a false proof."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rbimpedance.exceptions import DimensionError, ParameterError
from rbimpedance.law.sampled_certificate import SampledCertificate, certify_sampled
from rbimpedance.law.sampled_sets import Sets, law, slopes
from rbimpedance.law.super_twisting import SuperTwisting
from rbimpedance.law.surfaces import FastTerminalSurface, PowerSurface

from .sampled_plants import adversarial_errors

GAINS = np.array(
    [[[0.85, 0.05], [0.1, 0.9]], [[1.15, -0.05], [-0.1, 1.1]], [[1.1, 0.05], [-0.1, 0.9]]]
)
K2 = np.array([30.0, 60.0])
K1 = 2.2 * np.sqrt(K2 / 0.8)
RATE = np.array([1.5, 3.0])
GENTLE = FastTerminalSurface(smoothing=0.1)


def _certified(margin: float = 1.3, **options: Any) -> SampledCertificate:
    given: dict[str, Any] = {"surface": GENTLE, "dt": 1e-3, "margin": margin} | options
    return certify_sampled(K1, K2, [GAINS], RATE, **given)


@pytest.fixture(scope="module")
def certificate() -> SampledCertificate:
    return _certified()


@pytest.mark.slow
def test_no_adversarial_run_leaves_the_bounds(certificate: SampledCertificate) -> None:
    reaching = SuperTwisting(K1, K2, "matched", 1.3)
    worst_e1, worst_s = np.zeros(2), np.zeros(2)
    for seed in range(4):
        e1, s = adversarial_errors(reaching, GENTLE, 1e-3, GAINS, RATE, seed=seed, ticks=800)
        worst_e1, worst_s = np.maximum(worst_e1, abs(e1).max(0)), np.maximum(worst_s, abs(s).max(0))
    assert certificate.feasible
    assert (worst_e1 <= certificate.e1_bound).all()
    assert (worst_s <= certificate.s_bound).all()
    assert (certificate.s_bound <= 10.0 * worst_s).all()  # a bound, and not one of no use


@pytest.mark.slow
def test_the_peak_holds_from_the_start(certificate: SampledCertificate) -> None:
    pushed = _certified(disturbance=[0.2, 0.3], e0=1e-4)
    reaching = SuperTwisting(K1, K2, "matched", 1.3)
    assert pushed.share == 1.0
    late = int(pushed.settling_time / 1e-3) + 1
    for seed in range(3):
        start: dict[str, Any] = {"disturbance": 0.2, "e0": 1e-4, "seed": seed, "ticks": late + 300}
        e1, _ = adversarial_errors(reaching, GENTLE, 1e-3, GAINS, RATE, **start)
        assert (abs(e1).max(0) <= pushed.e1_peak).all()
        assert (abs(e1[late:]).max(0) <= pushed.e1_bound).all()
    assert (pushed.e1_peak > certificate.e1_peak).all()


@pytest.mark.slow
@pytest.mark.parametrize(("delay", "lost", "margin"), [(0, 1, 4.0), (1, 0, 8.0)])
def test_late_and_lost_ticks_stay_within_the_bounds(delay: int, lost: int, margin: float) -> None:
    late = _certified(margin, delay=delay, lost=lost)
    reaching = SuperTwisting(K1, K2, "matched", margin)
    assert late.feasible, late.reason
    for seed in range(6):
        loop = {"delay": delay, "lost": lost, "seed": seed, "ticks": 2000}
        e1, s = adversarial_errors(reaching, GENTLE, 1e-3, GAINS, RATE, **loop)
        assert (abs(e1).max(0) <= late.e1_bound).all()
        assert (abs(s).max(0) <= late.s_bound).all()


@pytest.mark.slow
def test_a_loop_that_fails_is_not_certified() -> None:
    """With margin 1.3 and three ticks of delay the loop oscillates."""
    reaching = SuperTwisting(K1, K2, "matched", 1.3)
    e1, _ = adversarial_errors(reaching, GENTLE, 1e-3, GAINS, RATE, delay=3, ticks=800)
    calm, _ = adversarial_errors(reaching, GENTLE, 1e-3, GAINS, RATE, ticks=800)
    assert abs(e1).max() > 5.0 * abs(calm).max()
    late = _certified(delay=3)
    assert not late.feasible
    assert "joint" in late.reason


@pytest.mark.slow
def test_the_whole_proof_is_verified_and_a_tampered_one_refused(
    certificate: SampledCertificate,
) -> None:
    assert certificate.is_verified(whole=True)
    last = certificate.tube[-1]
    for i in (0, 5, 11):
        support = last.sets.support.copy()
        support[0, i] *= 0.999
        tampered = last._replace(sets=Sets(support, last.sets.scale))
        tube = (*certificate.tube[:-1], tampered)
        assert not replace(certificate, tube=tube).is_verified()
    for name in ("s", "e1", "a", "speed"):
        tampered = last._replace(**{name: 0.5 * getattr(last, name)})
        tube = (*certificate.tube[:-1], tampered)
        assert not replace(certificate, tube=tube).is_verified()
    assert "NOT verified" in replace(certificate, tube=tube).explain()


@pytest.mark.slow
def test_a_tampered_tick_on_the_way_is_refused(certificate: SampledCertificate) -> None:
    tube = list(certificate.tube)
    tube[3] = tube[3]._replace(sets=Sets(0.999 * tube[3].sets.support, tube[3].sets.scale))
    assert not replace(certificate, tube=tuple(tube)).is_verified(whole=True)


def test_the_law_in_its_units_is_the_scheme() -> None:
    reaching = SuperTwisting(13.0, 35.0, "matched", 1.7)
    H, s = 1.7e-3, np.geomspace(1e-9, 1.0, 50)
    u, after = reaching.step(s, reaching.start(s), 1e-3)
    y, p = law(s / (H**2 * 35.0), 13.0 / np.sqrt(35.0))
    np.testing.assert_allclose(H * 35.0 * y, u, rtol=1e-12)
    np.testing.assert_allclose(1e-3 * p, after.z, rtol=1e-12)


@pytest.mark.parametrize("kappa", [0.1, 1.0, 2.2, 5.0])
def test_both_parts_of_the_law_are_concave(kappa: float) -> None:
    s = np.geomspace(1e-8, 1e6, 4000)
    for values, rates in zip(law(s, kappa), slopes(s, kappa), strict=True):
        assert (np.diff(rates) < 0.0).all()
        chords = np.diff(values) / np.diff(s)
        assert (chords <= rates[:-1] * (1 + 1e-6)).all()
        assert (chords >= rates[1:] * (1 - 1e-6)).all()


@pytest.mark.slow
def test_the_impedance_error_is_bounded_by_its_parts(certificate: SampledCertificate) -> None:
    bound = certificate.impedance_bound(1.0, 10.0, 20.0)
    parts = certificate.e3_bound + 10.0 * certificate.e2_bound + 20.0 * certificate.e1_bound
    np.testing.assert_allclose(bound, parts)


def test_what_cannot_be_certified_says_why() -> None:
    wrong = certify_sampled(K1, K2, [-GAINS], RATE, surface=GENTLE, dt=1e-3)
    assert "wrong way round" in wrong.explain()
    steep = certify_sampled(K1, K2, [GAINS], RATE, surface=FastTerminalSurface(), dt=0.02)
    assert "too steep" in steep.reason
    with pytest.raises(ParameterError, match="FastTerminalSurface"):
        certify_sampled(K1, K2, [GAINS], RATE, surface=PowerSurface(3.0, 1.5), dt=1e-3)  # type: ignore[arg-type]
    with pytest.raises(DimensionError, match="gains"):
        certify_sampled(K1, K2, [GAINS[0]], RATE, surface=GENTLE, dt=1e-3)
