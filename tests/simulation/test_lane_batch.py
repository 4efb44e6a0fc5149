"""`simulate_batch` with worlds that are alike, which it runs eight at once: each is still what `simulate` does."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.law.surfaces import FormulaSurface
from rbimpedance.simulation.closed_loop import LOGGED
from rbimpedance.simulation.compiled.lane_groups import LaneGroup
from rbimpedance.trajectories import cosine, hold

from .. import arms

pytestmark = pytest.mark.slow

CHANNELS = tuple(LOGGED)
SURFACES = (
    rbi.FastTerminalSurface(),
    rbi.PowerSurface(gamma=3.0, exponent=1.5),
    rbi.NonsingularTerminalSurface(beta=2.0, exponent=1.5),
)


@pytest.fixture
def groups(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Sizes of the groups that are run in lanes, block by block."""
    sizes: list[int] = []
    run = LaneGroup.run

    def counted(group: LaneGroup, block: range, members: Any, *rest: Any) -> Any:
        sizes.append(len(members))
        return run(group, block, members, *rest)

    monkeypatch.setattr(LaneGroup, "run", counted)
    return sizes


def build(arm: rbi.ArmModel, **changes: Any) -> rbi.ImpedanceController:
    parts: dict[str, Any] = {
        "impedance": rbi.Impedance(mass=1.0, damping=10.0, stiffness=20.0),
        "reaching": rbi.SuperTwisting(k1=8.0, k2=10.0),
        "dt": 1e-3,
    }
    return rbi.ImpedanceController(arm, **(parts | changes))


def worlds(arm: rbi.ArmModel, n: int, rng: np.random.Generator, **changes: Any) -> list[Any]:
    """Worlds that differ in all numbers."""
    near = [arm.integrate(arm.neutral, rng.uniform(-0.3, 0.3, arm.nv)) for _ in range(n)]
    return [
        {
            "controller": build(
                arm, **{"reaching": rbi.SuperTwisting(k1=rng.uniform(6.0, 9.0), k2=10.0)} | changes
            ),
            "plant": arm.with_payload(rng.uniform(0.1, 0.5)),
            "trajectory": cosine(arm, amplitude=rng.uniform(0.1, 0.3), period=0.5),
            "environment": rng.normal(size=6),
            "q0": near[i],
            "v0": 0.1 * rng.normal(size=arm.nv),
        }
        for i in range(n)
    ]


def assert_is_simulate(given: list[Any], stop: int | None = None, **settings: Any) -> Any:
    """Run worlds as a batch, and hold each to its own run."""
    listed: dict[str, Any] = {name: [world[name] for world in given] for name in given[0]}
    batch = rbi.simulate_batch(
        **listed, **settings, channels=CHANNELS, every=3, after=0.02, threads=2
    )
    for i, world in enumerate(given[:stop]):
        controller = world["controller"].with_backend("compiled")
        alone = rbi.simulate(**(world | {"controller": controller}), **settings)
        for name in CHANNELS:
            samples = getattr(alone, name)[::3].astype(float)
            size = max(1.0, float(np.abs(samples).max()))
            assert_allclose(batch[name][i], samples, rtol=0.0, atol=1e-12 * size, err_msg=name)
        assert_allclose(batch.q[i], alone.q[-1], rtol=0.0, atol=1e-12)
        assert_allclose(batch.v[i], alone.v[-1], rtol=0.0, atol=1e-12)
        figures = alone.metrics(after=0.02)
        for name, figure in batch.metrics.items():
            assert_allclose(figure[i], figures[name], rtol=1e-10, atol=1e-12, err_msg=name)
    return batch


def test_worlds_that_differ_in_all_numbers(groups: list[int], rng: np.random.Generator) -> None:
    assert_is_simulate(worlds(arms.manipulator(), 19, rng), duration=0.1)
    assert sorted(groups) == [8, 8]  # the last three are run alone


def test_a_group_that_is_not_full(groups: list[int], rng: np.random.Generator) -> None:
    assert_is_simulate(worlds(arms.manipulator(), 5, rng), duration=0.05, substeps=2)
    assert groups == [5]


def test_runs_longer_than_a_block(groups: list[int], rng: np.random.Generator) -> None:
    given = worlds(arms.manipulator(), 8, rng)
    assert_is_simulate(given, duration=0.3, substeps=20)
    assert groups == [8, 8]


@pytest.mark.parametrize("surface", SURFACES, ids=lambda x: type(x).__name__)
@pytest.mark.parametrize("scheme", ["explicit", "matched", "implicit"])
def test_every_surface_and_scheme(
    surface: Any, scheme: Any, groups: list[int], rng: np.random.Generator
) -> None:
    reaching = rbi.SuperTwisting(k1=8.0, k2=10.0, scheme=scheme)
    given = worlds(arms.manipulator(), 8, rng, surface=surface, reaching=reaching)
    assert_is_simulate(given, duration=0.05)
    assert groups == [8]


