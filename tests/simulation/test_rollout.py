"""`simulate` by the backend of the controller, compared with "numpy", which specifies the loop."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance import interaction
from rbimpedance._numba import warn_once
from rbimpedance.control.telemetry import FLAGS
from rbimpedance.simulation import closed_loop
from rbimpedance.simulation import run as single
from rbimpedance.simulation.joint_stops import JointStops
from rbimpedance.trajectories import SampledTrajectory, cosine, hold, samples, waypoints

from .. import arms
from ..isolation import fresh_python
from ..laws import smooth as build

Array = NDArray[np.float64]
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")
CHANNELS = ("t", *closed_loop.LOGGED)


def load(name: str) -> rbi.ArmModel:
    return rbi.load_robot("panda", lock=FINGERS) if name == "panda" else rbi.load_robot(name)


def readable(
    controller: rbi.ImpedanceController, *given: Any, **settings: Any
) -> rbi.SimulationResult:
    """The run by the form that specifies all others, ticks included."""
    standard: Any = {"substeps": 4, "integrator": "semi-implicit"}
    loop = single.closed_loop(controller.with_backend("numpy"), *given, **(standard | settings))
    return closed_loop.run(loop)


def simulate(
    controller: rbi.ImpedanceController, *given: Any, backend: Any, **settings: Any
) -> rbi.SimulationResult:
    """The run by a backend."""
    return rbi.simulate(controller.with_backend(backend), *given, **settings)


def assert_same(one: rbi.SimulationResult, other: rbi.SimulationResult, bound: float) -> None:
    """Equal in every channel, relative to the channel's largest entry."""
    for name in CHANNELS:
        mine, truth = (np.asarray(getattr(x, name), dtype=np.float64) for x in (one, other))
        assert_allclose(mine, truth, rtol=0.0, atol=bound * max(np.abs(truth).max(), 1.0))


@pytest.fixture
def said(caplog: pytest.LogCaptureFixture) -> pytest.LogCaptureFixture:
    warn_once.cache_clear()
    return caplog


# --- the same run --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["pinocchio", "compiled"])
@pytest.mark.parametrize("name", ["two_link", "panda", "ur5", "kinova"])
def test_fast_run_is_the_readable_run(
    name: str, backend: Any, said: pytest.LogCaptureFixture, rng: np.random.Generator
) -> None:
    """A heavier plant with friction, swung about and pushed at the tool; kinova has continuous joints."""
    arm = load(name)
    plant = arm.with_payload(0.5).with_friction(0.2, 0.3)
    motion = cosine(arm, amplitude=0.3, period=rng.uniform(1.0, 2.0, arm.nv))
    given = build(arm), plant, motion
    settings: Any = {"environment": lambda t: [np.sin(9.0 * t), 1.0, -2.0, 0.1, 0.0, 0.2]}
    settings |= {"duration": 0.2, "substeps": 2, "v0": rng.normal(size=arm.nv) / 10.0}
    run = simulate(*given, **settings, backend=backend)
    assert_same(run, readable(*given, **settings), 1e-10)
    assert run.tau_ext.any()
    assert "left to Python" not in said.text


ENVIRONMENTS: dict[str, Any] = {
    "wrench": [1.0, -2.0, 3.0, 0.1, 0.2, -0.3],
    "local": rbi.FrameWrench([1.0, -2.0, 3.0, 0.1, 0.2, -0.3], expressed_in="local"),
    "at a link": rbi.FrameWrench(lambda t: np.full(6, t), "carriage"),
    "at the base": rbi.FrameWrench(np.ones(6), "universe"),
    "joint torque": rbi.JointTorque([1.0, 2.0, -0.5]),
    "push": rbi.interaction.Push(
        [4.0, 0.0, 0.0, 0.0, 1.0, 0.0], start=0.02, duration=0.1, rise=0.03
    ),
    "wall": "still",
    "moving wall": "moving",
    "sum": rbi.interaction.Sum(
        rbi.interaction.Sum(rbi.JointTorque(lambda t: [t, 0.0, 1.0]), rbi.FrameWrench(np.ones(6))),
        rbi.interaction.Push([4.0, 0.0, 0.0, 0.0, 1.0, 0.0], start=0.0, duration=0.2),
    ),
}


