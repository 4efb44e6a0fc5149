"""`CommandLimiter`: whichever commands arrive, and whenever, no step is larger than the robot takes."""

from __future__ import annotations

import numpy as np
import pytest

from rbimpedance.hardware import CommandLimiter, Conventions

TWO = Conventions(
    "two",
    ("a", "b"),
    period=1e-3,
    effort=[50.0, 10.0],
    torque_rate=1000.0,
    velocity=2.0,
    adds_gravity=True,
    adds_friction=False,
)
STEP = 1.0  # N·m in a cycle


def test_two_commands_in_one_cycle_together_step_no_further_than_one() -> None:
    limiter, applied = CommandLimiter(TWO), np.zeros(2)
    first, _ = limiter.limit(np.full(2, 30.0), applied)
    second, was_limited = limiter.limit(np.full(2, 30.0), applied)  # the robot reports no news yet
    assert was_limited
    assert (np.abs(second - applied) <= STEP).all()
    assert (np.abs(second - first) <= STEP).all()


@pytest.mark.parametrize("seed", range(5))
def test_no_step_is_too_large_whichever_commands_are_lost_or_late(seed: int) -> None:
    """A robot applies some commands, in order, up to three cycles late, and reports in single precision."""
    rng, limiter = np.random.default_rng(seed), CommandLimiter(TWO)
    applied, way, largest = np.zeros(2), [], 0.0
    for _ in range(1000):
        reported = applied.astype(np.float32).astype(float)
        command, _ = limiter.limit(rng.normal(0.0, 20.0, 2), reported)
        way.append(command)
        taken = int(rng.integers(0, min(len(way), 4) + 1))
        for command in way[:taken]:
            if rng.random() < 0.7:  # else it is lost
                largest = max(largest, float(np.abs(command - applied).max()))
                applied = command
        way = way[taken:]
    assert 0.5 * STEP < largest <= STEP


def test_answered_commands_move_by_the_full_step_in_every_cycle() -> None:
    limiter, applied = CommandLimiter(TWO), np.zeros(2)
    for _ in range(8):
        applied, _ = limiter.limit(np.full(2, 40.0), applied)
    np.testing.assert_allclose(applied, 8 * 0.99 * STEP)


def test_torque_stays_within_its_limit_and_arrives_unchanged_inside() -> None:
    limiter, applied = CommandLimiter(TWO), np.array([0.0, 9.5])
    command, was_limited = limiter.limit(np.array([0.5, 30.0]), applied)
    assert was_limited
    assert command[0] == 0.5
    assert command[1] <= 10.0
    command, was_limited = CommandLimiter(TWO).limit(np.array([0.3, 9.4]), applied)
    assert not was_limited
    np.testing.assert_array_equal(command, [0.3, 9.4])


def test_commands_on_their_way_are_the_delay_of_the_robot() -> None:
    rng, delay = np.random.default_rng(0), 3
    limiter, sent = CommandLimiter(TWO), [np.zeros(2)] * delay
    for _ in range(50):
        command, _ = limiter.limit(rng.normal(0.0, 0.1, 2), sent[-delay])
        sent.append(command)
    assert limiter.on_their_way == delay


def test_command_that_stays_the_same_is_not_on_its_way_for_long() -> None:
    limiter, still = CommandLimiter(TWO), np.full(2, 0.5)
    for _ in range(30):
        limiter.limit(still, still)
    assert limiter.on_their_way == 1
