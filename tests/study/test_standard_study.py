"""The standard study: what it promises to be, and that its baselines are not set up to lose."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.optimize import brentq

import rbimpedance as rbi
from rbimpedance.study import Experiment, Task
from rbimpedance.study.standard import LINEAR, STANDARD
from rbimpedance.study.standard.arms import AMPLITUDE, ARMS, DELAY, PERIOD
from rbimpedance.study.standard.controllers import CONTROLLERS, first_order_gains
from rbimpedance.study.standard.disturbances import DISTURBANCES, Chirp

pytestmark = pytest.mark.slow  # all of them run the study's controllers

ROBOT = "z1"


@pytest.fixture(scope="module")
def task() -> Task:
    return ARMS[ROBOT].task()


def drawn(task: Task, name: str, count: int = 20) -> Iterator[Experiment]:
    for sample in range(count):
        yield DISTURBANCES[name](task, STANDARD.generator(ROBOT, name, sample))


def test_study_is_six_arms_twelve_disturbances_and_ten_controllers() -> None:
    assert (len(STANDARD.robots), len(STANDARD.disturbances), len(STANDARD.controllers)) == (
        6,
        12,
        10,
    )
    assert STANDARD.runs == 5040
    assert STANDARD.duration == 5.0


def test_linear_laws_meet_the_same_experiments() -> None:
    """Plants and motions depend on the seed and the names of arm and disturbance alone."""
    assert LINEAR.runs == 6 * 12 * 7 * 4
    assert (LINEAR.seed, LINEAR.samples, LINEAR.robots) == (
        STANDARD.seed,
        STANDARD.samples,
        STANDARD.robots,
    )
    assert LINEAR.disturbances == STANDARD.disturbances


def test_what_is_compared_with_is_the_library_itself() -> None:
    assert next(iter(STANDARD.controllers)) == "super-twisting terminal"


@pytest.mark.parametrize("name", sorted(DISTURBANCES))
def test_every_controller_tolerates_the_beginning_of_every_disturbance(
    task: Task, name: str
) -> None:
    experiment = DISTURBANCES[name](task, STANDARD.generator(ROBOT, name, 0))
    for make in CONTROLLERS.values():
        result = experiment.simulate(make(task), duration=0.01, substeps=STANDARD.substeps)
        assert np.isfinite(result.tau).all()


@pytest.mark.parametrize("robot", ARMS)
def test_steps_are_short_enough_for_every_gear_that_is_drawn(robot: str) -> None:
    arm = ARMS[robot].model()
    target = rbi.Impedance(mass=1.0, damping=10.0, stiffness=20.0)
    task = Task(robot=robot, arm=arm, impedance=target, dt=1e-3)
    for sample in range(STANDARD.samples):
        name = "elastic joints"
        experiment = DISTURBANCES[name](task, STANDARD.generator(robot, name, sample))
        assert isinstance(experiment.plant, rbi.DrivenPlant)
        assert experiment.q0 is not None
        h = task.dt / (experiment.substeps or STANDARD.substeps)
        experiment.plant.begin(experiment.q0, np.zeros(arm.nv), h)


def test_all_controllers_compute_with_the_same_model(task: Task) -> None:
    q = task.arm.neutral
    M = task.model.mass_matrix(q)
    assert not np.array_equal(M, task.arm.mass_matrix(q))  # it carries a part of the payload
    for make in CONTROLLERS.values():
        np.testing.assert_array_equal(make(task).arm.mass_matrix(q), M)


def test_gains_are_proposed_for_all_that_is_drawn(task: Task) -> None:
    stated = task.known.uncertainty
    for experiment in drawn(task, "everything"):
        assert stated.payload[0] <= experiment.inputs["payload"] <= stated.payload[1]
        low, high = stated.inertia_scale
        assert low <= experiment.inputs["inertia_scale"] <= high
        assert isinstance(experiment.plant, rbi.ArmModel)
        assert (experiment.plant.viscous <= stated.viscous.max()).all()
        assert (experiment.plant.coulomb <= stated.coulomb.max()).all()


def test_motions_are_no_faster_than_the_gains_are_made_for(task: Task) -> None:
    fastest = AMPLITUDE * 2.0 * np.pi / PERIOD
    for experiment in drawn(task, "nothing"):
        times = np.linspace(0.0, 5.0, 101)
        assert np.abs([experiment.trajectory(t).v for t in times]).max() <= fastest


def test_tool_meets_the_wall(task: Task) -> None:
    for experiment in drawn(task, "wall"):
        arm, wall = task.arm, rbi.interaction.as_interaction(experiment.environment)
        zero = np.zeros(arm.nv)
        touched = [
            wall.torque(arm, t, experiment.trajectory(t).q, zero).any()
            for t in np.linspace(0.0, 5.0, 101)
        ]
        assert not touched[0]
        assert any(touched)


def test_baselines_keep_a_phase_margin_of_45_degrees_at_the_largest_delay(task: Task) -> None:
    """The loop of s: an integrator, the bandwidth, the surface's rate in parallel, and all of the delay."""
    rate, bandwidth, _ = first_order_gains(task)
    late = (DELAY + 0.5) * task.dt

    def open_loop(omega: float) -> complex:
        s = 1j * omega
        gain = task.known.mismatch.gain_high
        return complex(
            gain * ((bandwidth + rate) * s + bandwidth * rate) / s**2 * np.exp(-s * late)
        )

    crossing = brentq(lambda omega: abs(open_loop(omega)) - 1.0, 1.0, 1e4)
    assert np.degrees(np.angle(-open_loop(crossing))) >= 45.0


def test_first_order_gain_exceeds_the_largest_disturbance(task: Task) -> None:
    mismatch = task.known.mismatch
    assert (first_order_gains(task).gain * mismatch.gain_low > mismatch.disturbance).all()


def test_chirp_sweeps_from_a_fifth_of_a_hertz_to_four() -> None:
    wrench = Chirp(np.ones(6))
    zeros = np.flatnonzero(np.diff(np.sign([wrench(t)[0] for t in np.arange(0.0, 5.0, 1e-4)])))
    assert 1.0 / (2.0 * np.diff(zeros * 1e-4)[-1]) == pytest.approx(4.0, rel=0.05)
