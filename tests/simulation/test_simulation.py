"""The closed loop and its integrators, against closed forms, a second integrator and theory."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import rbimpedance as rbi
from rbimpedance.trajectories import cosine, hold

from .. import arms
from ..laws import smooth as build

Array = NDArray[np.float64]
Integrator = Literal["semi-implicit", "rk4"]
CHANNELS = ("t", "q", "v", "q_r", "e1", "e2", "e_im", "s", "tau", "tau_ext")
INERTIA = 0.5  # of arms.pendulum() about its pivot [kg·m²]


class Motor:
    """A "controller" that ignores what it sees and applies a torque per tick."""

    def __init__(
        self, arm: rbi.ArmModel, dt: float, torque: Callable[[int], Array] | None = None
    ) -> None:
        self.arm, self.dt = arm, dt
        self.init, self.impedance_error = (c := build(arm, dt)).init, c.impedance_error
        self._tick, self._torque = c.step, torque or (lambda k: np.zeros(arm.nv) * k)

    def step(
        self, state: rbi.ControllerState, *measured: Any
    ) -> tuple[rbi.ControllerOutput, rbi.ControllerState]:
        output, after = self._tick(state, *measured)
        return output._replace(tau=self._torque(state.ticks)), after


def swing(
    arm: rbi.ArmModel,
    *,
    dt: float,
    duration: float,
    torque: Callable[[int], Array] | None = None,
    **settings: Any,
) -> rbi.SimulationResult:
    """Run an arm under a `Motor`."""
    return rbi.simulate(Motor(arm, dt, torque), arm, hold(arm), duration=duration, **settings)


def slope(steps: Array, errors: Array) -> float:
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


# --- integrators ---------------------------------------------------------------------------------


def push(t: float) -> Array:
    return np.array([8.0 + 2.0 * np.sin(3.0 * t), 4.0 * np.cos(2.0 * t), 0.5 * np.sin(t)])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("integrator", "order", "substeps"),
    [("semi-implicit", 1.0, [64, 128, 256, 512]), ("rk4", 4.0, [8, 16, 32, 64])],
)
def test_integrator_has_its_order_on_a_smooth_torque(
    integrator: Integrator, order: float, substeps: list[int]
) -> None:
    """A continuous joint passes π; the truth is DOP853 in plain angles."""
    spinner = arms.spinner().with_friction(0.3, 0.0)
    angles, v0 = np.array([2.8, 0.0, 0.0]), np.array([6.0, 0.5, -1.0])

    def rate(t: float, x: Array) -> Array:
        q = np.concatenate([[np.cos(x[0]), np.sin(x[0])], x[1:3]])
        return np.concatenate([x[3:], spinner.forward_dynamics(q, x[3:], push(t))])

    start = np.concatenate([angles, v0])
    x = solve_ivp(rate, (0.0, 1.0), start, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    q0, truth = ([np.cos(y[0]), np.sin(y[0]), *y[1:3]] for y in (start, x))
    assert x[0] > np.pi + 0.1
    errors = []
    for n in substeps:
        run = swing(
            spinner, dt=0.25, duration=1.0, q0=q0, v0=v0, environment=rbi.JointTorque(push), substeps=n,
            integrator=integrator,
        )  # fmt: skip
        away = spinner.difference(run.q[-1], truth)
        errors.append(np.abs([away, run.v[-1] - x[3:]]).max())
    assert slope(1.0 / np.array(substeps), np.array(errors)) == pytest.approx(order, abs=0.15)


def energy(arm: rbi.ArmModel, run: rbi.SimulationResult) -> Array:
    """Kinetic and potential energy over a run, by Pinocchio."""
    model = arm.model
    data = model.createData()
    return np.array(
        [pin.computeMechanicalEnergy(model, data, *x) for x in zip(run.q, run.v, strict=True)]
    )


def test_energy_of_a_free_arm_drifts_with_the_fourth_power_under_rk4() -> None:
    arm = arms.manipulator().with_friction(0.0, 0.0).with_armature(0.0)
    v0, substeps, drifts = np.linspace(-2.0, 2.0, 6), np.array([8, 16, 32]), []
    for n in substeps:
        run = swing(arm, dt=0.1, duration=0.5, v0=v0, substeps=int(n), integrator="rk4")
        total = energy(arm, run)
        drifts.append(abs(total[-1] - total[0]))
    assert slope(1.0 / substeps, np.array(drifts)) > 3.8
    assert drifts[-1] < 1e-6


@pytest.mark.slow
def test_energy_of_a_pendulum_is_bounded_of_first_order_under_semi_implicit_euler() -> None:
    """The method is symplectic where M is constant: its error swings with the motion and does not grow."""
    pendulum, swings = arms.pendulum(), []
    for h in (4e-3, 2e-3):
        run = swing(pendulum, dt=h, duration=20.0, q0=[1.5], substeps=1)
        height = -0.5 * np.cos(run.q[:, 0])
        total = INERTIA * run.v[:, 0] ** 2 / 2.0 + 2.0 * 9.81 * height
        error = np.abs(total - total[0])
        swings.append(error.max())
        assert error[run.t > 15.0].max() < 1.02 * error[run.t < 5.0].max()
    assert swings[0] / swings[1] == pytest.approx(2.0, rel=0.02)


def test_torque_is_held_over_the_control_period() -> None:
    """Without gravity each period is uniformly accelerated, which RK4 integrates exactly."""
    free = arms.pendulum().with_gravity(np.zeros(3))
    torques, dt = np.array([1.0, -2.0, 0.5, 4.0, 0.0]), 0.1
    run = swing(
        free, dt=dt, duration=0.4, torque=lambda k: torques[k : k + 1], substeps=3, integrator="rk4"
    )
    a = torques[:-1] / INERTIA
    v = np.concatenate([[0.0], np.cumsum(a * dt)])
    q = np.concatenate([[0.0], np.cumsum(v[:-1] * dt + a * dt**2 / 2.0)])
    assert_array_equal(run.tau[:, 0], torques)
    assert_allclose(run.v[:, 0], v, rtol=0.0, atol=1e-14)
    assert_allclose(run.q[:, 0], q, rtol=0.0, atol=1e-14)


# --- time ----------------------------------------------------------------------------------------


class Recorder:
    """Notes when it is asked, and on which arm; does not push."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.arms: set[rbi.ArmModel] = set()

    def torque(self, arm: rbi.ArmModel, t: float, q: Array, v: Array) -> Array:
        del q, v
        self.times.append(t)
        self.arms.add(arm)
        return np.zeros(arm.nv)