def environment(name: str, arm: rbi.ArmModel) -> Any:
    """A wall stands just behind the tool, so that the swing presses on it."""
    given = ENVIRONMENTS[name]
    if given not in ("still", "moving"):
        return given
    point = arm.frame_placement(arm.neutral)[1] - 1e-3
    moves = (lambda t: 0.01 * np.sin(40.0 * t)) if given == "moving" else None
    return rbi.Wall(point, [1.0, 1.0, 1.0], 900.0, 20.0, displacement=moves)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("backend", "integrator"),
    [("pinocchio", "semi-implicit"), ("compiled", "semi-implicit"), ("compiled", "rk4")],
)
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_environment_pushes_as_in_the_readable_run(
    name: str, backend: Any, integrator: Any
) -> None:
    """A continuous, a sliding and an oblique joint."""
    arm = arms.spinner()
    given = build(arm), arm.with_payload(0.3), cosine(arm, amplitude=0.2, period=0.3)
    settings: Any = {"environment": environment(name, arm), "duration": 0.15, "substeps": 3}
    settings |= {"integrator": integrator}
    run = simulate(*given, **settings, backend=backend)
    assert_same(run, readable(*given, **settings), 1e-10)
    is_pushed = run.tau_ext.any(axis=1)
    assert is_pushed.any() == (name != "at the base")
    if "wall" in name:
        assert not is_pushed.all()  # it comes and goes


LAWS: dict[str, dict[str, Any]] = {
    "explicit, power": {
        "surface": rbi.PowerSurface(3.0, 1.5),
        "reaching": rbi.SuperTwisting(k1=8.0, k2=10.0, scheme="explicit"),
    },
    "implicit, nonsingular": {
        "surface": rbi.NonsingularTerminalSurface(1.5, 1.6),
        "reaching": rbi.SuperTwisting(k1=8.0, k2=10.0, scheme="implicit"),
    },
    "coupled impedance": {
        "impedance": rbi.Impedance(np.eye(3) + 0.1, 10.0 * np.eye(3) + 0.3, damping_ratio=None, stiffness=20.0)
    },
    "mass only": {"model": "inertia"},
    "limits": {"limits": [3.0, 18.0, 4.0]},
    "limited rate": {"limits": rbi.Limits(rate=[50.0, 2000.0, 50.0])},
    "bounded surface": {"surface": rbi.BoundedSurface(rbi.FastTerminalSurface(2.0, 3.0, 0.6), 1e-3)},
    "compiled controller": {"backend": "compiled"},
}  # fmt: skip


def held_back_by(law: dict[str, Any]) -> set[str]:
    """Flags that one of the laws above raises."""
    limits = law.get("limits")
    flags = {"rate_limited" if isinstance(limits, rbi.Limits) else "saturated"} if limits else set()
    return flags | ({"clipped"} if isinstance(law.get("surface"), rbi.BoundedSurface) else set())


@pytest.mark.parametrize("backend", ["pinocchio", "compiled"])
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_every_law_runs_as_in_the_readable_form(law: dict[str, Any], backend: Any) -> None:
    arm = arms.spinner()
    given = build(arm, **law), arm.with_payload(0.3), hold(arm, [0.0, 1.0, 0.4, 0.3])
    settings: Any = {
        "environment": [3.0, -2.0, 1.0, 0.1, 0.2, -0.3],
        "duration": 0.1,
        "substeps": 1,
    }
    run = simulate(*given, **settings, backend=backend)
    assert_same(run, readable(*given, **settings), 1e-10)
    assert {name for name in FLAGS if getattr(run, name).any()} == held_back_by(law)


def test_stiff_friction_is_taken_at_the_end_of_the_step() -> None:
    arm = arms.spinner()
    plant = arm.with_friction(2000.0, 5.0)
    given = build(arm), plant, cosine(arm, amplitude=0.2, period=0.3)
    settings: Any = {"duration": 0.1, "substeps": 1, "v0": [1.0, 1.0, 1.0]}
    run = simulate(*given, **settings, backend="compiled")
    assert_same(run, readable(*given, **settings), 1e-10)
    assert np.abs(run.v[-1]).max() < 1.0


@pytest.mark.parametrize(
    ("backend", "integrator"),
    [("pinocchio", "semi-implicit"), ("compiled", "semi-implicit"), ("compiled", "rk4")],
)
def test_joints_meet_their_stops_as_in_the_readable_run(
    backend: Any, integrator: Any, said: pytest.LogCaptureFixture
) -> None:
    """A continuous, a sliding and an oblique joint, each thrown at a stop on either side of where it begins."""
    arm = arms.spinner()
    plant, side = arm.with_payload(0.3), np.array([1.0, -1.0, 1.0])
    bound = np.full(3, 0.01)
    stops = JointStops(-bound, bound, stiffness=4e5 * bound, damping=900.0 * bound)
    for v0 in (side, -side):
        given = build(arm), plant, hold(arm)
        settings: Any = {"v0": 2.0 * v0, "duration": 0.05, "joint_stops": stops, "q0": arm.zero}
        run = simulate(*given, **settings, backend=backend, integrator=integrator)
        truth = readable(*given, **settings, integrator=integrator)
        assert_same(run, truth, 1e-12)
        assert_allclose(run.tau_stop, truth.tau_stop, atol=1e-10)
        assert (run.tau_stop * v0 < 0.0).any(axis=0).all()
    assert "left to Python" not in said.text


