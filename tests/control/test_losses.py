"""Lost ticks: how many, in what bursts, and what the controller does meanwhile."""

from __future__ import annotations

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.control.losses import Losses, LossyController

ARM = rbi.load_robot("two_link")


def lost(losses: Losses, ticks: int = 20_000) -> list[bool]:
    remaining, flags = 0, []
    for tick in range(1, ticks):
        remaining = losses.remaining(remaining, tick)
        flags.append(remaining > 0)
    return flags


@pytest.mark.parametrize(("share", "burst"), [(0.05, 1), (0.1, 5), (0.2, 20)])
def test_share_and_longest_burst_are_those_asked_for(share: float, burst: int) -> None:
    flags = lost(Losses(share, burst, 3))
    runs = "".join("x" if flag else " " for flag in flags).split()
    assert np.mean(flags) == pytest.approx(share, rel=0.15)
    assert max(map(len, runs)) == burst


def test_share_that_such_bursts_cannot_reach_is_refused() -> None:
    with pytest.raises(rbi.ParameterError, match=r"from 0 to 0\.5"):
        Losses(0.6, 1)


def test_ticks_are_lost_alike_for_one_seed_and_otherwise_for_another() -> None:
    assert lost(Losses(0.1, 5, 1), 500) == lost(Losses(0.1, 5, 1), 500)
    assert lost(Losses(0.1, 5, 1), 500) != lost(Losses(0.1, 5, 2), 500)


@pytest.mark.parametrize("meanwhile", ["held", "zero"])
def test_torque_is_held_or_zero_while_ticks_are_lost(meanwhile: str) -> None:
    losses = Losses(0.2, 4, 0)
    made = LossyController(rbi.ImpedanceController(ARM, dt=1e-3), losses, meanwhile=meanwhile)  # type: ignore[arg-type]
    result = rbi.simulate(made, ARM.with_payload(0.3), rbi.trajectories.cosine(ARM), duration=0.3)
    flags, tau = lost(losses, 300), result.tau[1:]
    assert sum(flags) > 20
    for k in np.flatnonzero(flags[1:299]) + 1:
        wanted = tau[k - 1] if meanwhile == "held" else 0.0
        np.testing.assert_array_equal(tau[k], wanted)


def test_controller_is_told_the_time_that_passed() -> None:
    """With exact periods the impedance filter is where it is without losses, whatever was lost."""
    push = np.array([0.5, -0.2])
    inner = rbi.ImpedanceController(ARM, dt=1e-3)
    made = LossyController(inner, Losses(0.3, 5, 1))
    q = ARM.ready
    hold = rbi.Reference(q, np.zeros(2), np.zeros(2))
    state, exact, there = made.init(), inner.init(), None
    for _ in range(200):
        there, exact = inner.step(exact, q, np.zeros(2), hold, push)
        output, state = made.step(state, q, np.zeros(2), hold, push)
        if state.since == 0:
            np.testing.assert_allclose(output.q_e, there.q_e, rtol=1e-9, atol=1e-15)
    assert there is not None
    assert np.abs(there.q_e).max() > 1e-3