def test_time_is_the_tick_times_the_period_to_the_bit() -> None:
    pendulum, asked = arms.pendulum(), []

    def trajectory(t: float) -> rbi.Reference:
        asked.append(t)
        return hold(pendulum)(t)

    controller, q0 = build(pendulum, 1e-3), pendulum.neutral
    run = rbi.simulate(controller, pendulum, trajectory, q0=q0, duration=0.7, substeps=1)
    expected = [k * 1e-3 for k in range(701)]
    assert run.t.tolist() == expected
    assert asked == expected


def test_environment_acts_at_every_physics_step() -> None:
    pendulum, recorder, dt = arms.pendulum(), Recorder(), 0.01
    swing(pendulum, dt=dt, duration=0.3, substeps=3, environment=recorder)
    ticks = np.arange(31) * dt
    steps = (np.arange(30)[:, None] * dt + np.arange(3) * dt / 3.0).ravel()
    assert_allclose(sorted(recorder.times), np.sort(np.concatenate([ticks, steps])), rtol=1e-14)
    assert set(ticks[:-1].tolist()) == {t for t in recorder.times if recorder.times.count(t) == 2}


def test_progress_is_told_from_nothing_to_all() -> None:
    told: list[tuple[int, int]] = []
    swing(arms.pendulum(), dt=0.1, duration=0.3, on_tick=lambda *x: told.append(x))
    assert told == [(0, 3), (1, 3), (2, 3), (3, 3)]


# --- the loop ------------------------------------------------------------------------------------


def test_controller_and_plant_share_no_model() -> None:
    arm, recorder = arms.pendulum(), Recorder()
    swing(arm, dt=0.1, duration=0.1, environment=recorder)
    (plant,) = recorder.arms
    assert plant is not arm
    assert plant.raw_dynamics is not arm.raw_dynamics
    assert plant.digest == arm.digest


def test_plant_is_what_moves() -> None:
    """On a weaker gravity than the controller knows, the pendulum falls that much slower."""
    arm = arms.pendulum()
    light, heavy = (
        rbi.simulate(Motor(arm, 0.01), plant, hold(arm), q0=[0.5], duration=0.01, substeps=1)
        for plant in (arm.with_gravity([0.0, 0.0, -1.0]), arm)
    )
    assert heavy.v[-1, 0] / light.v[-1, 0] == pytest.approx(9.81, rel=1e-12)