@pytest.mark.parametrize("friction", [(0.3, 0.0), (0.2, 0.5), (300.0, 0.0)])
def test_friction_dry_and_stiff(
    friction: tuple[float, float], groups: list[int], rng: np.random.Generator
) -> None:
    given = worlds(arms.manipulator(), 8, rng)
    for world in given:
        world["plant"] = world["plant"].with_friction(*friction)
    assert_is_simulate(given, duration=0.05)
    assert groups == [8]


def rising(i: int, t: float) -> NDArray[np.float64]:
    return np.full(6, 0.1 * i + t)


def test_walls_functions_of_time_and_coupled_targets(
    groups: list[int], rng: np.random.Generator
) -> None:
    arm = arms.manipulator()
    target = rbi.Impedance(mass=np.eye(6) + 0.1, damping=10.0 * np.eye(6), stiffness=20.0)
    given = worlds(arm, 8, rng, impedance=target)
    for i, world in enumerate(given):
        wall = rbi.Wall(arm.frame_placement(world["q0"])[1], [1.0, 1.0, 0.0], 300.0 + i, 5.0)
        torque = rbi.JointTorque(functools.partial(rising, i))
        world["environment"] = rbi.interaction.Sum(wall, torque)
    assert_is_simulate(given, duration=0.05)
    assert groups == [8]


def test_worlds_at_a_torque_limit_go_on_alone(groups: list[int], rng: np.random.Generator) -> None:
    arm = arms.manipulator()
    given = worlds(arm, 8, rng)
    largest = np.abs(rbi.simulate(**given[2], duration=0.05).tau).max(axis=0)
    for i in (2, 5):
        reaching, limits = given[i]["controller"].reaching, rbi.Limits(effort=0.8 * largest)
        given[i]["controller"] = build(arm, reaching=reaching, limits=limits)
    batch = assert_is_simulate(given, duration=0.05)
    assert groups == [8]
    assert batch["saturated"][2].any()


def test_a_world_that_diverges_leaves_the_others_as_they_are(
    groups: list[int], rng: np.random.Generator
) -> None:
    given = worlds(arms.manipulator(), 8, rng)
    given[7]["v0"] = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 5e3])
    batch = assert_is_simulate(given, stop=7, duration=0.05)
    assert groups == [8]
    with pytest.raises(rbi.DivergenceError) as alone:
        rbi.simulate(**given[7], duration=0.05)
    assert_array_equal(batch.diverged, [False] * 7 + [True])
    assert batch.divergence_joint[7] == alone.value.joint
    assert batch.divergence_time[7] == alone.value.result.t[-1]
    lost = round(batch.divergence_time[7] / 1e-3) // 3 + 1
    assert np.isfinite(batch["q"][7, :lost]).all()
    assert np.isnan(batch["q"][7, lost:]).all()
    assert np.isnan(batch.metrics["e1_max"][7]).all()


def test_unsound_inputs_are_refused(rng: np.random.Generator) -> None:
    given = worlds(arms.manipulator(), 8, rng)
    listed: dict[str, Any] = {name: [world[name] for world in given] for name in given[0]}
    listed["environment"] = [
        *listed["environment"][:7],
        lambda t: np.full(6, 1.0 if t < 0.02 else np.nan),
    ]
    with pytest.raises(rbi.NonFiniteError):
        rbi.simulate_batch(**listed, duration=0.05)


def linear_formula(e1: float, e2: float, dt: float, slope: float) -> tuple[float, float, float]:
    if e1 > 0.1:
        return e2 + slope * e1, slope * e2, 1.0 + slope * dt / 2.0
    return e2 + slope * e1, slope * e2, 1.0 + slope * dt / 2.0


class Linear(FormulaSurface):
    formula = staticmethod(linear_formula)
    slope = np.array(3.0)


def test_a_formula_with_conditions_of_its_own_is_run_one_by_one(
    groups: list[int], rng: np.random.Generator
) -> None:
    assert_is_simulate(worlds(arms.manipulator(), 8, rng, surface=Linear()), duration=0.05)
    assert groups == []


def test_arms_with_continuous_joints_are_run_one_by_one(
    groups: list[int], rng: np.random.Generator
) -> None:
    arm = arms.spinner()
    given = [world | {"trajectory": hold(arm)} for world in worlds(arm, 4, rng)]
    assert_is_simulate(given, duration=0.05)
    assert groups == []