def test_joint_that_follows_another_runs_around_pinocchio_as_in_the_readable_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The compiled tables have no such joint; without a force at a frame none of them is needed."""
    arm = rbi.load_robot("panda", armature=0.1)
    plant = arm.with_payload(0.3).with_friction(0.2, 0.3)
    given = build(arm), plant, cosine(arm, amplitude=0.1, period=1.0, check_limits=False)
    settings: Any = {"environment": rbi.JointTorque(np.ones(arm.nv)), "duration": 0.1}
    settings["joint_stops"] = JointStops.at_limits(arm, 2.5e-4)
    truth = readable(*given, **settings)
    monkeypatch.setattr(single, "run", None)
    run = simulate(*given, **settings, backend="pinocchio")
    assert arm.nv == 8
    assert_same(run, truth, 1e-12)


def test_run_does_not_depend_on_where_its_blocks_end(monkeypatch: pytest.MonkeyPatch) -> None:
    from rbimpedance.simulation.compiled import world  # noqa: PLC0415 (needs Numba)

    arm = arms.spinner()
    given = build(arm), arm.with_payload(0.3), cosine(arm, amplitude=0.2, period=0.3)
    settings: Any = {"environment": lambda t: np.full(6, t), "duration": 0.1, "substeps": 2}
    whole = simulate(*given, **settings, backend="compiled")
    told: list[tuple[int, int]] = []
    monkeypatch.setattr(world, "STEPS_AT_ONCE", 14)
    parts = simulate(*given, **settings, backend="compiled", on_tick=lambda *x: told.append(x))
    for name in CHANNELS:
        assert_array_equal(getattr(parts, name), getattr(whole, name))
    assert told[0] == (0, 100)
    assert told[-1] == (100, 100)
    assert told == sorted(set(told))
    assert len(told) > 10


# --- trajectories --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arm", [arms.spinner(), arms.manipulator()], ids=["spinner", "manipulator"]
)
def test_samples_are_the_trajectory_one_by_one(arm: rbi.ArmModel, rng: np.random.Generator) -> None:
    knots = [arm.random_configuration(rng) for _ in range(3)]
    times = np.linspace(-0.1, 2.2, 50)
    for trajectory in (
        hold(arm, knots[0]),
        cosine(arm, center=knots[0], amplitude=0.4, period=2.0, check_limits=False),
        cosine(arm, center=knots[1], period=np.linspace(1.0, 2.0, arm.nv)),
        waypoints(arm, knots, [0.0, 1.0, 2.0]),
        samples(arm, [0.0, 1.0, 2.0], knots, check_limits=False),
    ):
        assert isinstance(trajectory, SampledTrajectory)
        for i, part in enumerate(trajectory.sample(times)):
            one_by_one = [trajectory(t)[i] for t in times]
            assert_allclose(np.broadcast_to(part, np.shape(one_by_one)), one_by_one, atol=1e-15)


@pytest.mark.parametrize(
    ("reference", "error", "words"),
    [
        (([0.0] * 5, [0.0] * 6, [0.0] * 6), rbi.DimensionError, "reference.q"),
        (([0.0] * 6, [np.nan] * 6, [0.0] * 6), rbi.NonFiniteError, "reference.v"),
        (([0.0] * 6, [0.0] * 6, "fast"), rbi.DimensionError, "reference.a"),
        (7, rbi.DimensionError, "reference"),
    ],
)
def test_a_bad_reference_is_refused_as_by_the_controller(
    reference: Any, error: type[Exception], words: str
) -> None:
    arm = arms.manipulator()

    def trajectory(t: float) -> rbi.Reference:
        return hold(arm)(t) if t < 0.005 else reference

    for backend in ("pinocchio", "compiled"):
        with pytest.raises(error, match=words):
            simulate(build(arm), arm, trajectory, duration=0.01, backend=backend)


@pytest.mark.parametrize("value", [np.ones(5), np.full(6, np.nan), "hard"])
def test_a_bad_wrench_is_refused(value: Any) -> None:
    arm = arms.manipulator()
    wrench = rbi.FrameWrench(lambda t: np.ones(6) if t < 0.005 else value)
    for backend in ("pinocchio", "compiled"):
        with pytest.raises(rbi.InputError, match="wrench"):
            simulate(build(arm), arm, hold(arm), environment=wrench, duration=0.01, backend=backend)


def test_an_unknown_frame_and_an_unknown_backend_are_refused() -> None:
    arm = arms.manipulator()
    given: Any = build(arm), arm, hold(arm)
    with pytest.raises(rbi.ModelError, match="no frame 'hook'"):
        simulate(
            *given,
            environment=rbi.FrameWrench(np.ones(6), "hook"),
            duration=0.01,
            backend="compiled",
        )
    with pytest.raises(rbi.ParameterError, match="backend"):
        simulate(*given, duration=0.01, backend="c")


# --- divergence ----------------------------------------------------------------------------------


@pytest.mark.parametrize("backend", ["pinocchio", "compiled"])
def test_divergence_carries_the_same_as_in_the_readable_run(backend: Any) -> None:
    """A pull that grows without end."""
    arm = arms.spinner()
    given = build(arm, limits=20.0), arm, hold(arm)
    settings: Any = {"environment": rbi.JointTorque(lambda t: [0.0, 1e9 * (t > 0.05), 0.0])}
    errors = []
    for run in (readable, partial(simulate, backend=backend)):
        with pytest.raises(rbi.DivergenceError) as caught:
            run(*given, **settings, duration=0.2)
        errors.append(caught.value)
    truth, mine = errors
    assert (mine.time, mine.joint, str(mine)) == (truth.time, truth.joint, str(truth))
    assert len(mine.result.t) == len(truth.result.t) < 100
    for name in CHANNELS:
        one, other = (np.asarray(getattr(x.result, name), dtype=np.float64) for x in errors)
        assert_allclose(other, one, rtol=1e-9, atol=1e-9)


# --- what is left to Python ----------------------------------------------------------------------


class Mine:
    """An interaction of the user's own."""

    def torque(self, arm: rbi.ArmModel, t: float, q: Array, v: Array) -> Array:
        del t, q, v
        return np.ones(arm.nv)