def test_run_is_reproducible_to_the_bit() -> None:
    spinner = arms.spinner()
    controller, plant = build(spinner), spinner.with_payload(0.5)
    wrench = rbi.FrameWrench(lambda t: [np.sin(t), 1.0, 0.0, 0.1, 0.0, 0.0], expressed_in="local")

    def run() -> rbi.SimulationResult:
        return rbi.simulate(controller, plant, hold(spinner), environment=wrench, duration=0.2)

    first, _, second = run(), swing(spinner, dt=0.1, duration=0.1), run()
    for name in CHANNELS:
        assert_array_equal(getattr(first, name), getattr(second, name))
    assert first.provenance == second.provenance


def test_motion_starts_where_the_trajectory_does_and_at_rest_by_default() -> None:
    plant = arms.manipulator()
    trajectory = cosine(plant, center=0.25, amplitude=0.1, period=2.0)
    run = rbi.simulate(Motor(plant, 0.01), plant, trajectory, duration=0.01, substeps=1)
    assert_array_equal(run.q[0], np.full(6, 0.35))
    assert_array_equal(run.v[0], np.zeros(6))


def test_motion_starts_where_it_is_told_and_leaves_that_alone() -> None:
    spinner = arms.spinner()
    q0, v0 = np.array([0.0, 1.0, 0.2, -0.3]), np.array([0.1, 0.2, 0.3])
    kept = q0.copy(), v0.copy()
    run = swing(spinner, dt=0.01, duration=0.1, q0=q0, v0=v0)
    assert_array_equal(run.q[0], q0)
    assert_array_equal(run.v[0], v0)
    assert_array_equal(q0, kept[0])
    assert_array_equal(v0, kept[1])
    assert not np.shares_memory(run.q, q0)


def test_continuous_joint_takes_the_short_way() -> None:
    """From +3.1 to -3.1 rad it is 0.083 rad through π, not 6.2 rad through 0."""
    spinner = arms.spinner()
    target, start = ([np.cos(x), np.sin(x), 0.0, 0.0] for x in (-3.1, 3.1))
    run = rbi.simulate(
        build(spinner, 5e-3), spinner, hold(spinner, target), q0=start, duration=3.0, substeps=2
    )
    turned = np.unwrap(np.arctan2(run.q[:, 1], run.q[:, 0])) - 3.1
    assert turned[-1] == pytest.approx(2.0 * np.pi - 6.2, abs=1e-3)
    assert np.abs(turned).max() < 0.1
    assert_allclose(run.q[:, 0] ** 2 + run.q[:, 1] ** 2, 1.0, rtol=0.0, atol=1e-12)


def test_impedance_error_is_the_residual_of_the_targets_equation() -> None:
    """M_d (a_d - a) + D_d (v_d - v) + K_d (q_d - q) + tau_ext with a of the textbook pendulum."""
    pendulum, push = arms.pendulum(), 1.5
    run = rbi.simulate(
        build(pendulum), pendulum, hold(pendulum, [0.4]), environment=rbi.JointTorque([push]),
        q0=[0.1], duration=0.3,
    )  # fmt: skip
    a = (run.tau + push - 9.81 * np.sin(run.q)) / INERTIA
    residual = -a - 10.0 * run.v + 20.0 * (0.4 - run.q) + push
    assert_allclose(run.e_im, residual, rtol=0.0, atol=1e-11)


WRENCH = [1.0, -2.0, 3.0, 0.1, 0.2, -0.3]


@pytest.mark.parametrize(
    "wrench",
    [WRENCH, np.array(WRENCH), lambda t: WRENCH, rbi.FrameWrench(WRENCH, "tool")],  # noqa: ARG005
    ids=["list", "array", "function", "FrameWrench"],
)
def test_logged_external_torque_is_that_of_the_wrench_at_the_tool(wrench: Any) -> None:
    spinner = arms.spinner()
    run = swing(spinner, dt=0.01, duration=0.1, environment=wrench)
    expected = [spinner.jacobian(q).T @ WRENCH for q in run.q]
    assert_allclose(run.tau_ext, expected, rtol=0.0, atol=1e-13)
    still = swing(spinner, dt=0.01, duration=0.1)
    assert_array_equal(still.tau_ext, np.zeros((11, 3)))
    assert np.abs(still.q - run.q).max() > 1e-4


def test_joint_torque_moves_the_arm_as_a_motor_would() -> None:
    spinner, torque = arms.spinner(), np.array([1.0, 2.0, -0.5])
    pushed = swing(spinner, dt=0.01, duration=0.2, environment=rbi.JointTorque(torque))
    driven = swing(spinner, dt=0.01, duration=0.2, torque=lambda k: torque * (k >= 0))
    assert_array_equal(pushed.q, driven.q)
    assert_array_equal(pushed.v, driven.v)


