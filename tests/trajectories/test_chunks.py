"""`ChunkReference`: chunks that arrive late and re-anchor become a motion without jumps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance._common.arrays import Array
from rbimpedance.trajectories import ChunkReference

ARM = rbi.load_robot("two_link")
RATE, SAMPLES = 15.0, 16  # chunks a second, and samples in each, 1/RATE apart
START = np.array([0.3, -0.4])


def path(t: Array | float) -> Array:
    """Where the policy wants to go."""
    t = np.asarray(t)[..., None]
    return START + np.array([0.3, 0.25]) * (1.0 - np.cos(np.array([1.1, 1.7]) * t))


def stream(seed: int, duration: float, anchored: float) -> list[tuple[Array, Array, float]]:
    """Chunks (t, q, arrival): 50 ms late ± 50 ms; every second the policy anchors its path anew."""
    rng, offset, chunks = np.random.default_rng(seed), np.zeros(2), []
    for k in range(int(duration * RATE)):
        begin = k / RATE
        if k % int(RATE) == int(RATE) - 1:
            offset = anchored * rng.choice([-1.0, 1.0], 2)
        t = begin + np.arange(SAMPLES) / RATE
        chunks.append((t, path(t) + offset, begin + rng.uniform(0.0, 0.1)))
    return sorted(chunks, key=lambda chunk: chunk[2])


def followed(chunks: list[tuple[Array, Array, float]]) -> ChunkReference:
    reference = ChunkReference(ARM, START)
    for chunk in chunks:
        reference.update(*chunk)
    return reference


def linear(chunks: list[tuple[Array, Array, float]]) -> Callable[[float], rbi.Reference]:
    """Linear interpolation of the newest chunk."""

    def reference(t: float) -> rbi.Reference:
        here = [chunk for chunk in chunks if chunk[2] <= t]
        if not here:
            return rbi.Reference(START, np.zeros(2), np.zeros(2))
        times, q, _ = here[-1]
        i = int(np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2))
        v = (q[i + 1] - q[i]) / (times[i + 1] - times[i])
        return rbi.Reference(q[i] + (t - times[i]) * v, v, np.zeros(2))

    return reference


def torque_for(r: rbi.Reference) -> Array:
    """What a stiff controller (30 rad/s) asks of an arm that rests at the start."""
    return ARM.inverse_dynamics(r.q, r.v, r.a + 900.0 * (r.q - START) + 60.0 * r.v)


def torque_step(reference: Callable[[float], rbi.Reference]) -> float:
    """Largest change of a joint's torque from tick to tick, by the model [N·m]."""
    tau = np.array([torque_for(reference(float(t))) for t in np.arange(0.5, 3.0, 1e-3)])
    return float(np.abs(np.diff(tau, axis=0)).max())


def test_reference_follows_the_path_of_chunks_that_agree_within_a_milliradian() -> None:
    reference = followed(stream(0, 5.0, anchored=0.0))
    t = np.arange(1.0, 4.9, 5e-3)
    error = np.array([reference(float(x)).q for x in t]) - path(t)
    assert np.abs(error).max() < 1e-3


def test_velocity_and_acceleration_are_the_derivatives_of_the_position() -> None:
    reference = followed(stream(1, 3.0, anchored=0.05))
    h = 1e-5
    for t in np.random.default_rng(0).uniform(0.2, 2.8, 40):
        before, now, after = (reference(float(t + dt)) for dt in (-h, 0.0, h))
        np.testing.assert_allclose((after.q - before.q) / (2.0 * h), now.v, atol=1e-4)
        np.testing.assert_allclose((after.v - before.v) / (2.0 * h), now.a, atol=2e-2)


def test_nothing_jumps_where_chunks_re_anchor() -> None:
    reference = followed(stream(2, 3.0, anchored=0.07))
    samples = [reference(float(t)) for t in np.arange(0.5, 3.0, 1e-3)]
    a = np.array([each.a for each in samples])
    assert np.abs(np.diff(a, axis=0)).max() / 1e-3 < 3.0 * 200.0  # jerk: three gaps at once


def test_gap_after_a_new_anchor_is_closed_in_its_time() -> None:
    t, q = np.arange(0.0, 2.0, 0.1), path(np.arange(0.0, 2.0, 0.1))
    reference = ChunkReference(ARM, START, jerk=np.inf)
    reference.update(t, q, 0.0)
    reference.update(t, q + 0.05, 1.0)
    np.testing.assert_allclose(reference(1.0).q, path(1.0), atol=1e-4)
    np.testing.assert_allclose(reference(1.0 + reference.blend).q, path(1.15) + 0.05, atol=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_torque_steps_are_ten_times_smaller_than_with_linear_interpolation(seed: int) -> None:
    chunks = stream(seed, 3.0, anchored=0.05)
    assert torque_step(followed(chunks)) < 0.1 * torque_step(linear(chunks))


def test_motion_comes_to_rest_where_chunks_fail_to_come() -> None:
    t = np.arange(0.0, 0.5, 0.1)
    reference = ChunkReference(ARM, START)
    reference.update(t, path(t), 0.0)
    late = reference(float(t[-1]) + reference.stop)
    np.testing.assert_allclose(late.v, 0.0, atol=1e-12)
    np.testing.assert_allclose(reference(100.0).q, late.q, atol=1e-12)
    speeds = [reference(float(x)).v for x in np.arange(0.0, 1.0, 1e-3)]
    assert np.abs(np.diff(speeds, axis=0)).max() < 0.05


def test_chunk_from_the_future_begins_with_its_first_sample() -> None:
    reference = ChunkReference(ARM, START)
    reference.update([1.0, 1.1, 1.2], np.tile(START + 0.1, (3, 1)), 0.0)
    np.testing.assert_array_equal(reference(0.9).q, START)
    np.testing.assert_allclose(reference(2.0).q, START + 0.1)


def test_refused_chunks_leave_the_reference_as_it_was() -> None:
    t = np.arange(0.0, 1.0, 0.1)
    reference = ChunkReference(ARM, START)
    reference.update(t, path(t), 0.0)
    before = reference(0.5)
    with pytest.raises(rbi.InputError, match="nothing of the chunk is left"):
        reference.update(t, path(t), 2.0)
    with pytest.raises(rbi.InputError, match="one after the other"):
        reference.update(t, path(t), -1.0)
    with pytest.raises(rbi.NonFiniteError):
        reference.update(t, np.nan * path(t), 0.3)
    with pytest.raises(rbi.ParameterError, match="strictly increasing"):
        reference.update(t[::-1] + 1.0, path(t), 0.3)
    np.testing.assert_array_equal(reference(0.5).q, before.q)