LEFT: dict[str, tuple[Any, dict[str, Any], str]] = {
    "interaction": ({}, {"environment": Mine()}, "Mine"),
    "inner interaction": ({}, {"environment": rbi.interaction.Sum(Mine())}, "Sum"),
    "sensor": ({}, {"sensor": interaction.Delay(2)}, "Delay"),
    "target": ({"impedance": rbi.FiniteTimeImpedance(1.5, 10.0, 20.0, 0.7)}, {}, "FiniteTime"),
}


@pytest.mark.parametrize("name", LEFT)
def test_what_has_no_compiled_form_runs_in_python_and_that_is_said_once(
    name: str, said: pytest.LogCaptureFixture
) -> None:
    changes, settings, word = LEFT[name]
    arm = arms.spinner()
    given: Any = build(arm, **changes), arm, hold(arm)
    settings = {"duration": 0.01} | settings
    runs = [simulate(*given, **settings, backend="compiled") for _ in range(2)]
    assert_same(runs[0], readable(*given, **settings), 1e-10)
    said_so = [record.message for record in said.records if "left to Python" in record.message]
    assert len(said_so) == 1
    assert word in said_so[0]


def test_mimic_arms_run_in_python_and_that_is_said(said: pytest.LogCaptureFixture) -> None:
    arm = arms.follower()
    run = simulate(build(arm), arm, hold(arm), duration=0.01, backend="compiled")
    assert_same(run, readable(build(arm), arm, hold(arm), duration=0.01), 1e-10)
    assert "left to Python" in said.text


@pytest.mark.slow
def test_the_specification_runs_without_compiled_code() -> None:
    code = (
        "import sys, rbimpedance as rbi\n"
        "sys.modules['numba'] = None\n"
        "arm = rbi.load_robot('two_link')\n"
        "parts = rbi.Impedance(1, 10, 20), rbi.PowerSurface(3, 1.5), rbi.SuperTwisting(8, 10)\n"
        "c = rbi.ImpedanceController(arm, *parts, 1e-3, backend='numpy')\n"
        "hold = rbi.trajectories.hold(arm)\n"
        "rbi.simulate(c, arm, hold, duration=0.01)\n"
        "batch = rbi.simulate_batch(c, arm, hold, duration=0.01)\n"
        "print(len(batch))"
    )
    run = fresh_python(code)
    assert run.stdout.strip() == "1"
    assert not run.stderr


@pytest.mark.slow
def test_default_run_does_not_compile_the_rollout() -> None:
    code = (
        "import sys, rbimpedance as rbi\n"
        "arm = rbi.load_robot('two_link')\n"
        "parts = rbi.Impedance(1, 10, 20), rbi.PowerSurface(3, 1.5), rbi.SuperTwisting(8, 10)\n"
        "c = rbi.ImpedanceController(arm, *parts, 1e-3)\n"
        "rbi.simulate(c, arm, rbi.trajectories.hold(arm), duration=0.01)\n"
        "loop = sys.modules.get('rbimpedance.simulation.compiled.loop')\n"
        "print(loop is not None and loop.rollout.kernel is not None)"
    )
    run = fresh_python(code)
    assert run.stdout.strip() == "False"