# --- divergence ----------------------------------------------------------------------------------


@pytest.mark.parametrize("torque", [1e9, -1e300, np.inf, np.nan])
@pytest.mark.parametrize("integrator", ["semi-implicit", "rk4"])
def test_divergence_tells_time_and_joint_and_keeps_the_sound_part(
    integrator: Integrator, torque: float
) -> None:
    """The torque of tick 3 throws the sliding joint; a wrench acts at every physics step."""
    spinner = arms.spinner()
    throw = np.array([0.0, torque, 0.0])
    with pytest.raises(rbi.DivergenceError, match=r"diverged after t = 0.03 s at joint") as caught:
        swing(
            spinner, dt=0.01, duration=1.0, environment=WRENCH, integrator=integrator,
            torque=lambda k: throw if k == 3 else np.zeros(3),
        )  # fmt: skip
    error = caught.value
    assert error.time == 3 * 0.01
    assert error.joint in spinner.joint_names
    assert_array_equal(error.result.t, np.arange(4) * 0.01)
    for name in set(CHANNELS) - {"tau", "e_im"}:
        assert np.isfinite(getattr(error.result, name)).all()
    other = pickle.loads(pickle.dumps(error))
    assert (other.time, other.joint, str(other)) == (error.time, error.joint, str(error))
    assert_array_equal(other.result.q, error.result.q)


def test_divergence_names_the_joint_that_left() -> None:
    """Four uncoupled pendulums, of which the third is thrown."""
    model = pin.Model()
    for name in ("a", "b", "c", "d"):
        joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.ones(3), np.eye(3)), pin.SE3.Identity())
    row = rbi.ArmModel(model, name="row", tool_frame="universe")
    with pytest.raises(rbi.DivergenceError, match="at joint 'c'"):
        swing(row, dt=0.01, duration=0.1, torque=lambda k: np.array([1.0, 2.0, 1e9 * k, 3.0]))


def test_divergence_ends_the_run_at_the_physics_step_that_left() -> None:
    pendulum, recorder = arms.pendulum(), Recorder()
    with pytest.raises(rbi.DivergenceError):
        swing(
            pendulum, dt=0.01, duration=0.1, environment=recorder, substeps=5,
            torque=lambda k: np.array([1e9 * (k == 3)]),
        )  # fmt: skip
    assert max(recorder.times) == 3 * 0.01


def test_overflow_is_a_divergence_without_a_warning() -> None:
    """The sum a1 + 2 a2 + ... of RK4 exceeds the largest double, each term does not."""
    free = arms.pendulum().with_gravity(np.zeros(3))
    with pytest.raises(rbi.DivergenceError):
        swing(free, dt=0.1, duration=0.1, integrator="rk4", torque=lambda k: np.array([8e307 + k]))


def test_unstable_loop_ends_in_divergence_with_finite_results() -> None:
    manipulator = arms.manipulator().with_armature(0.0)
    wild = build(manipulator, 0.01, reaching=rbi.SuperTwisting(1e4, 1e7, "explicit"))
    with pytest.raises(rbi.DivergenceError) as caught:
        rbi.simulate(wild, manipulator, hold(manipulator, np.full(6, 0.5)), duration=5.0)
    for name in CHANNELS:
        assert np.isfinite(getattr(caught.value.result, name)).all()
    assert caught.value.result.t[-1] == caught.value.time < 5.0


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize("substeps", [0, -1, 1.5, 4.0, True, "4", None])
def test_unusable_number_of_substeps_is_refused(substeps: Any) -> None:
    with pytest.raises(rbi.ParameterError, match=r"^substeps must be a positive whole number"):
        swing(arms.pendulum(), dt=0.1, duration=0.1, substeps=substeps)


def test_whole_numbers_of_numpy_are_substeps(tmp_path: Any) -> None:
    pendulum = arms.pendulum()
    run = swing(pendulum, dt=0.1, duration=0.1, substeps=np.int64(4))
    assert_array_equal(run.q, swing(pendulum, dt=0.1, duration=0.1, substeps=4).q)
    assert rbi.SimulationResult.load(run.save(tmp_path / "run")).provenance["substeps"] == 4


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan, np.inf, "1", True, None, [1.0]])
def test_unusable_duration_is_refused(duration: Any) -> None:
    with pytest.raises(rbi.ParameterError, match=r"^duration must be a positive, finite length"):
        swing(arms.pendulum(), dt=0.1, duration=duration)


