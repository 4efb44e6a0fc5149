"""`simulate_batch`: world by world what `simulate` does."""

from __future__ import annotations

import threading
import time
from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import rbimpedance as rbi
from rbimpedance._numba import warn_once
from rbimpedance.simulation.closed_loop import LOGGED
from rbimpedance.trajectories import cosine, hold

from .. import arms

CHANNELS = tuple(LOGGED)


def build(arm: rbi.ArmModel, k1: float = 8.0, **changes: Any) -> rbi.ImpedanceController:
    parts: dict[str, Any] = {
        "impedance": rbi.Impedance(mass=1.0, damping=10.0, stiffness=20.0),
        "surface": rbi.FastTerminalSurface(rate=2.0, gamma=3.0, exponent=0.6, smoothing=1e-3),
        "reaching": rbi.SuperTwisting(k1=k1, k2=10.0, scheme="matched"),
        "dt": 1e-3,
    }
    return rbi.ImpedanceController(arm, **(parts | changes))


@pytest.fixture
def said(caplog: pytest.LogCaptureFixture) -> pytest.LogCaptureFixture:
    warn_once.cache_clear()
    return caplog


def worlds(arm: rbi.ArmModel, n: int, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Worlds that differ in everything."""
    wall = rbi.Wall(arm.frame_placement(arm.neutral)[1], [1.0, 1.0, 0.0], 500.0, 5.0)
    wrenches = [
        None,
        wall,
        rng.normal(size=6),
        lambda t: np.full(6, t),
        rbi.JointTorque(np.ones(arm.nv)),
    ]
    return [
        {
            "controller": build(arm, k1=rng.uniform(6.0, 9.0)),
            "plant": arm.with_payload(rng.uniform(0.1, 0.5)).with_friction(rng.uniform(0.0, 0.5)),
            "trajectory": cosine(arm, amplitude=rng.uniform(0.1, 0.3), period=0.5),
            "environment": wrenches[i % len(wrenches)],
            "q0": arm.random_configuration(rng),
            "v0": rng.normal(size=arm.nv),
        }
        for i in range(n)
    ]  # fmt: skip


def listed(given: list[dict[str, Any]]) -> dict[str, Any]:
    return {name: [world[name] for world in given] for name in given[0]}


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["semi-implicit", "rk4"])
@pytest.mark.parametrize("threads", [1, 2])
def test_batch_is_simulate_world_by_world(
    integrator: Any, threads: int, rng: np.random.Generator
) -> None:
    arm = arms.spinner()
    given = worlds(arm, 7, rng)
    settings: Any = {"duration": 0.1, "substeps": 2, "integrator": integrator}
    batch = rbi.simulate_batch(
        **listed(given), **settings, channels=CHANNELS, every=3, after=0.02, threads=threads
    )
    assert len(batch) == 7
    assert not batch.diverged.any()
    for i, world in enumerate(given):
        controller = world["controller"].with_backend("compiled")
        alone = rbi.simulate(**(world | {"controller": controller}), **settings)
        assert_array_equal(batch.t, alone.t[::3])
        for name in CHANNELS:
            assert_array_equal(batch[name][i], getattr(alone, name)[::3])
        assert_array_equal([*batch.q[i], *batch.v[i]], [*alone.q[-1], *alone.v[-1]])
        figures = alone.metrics(after=0.02)
        assert list(batch.metrics) == list(figures)[: len(batch.metrics)]
        for name, figure in batch.metrics.items():
            assert_allclose(figure[i], figures[name], rtol=1e-12, atol=1e-15)


def test_what_is_not_listed_is_shared_by_all_worlds(rng: np.random.Generator) -> None:
    arm = arms.manipulator()
    q0 = [arm.random_configuration(rng) for _ in range(3)]
    shared: Any = {"v0": np.full(6, 0.1), "environment": [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]}
    given = build(arm), arm, cosine(arm, amplitude=0.2, period=0.5)
    batch = rbi.simulate_batch(*given, q0=q0, **shared, duration=0.05, channels=("tau",))
    assert batch["tau"].shape == (3, 51, 6)
    for i in range(3):
        compiled = given[0].with_backend("compiled")
        alone = rbi.simulate(compiled, *given[1:], q0=q0[i], **shared, duration=0.05)
        assert_array_equal(batch["tau"][i], alone.tau)


def test_rows_of_wrenches_are_one_for_each_world() -> None:
    arm = arms.manipulator()
    wrenches = np.arange(12.0).reshape(2, 6)
    batch = rbi.simulate_batch(
        build(arm), arm, hold(arm), environment=wrenches, duration=0.01, channels=("tau_ext",)
    )
    expected = wrenches @ arm.jacobian(arm.neutral)
    assert_allclose(batch["tau_ext"][:, 0], expected, rtol=0.0, atol=1e-12)


def test_one_world_alone_is_a_batch_of_one() -> None:
    arm = arms.pendulum()
    batch = rbi.simulate_batch(build(arm), arm, hold(arm), duration=0.01)
    assert len(batch) == 1
    assert batch.channels == {}
    assert batch.metrics["e1_max"].shape == (1, 1)


def pull(size: float, t: float) -> list[float]:
    return [0.0, size * (t > 0.05), 0.0]


def test_a_world_that_diverges_is_marked_and_the_others_go_on() -> None:
    arm = arms.spinner()
    pulls = [0.0, 1e9, 0.0]
    wrench = [rbi.JointTorque(partial(pull, x)) for x in pulls]
    given: Any = build(arm, limits=20.0), arm, hold(arm)
    settings: Any = {"environment": wrench, "duration": 0.2, "every": 4}
    batch = rbi.simulate_batch(*given, **settings, channels=("v", "saturated"))
    with pytest.raises(rbi.DivergenceError) as caught:
        rbi.simulate(*given, environment=wrench[1], duration=0.2)
    assert batch.diverged.tolist() == [False, True, False]
    assert batch.divergence_time[1] == caught.value.time
    assert batch.divergence_joint == (None, caught.value.joint, None)
    assert np.isnan(batch.divergence_time[[0, 2]]).all()
    sound = batch.t <= caught.value.time
    assert_allclose(batch["v"][1, sound], caught.value.result.v[::4], rtol=1e-9, atol=1e-9)
    assert np.isnan(batch["v"][1, ~sound]).all()
    assert not batch["saturated"][1, ~sound].any()
    for figure in batch.metrics.values():
        assert np.isnan(figure[1]).all()
        assert not np.isnan(figure[[0, 2]]).any()
    assert_array_equal(batch["v"][0], batch["v"][2])


def test_worlds_without_a_compiled_form_run_beside_the_others(
    said: pytest.LogCaptureFixture,
) -> None:
    arm = arms.spinner()
    finite = build(arm, impedance=rbi.FiniteTimeImpedance(1.5, 10.0, 20.0, 0.7))
    batch = rbi.simulate_batch(
        [build(arm), finite, finite], arm, hold(arm, [0.0, 1.0, 0.2, 0.1]), duration=0.02,
        environment=[None, None, rbi.JointTorque([0.0, 1e12, 0.0])], channels=("tau",), every=7,
    )  # fmt: skip
    assert batch.diverged.tolist() == [False, False, True]
    alone = rbi.simulate(finite, arm, hold(arm, [0.0, 1.0, 0.2, 0.1]), duration=0.02)
    assert_array_equal(batch["tau"][1], alone.tau[::7])
    for name, figure in batch.metrics.items():
        assert_array_equal(figure[1], alone.metrics()[name])
        assert np.isnan(figure[2]).all()
    assert said.text.count("left to Python") == 1


@pytest.mark.slow
def test_other_threads_run_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    """While one call of a kernel simulates for long, this thread never waits for long."""
    from rbimpedance.simulation.compiled import world  # noqa: PLC0415 (needs Numba)

    arm = arms.manipulator()
    given: Any = build(arm), arm, hold(arm)
    rbi.simulate_batch(*given, duration=0.01)
    monkeypatch.setattr(world, "STEPS_AT_ONCE", 10**7)  # all in one block
    spans: list[float] = []

    def simulate() -> None:
        start = time.perf_counter()
        rbi.simulate_batch(*given, duration=4.0, substeps=150, threads=1, metrics=False)
        spans.append(time.perf_counter() - start)

    worker = threading.Thread(target=simulate)
    worker.start()
    longest, last = 0.0, time.perf_counter()
    while worker.is_alive():
        time.sleep(1e-4)
        now = time.perf_counter()
        longest, last = max(longest, now - last), now
    assert longest < spans[0] / 2.0


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"channels": ("torque",)}, rbi.ParameterError, "channels"),
        ({"every": 0}, rbi.ParameterError, "every"),
        ({"threads": 1.5}, rbi.ParameterError, "threads"),
        ({"after": 0.02}, rbi.ParameterError, "after"),
        ({"q0": np.zeros((2, 6)), "v0": np.zeros((3, 6))}, rbi.DimensionError, "q0"),
        ({"q0": np.zeros((2, 5))}, rbi.DimensionError, "q0"),
        ({"environment": []}, rbi.InputError, "wrench"),
        ({"trajectory": []}, rbi.DimensionError, "trajectory"),
        ({"trajectory": lambda _: (np.full(6, np.nan),) * 3}, rbi.NonFiniteError, "reference"),
    ],
)
def test_what_does_not_fit_is_refused(
    change: dict[str, Any], error: type[Exception], words: str
) -> None:
    arm = arms.manipulator()
    given: Any = {"controller": build(arm), "plant": arm, "trajectory": hold(arm), "duration": 0.02}
    with pytest.raises(error, match=words):
        rbi.simulate_batch(**(given | change))


def test_worlds_of_different_periods_or_sizes_are_refused() -> None:
    one, other = arms.manipulator(), arms.pendulum()
    slow = build(one, dt=2e-3)
    with pytest.raises(rbi.ParameterError, match=r"controller\[1\].dt"):
        rbi.simulate_batch([build(one), slow], one, hold(one), duration=0.02)
    with pytest.raises(rbi.DimensionError, match=r"plant\[1\]"):
        rbi.simulate_batch(
            [build(one), build(other)], [one, other], [hold(one), hold(other)], duration=0.02
        )