@pytest.mark.parametrize(("duration", "near"), [(0.25, "0.2"), (0.04, "0.1"), (0.1001, "0.1")])
def test_duration_between_ticks_is_refused_with_one_that_fits(duration: float, near: str) -> None:
    words = rf"^duration must be a multiple of the control period dt = 0.1 s, e.g. {near}, got"
    with pytest.raises(rbi.ParameterError, match=words):
        swing(arms.pendulum(), dt=0.1, duration=duration)


@pytest.mark.parametrize(("dt", "duration"), [(1e-3, 0.3), (1.0 / 3.0, 1.0), (0.1, 0.7)])
def test_rounding_does_not_refuse_a_duration(dt: float, duration: float) -> None:
    run = swing(arms.pendulum(), dt=dt, duration=duration, substeps=1)
    assert run.t[-1] == pytest.approx(duration, rel=1e-12)


@pytest.mark.parametrize("integrator", ["euler", "RK4", None])
def test_unknown_integrator_is_refused_with_the_known_ones(integrator: Any) -> None:
    with pytest.raises(rbi.ParameterError, match=r"^integrator must be .semi-implicit. or .rk4."):
        swing(arms.pendulum(), dt=0.1, duration=0.1, integrator=integrator)


def test_plant_with_another_number_of_joints_is_refused() -> None:
    controller, plant = build(arms.pendulum()), arms.spinner()
    with pytest.raises(
        rbi.ParameterError, match=r"^plant must be .*nq, nv = 1, 1, got .*nq=4, nv=3"
    ):
        rbi.simulate(controller, plant, hold(plant), duration=0.1)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"q0": np.zeros(3)}, rbi.DimensionError, r"^q0 must be .*nq = 4 \(nv = 3\)"),
        ({"q0": [np.nan] * 4}, rbi.NonFiniteError, r"^q0 must be finite"),
        ({"q0": [0.5, 0.5, 0.0, 0.0]}, rbi.DimensionError, r"^q0 must be .*unit length"),
        ({"v0": np.zeros(4)}, rbi.DimensionError, r"^v0 must be .*= \(3,\), got shape \(4,\)"),
        ({"v0": [0.0, np.inf, 0.0]}, rbi.NonFiniteError, r"^v0 must be finite; entry 1"),
        ({"environment": np.zeros(3)}, rbi.DimensionError, r"^wrench must be"),
        (
            {"environment": lambda t: [t, 0, 0, 0, 0, np.nan]},
            rbi.NonFiniteError,
            r"^wrench must be",
        ),
        ({"environment": rbi.JointTorque([1.0])}, rbi.DimensionError, r"^torque must be"),
    ],
)
def test_unusable_argument_is_refused_by_name(
    arguments: dict[str, Any], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        swing(arms.spinner(), dt=0.1, duration=0.1, **arguments)


def test_trajectory_that_gives_no_reference_is_refused() -> None:
    pendulum = arms.pendulum()
    trajectory: Any = np.cos
    with pytest.raises(rbi.DimensionError, match=r"^reference must be a Reference\(q, v, a\)"):
        rbi.simulate(build(pendulum), pendulum, trajectory, duration=0.1)


def test_stiff_friction_stops_a_joint_after_the_distance_of_the_closed_form() -> None:
    viscous, step = 1e3, 5e-3
    plant = arms.pendulum().with_gravity([0.0, 0.0, 0.0]).with_friction(viscous=viscous)
    assert step * viscous / INERTIA == 10.0  # far beyond what an explicit step bears
    run = swing(plant, dt=step, duration=10 * step, v0=[1.0], substeps=1)
    assert_allclose(run.q[-1], INERTIA / viscous, rtol=1e-6)  # ∫ exp(-viscous/INERTIA·t) dt


def test_stiff_friction_takes_energy_out_at_every_step() -> None:
    plant = arms.manipulator().with_gravity([0.0, 0.0, 0.0]).with_friction(50.0, 50.0)
    run = swing(plant, dt=1e-2, duration=0.2, v0=np.ones(plant.nv), substeps=1)
    kinetic = energy(plant, run)
    assert kinetic[0] > 0.1
    assert (np.diff(kinetic) < 0.0).all()


def test_runge_kutta_refuses_friction_that_it_cannot_bear_and_says_the_substeps() -> None:
    plant = arms.pendulum().with_friction(viscous=1e5)
    with pytest.raises(rbi.ParameterError, match=r"semi-implicit.*at least \d+ substeps"):
        rbi.simulate(build(plant), plant, hold(plant), duration=0.1, integrator="rk4")
