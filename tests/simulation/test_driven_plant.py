"""Drives that lag, ripple and yield, held to the closed forms of one and two masses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import rbimpedance as rbi
from rbimpedance._common.arrays import Array
from rbimpedance.control.snapshot import fingerprint
from rbimpedance.interaction.wrenches import Nothing
from rbimpedance.simulation.checkpoint import Checkpoint
from rbimpedance.simulation.plants import DrivenPlant, DrivenState, Plant, RigidPlant
from rbimpedance.simulation.plants.sticking import StickingPlant

from .. import laws
from ..arms import follower, manipulator, pendulum, spinner

M, B, K, D = 0.5, 0.2, 800.0, 0.6  # of `pendulum()` (m·l²), and of a drive on it
FREE = Nothing()


def floating() -> rbi.ArmModel:
    """One link of inertia M on a rotor of inertia B, without gravity."""
    return pendulum().with_gravity(np.zeros(3)).with_armature(B)


def steps(
    plant: Plant[Any], state: Any, tau: Array, h: float, count: int, keep: int = 1
) -> list[Any]:
    """The states of a motion under a constant torque, the first one included."""
    states = [state]
    for i in range(count):
        state = plant.step(state, tau, FREE, i * h, h)
        if (i + 1) % keep == 0:
            states.append(state)
    return states


def stretched(plant: DrivenPlant, delta: Array, h: float) -> DrivenState:
    """At rest with springs that are stretched."""
    arm = plant.arm
    return plant.begin(arm.neutral, np.zeros(arm.nv), h)._replace(delta=delta)


def column(states: list[DrivenState], name: str) -> Array:
    return np.array([getattr(state, name)[0] for state in states])


# --- two masses ---------------------------------------------------------------------------------------------------


def test_undamped_spring_swings_as_two_masses_do() -> None:
    h, n = 1e-3, 1000
    plant = DrivenPlant(floating(), stiffness=K, damping=0.0)
    delta = column(steps(plant, stretched(plant, np.array([0.01]), h), np.zeros(1), h, n), "delta")
    omega = np.sqrt(K * (1.0 / M + 1.0 / B))
    turn = np.arccos(
        1.0 - (h * omega) ** 2 / 2.0
    )  # of semi-implicit Euler in a step; h·ω to second order
    closed = 0.01 * np.cos((np.arange(n + 1) + 0.5) * turn) / np.cos(turn / 2.0)
    np.testing.assert_allclose(delta, closed, atol=1e-12)
    assert turn == pytest.approx(h * omega, rel=(h * omega) ** 2 / 20.0)


@pytest.mark.slow
def test_damped_spring_decays_as_two_masses_do() -> None:
    rate = D / 2.0 * (1.0 / M + 1.0 / B)
    omega = np.sqrt(K * (1.0 / M + 1.0 / B) - rate**2)
    t = np.linspace(0.0, 0.5, 51)
    closed = 0.01 * np.exp(-rate * t) * (np.cos(omega * t) + rate / omega * np.sin(omega * t))
    errors = []
    for n in (10, 20, 40):
        h = 0.01 / n
        plant = DrivenPlant(floating(), stiffness=K, damping=D)
        states = steps(plant, stretched(plant, np.array([0.01]), h), np.zeros(1), h, 50 * n, n)
        errors.append(np.abs(column(states, "delta") - closed).max())
    ratios = np.array(errors[:-1]) / errors[1:]
    np.testing.assert_allclose(ratios, 2.0, rtol=0.1)  # first order
    assert errors[-1] < 2e-4


def test_usual_damping_is_a_twentieth_of_critical() -> None:
    plant = DrivenPlant(floating(), stiffness=K)
    critical = 2.0 * np.sqrt(K / (1.0 / M + 1.0 / B))
    np.testing.assert_allclose(plant.damping, 0.05 * critical, rtol=1e-12)


def energy(plant: DrivenPlant, state: DrivenState) -> float:
    """Of links, rotors and springs."""
    model, (q, v) = plant.arm.model, plant.motion(state)
    data = model.createData()
    links = pin.computeKineticEnergy(model, data, q, v)
    rotors = plant.rotor_inertia @ state.rotor_velocity**2 / 2.0
    springs = plant.stiffness @ state.delta**2 / 2.0
    return float(links + pin.computePotentialEnergy(model, data, q) + rotors + springs)


@pytest.mark.slow
def test_energy_of_an_undamped_arm_stays_within_first_order_of_the_step() -> None:
    arm = manipulator().with_friction(0.0, 0.0)
    worst = []
    for n in (1, 2):
        h = 2e-4 / n
        plant = DrivenPlant(arm, stiffness=3e3, damping=0.0)
        states = steps(plant, stretched(plant, np.full(6, 0.02), h), np.zeros(6), h, 1500 * n, 10)
        off = np.abs([energy(plant, state) - energy(plant, states[0]) for state in states])
        half = len(off) // 2
        assert off[half:].max() < 1.5 * off[:half].max()  # it swings, and does not drift
        worst.append(off.max())
    assert worst[0] / worst[1] == pytest.approx(2.0, rel=0.2)


@pytest.mark.slow
def test_stiff_springs_make_the_rigid_arm_with_armature() -> None:
    arm, h, n, tau = pendulum().with_armature(B), 4e-5, 2000, np.array([4.0])
    rigid = RigidPlant(arm)
    whole = steps(rigid, rigid.begin(np.array([0.4]), np.zeros(1), h), tau, h, n, n)[-1]
    off = []
    for stiffness in (1e4, 1e5, 1e6):
        critical = 2.0 * np.sqrt(stiffness / (1.0 / M + 1.0 / B))
        plant = DrivenPlant(arm, stiffness=stiffness, damping=critical)
        start = plant.begin(np.array([0.4]), np.zeros(1), h)
        q, _ = plant.motion(steps(plant, start, tau, h, n, n)[-1])
        off.append(abs(float(q[0] - whole.q[0])))
    np.testing.assert_allclose(np.array(off[:-1]) / off[1:], 10.0, rtol=0.15)  # like 1/K
    assert off[-1] < 1e-5


def test_run_begins_with_drives_that_hold_the_links() -> None:
    arm, q, h = pendulum().with_armature(B), np.array([0.7]), 1e-3
    plant = DrivenPlant(arm, stiffness=K, time_constant=2e-3)
    state = plant.begin(q, np.zeros(1), h)
    weight = 2.0 * 9.81 * 0.5 * np.sin(0.7)  # m g l sin q
    np.testing.assert_allclose(np.abs(state.delta), weight / K, rtol=1e-12)
    np.testing.assert_allclose(plant.acceleration(state, state.torque, np.zeros(1)), 0, atol=1e-12)
    last = steps(plant, state, state.torque, h, 100)[-1]
    np.testing.assert_allclose(plant.motion(last).q, q, atol=1e-13)
    np.testing.assert_allclose(plant.measured(last).q, q + state.delta, atol=1e-13)


def test_spring_settles_where_the_torque_stretches_it() -> None:
    arm, h = pendulum().with_armature(B), 1e-3
    plant = DrivenPlant(arm, stiffness=K, damping=20.0)
    start, tau = plant.begin(np.array([0.3]), np.zeros(1), h), np.zeros(1)
    state, hand = start, np.array([0.0])
    for i in range(4000):  # a hand brakes the rotor at 0.3 rad and lets the link hang in the spring
        hand = -4.0e3 * (plant.measured(state).q - 0.3) - 50.0 * plant.measured(state).v
        state = plant.step(state, tau + hand, FREE, i * h, h)
    weight = arm.bias(plant.motion(state).q, np.zeros(1))
    np.testing.assert_allclose(state.delta, weight / K, rtol=1e-9)
    np.testing.assert_allclose(hand, weight, rtol=1e-9)


# --- torque -------------------------------------------------------------------------------------------------------


def test_held_torque_arrives_with_a_first_order_lag_that_no_step_distorts() -> None:
    T, h, n, inertia = 3e-3, 1e-3, 12, M + B
    plant = DrivenPlant(floating(), time_constant=T)
    states = steps(plant, plant.begin(np.zeros(1), np.zeros(1), h), np.array([5.0]), h, n)
    t = h * np.arange(n + 1)
    np.testing.assert_allclose(column(states, "torque"), 5.0 * (1.0 - np.exp(-t / T)), atol=1e-14)
    speed = 5.0 / inertia * (t - T * (1.0 - np.exp(-t / T)))
    np.testing.assert_allclose(column(states, "rotor_velocity"), speed, atol=1e-14)


@pytest.mark.parametrize("angle", [0.1, -1.3, 2.9])
def test_ripple_is_a_wave_in_the_angle_of_the_rotor(angle: float) -> None:
    plant = DrivenPlant(floating(), ripple=0.04, cogging=0.3, ripple_periods=60)
    state = plant.begin(np.array([angle]), np.zeros(1), 1e-3)
    a = plant.acceleration(state, np.array([5.0]), np.array([1.0]))
    torque = 5.0 * (1.0 + 0.04 * np.sin(60.0 * angle)) + 0.3 * np.sin(60.0 * angle) + 1.0
    np.testing.assert_allclose(a, torque / (M + B), rtol=1e-12)


@pytest.mark.slow
def test_cogging_takes_no_energy() -> None:
    h, n = 2e-4, 6_000
    plant = DrivenPlant(floating(), cogging=0.3, ripple_periods=10)
    states = steps(plant, plant.begin(np.array([0.02]), np.array([2.0]), h), np.zeros(1), h, n)
    q = np.array([plant.motion(state).q[0] for state in states])
    v = column(states, "rotor_velocity")
    total = (M + B) * v**2 / 2.0 + 0.3 / 10.0 * np.cos(10.0 * q)
    assert np.ptp(0.3 / 10.0 * np.cos(10.0 * q)) > 0.059  # it goes over the whole wave, many times
    np.testing.assert_allclose(total, total[0], atol=2e-3)


# --- the plant as a whole -----------------------------------------------------------------------------------------


def law(arm: rbi.ArmModel) -> rbi.ImpedanceController:
    return laws.controller(
        arm,
        surface=rbi.FastTerminalSurface(2.0, 1.0, 0.6, smoothing=0.1),
        reaching=rbi.SuperTwisting(5.0, 10.0, margin=20.0),
        dt=2e-3,
    )


def simulated(plant: rbi.ArmModel | Plant[Any], **more: Any) -> rbi.SimulationResult:
    arm = plant if isinstance(plant, rbi.ArmModel) else plant.arm
    trajectory = rbi.trajectories.cosine(arm, amplitude=0.2, period=2.0)
    return rbi.simulate(law(spinner()), plant, trajectory, duration=0.3, **more)


@pytest.mark.slow
def test_perfect_drive_is_the_plant_of_its_links() -> None:
    links = RigidPlant(spinner(), friction_at_end=True)
    for plant in (DrivenPlant(spinner()), DrivenPlant(links)):
        driven, bare = simulated(plant), simulated(links)
        for name in ("q", "v", "tau", "e_im"):
            np.testing.assert_allclose(
                getattr(driven, name), getattr(bare, name), rtol=0.0, atol=1e-11, err_msg=name
            )


def every_imperfection(**more: Any) -> DrivenPlant:
    settings: dict[str, Any] = {
        "time_constant": 1e-3,
        "ripple": 0.01,
        "cogging": 0.05,
        "stiffness": [5e3, np.inf, 2e3],
    }
    return DrivenPlant(spinner(), **(settings | more))


def test_rigid_joint_among_elastic_ones_keeps_rotor_and_link_together() -> None:
    plant = every_imperfection()
    np.testing.assert_array_equal(plant.arm.armature, [0.0, 0.2, 0.0])
    start = plant.begin(spinner().neutral, np.array([0.3, -0.1, 0.5]), 2e-4)
    state = steps(plant, start, np.array([3.0, 20.0, 1.0]), 2e-4, 200)[-1]
    assert state.delta[1] == 0.0
    assert state.rotor_velocity[1] == plant.motion(state).v[1]
    assert np.abs(state.delta[[0, 2]]).min() > 1e-5


def test_encoders_of_motors_and_links_differ_by_the_spring_on_the_manifold() -> None:
    motor, link = every_imperfection(), every_imperfection(encoders="link")
    state = motor.begin(spinner().neutral, np.array([0.3, -0.1, 0.5]), 2e-4)
    state = steps(motor, state, np.array([3.0, 20.0, 1.0]), 2e-4, 200)[-1]
    on_rotor, on_link = motor.measured(state), link.measured(state)
    np.testing.assert_array_equal(on_link.q, motor.motion(state).q)
    np.testing.assert_allclose(motor.arm.difference(on_link.q, on_rotor.q), state.delta, atol=1e-14)
    np.testing.assert_array_equal(on_rotor.v, state.rotor_velocity)


def test_step_changes_nothing_that_it_is_given() -> None:
    plant, h = every_imperfection(), 2e-4
    state = plant.begin(spinner().neutral, np.array([0.3, -0.1, 0.5]), h)

    def parts(state: DrivenState) -> list[bytes]:
        return [x.tobytes() for x in (*state.links, *state[1:-1])]  # all but the torque loop's

    kept = parts(state)
    once, twice = (plant.step(state, np.ones(3), FREE, 0.0, h) for _ in range(2))
    assert parts(once) == parts(twice)
    assert parts(state) == kept


class Killed(BaseException):
    """What ends a run in the middle."""


@pytest.mark.slow
def test_killed_run_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
    def stop(done: int, total: int) -> None:
        del total
        if done == 90:
            raise Killed

    plant, path = every_imperfection(), tmp_path / "run"
    whole = simulated(plant, checkpoint=Checkpoint(tmp_path / "whole"))
    with pytest.raises(Killed):
        simulated(plant, on_tick=stop, checkpoint=Checkpoint(path, every=1e-9))
    resumed = simulated(plant, checkpoint=Checkpoint(path, resume=True))
    assert resumed.q.tobytes() == whole.q.tobytes()
    assert resumed.tau.tobytes() == whole.tau.tobytes()


def test_result_says_what_the_drives_were(tmp_path: Path) -> None:
    result = simulated(every_imperfection())
    path = tmp_path / "run.npz"
    result.save(path)
    engine = rbi.SimulationResult.load(path).provenance["engine"]
    assert engine["type"] == "DrivenPlant"
    assert engine["stiffness"] == [5e3, np.inf, 2e3]
    marks = {
        fingerprint(law(spinner()), engine=plant)
        for plant in (every_imperfection(), every_imperfection(), every_imperfection(ripple=0.02))
    }
    assert len(marks) == 2


def test_arm_with_a_joint_that_follows_is_driven() -> None:
    plant = DrivenPlant(follower(), stiffness=3e3)
    start = plant.begin(follower().neutral, np.zeros(2), 2e-4)
    state = steps(plant, start, start.torque, 2e-4, 50)[-1]
    np.testing.assert_allclose(plant.motion(state).q, follower().neutral, atol=1e-11)


def test_links_by_mujoco_swing_as_links_by_pinocchio() -> None:
    pytest.importorskip("mujoco")
    arm = rbi.load_robot("ur5", armature=0.0)
    settings: dict[str, Any] = {"stiffness": 1e4, "rotor_inertia": 0.1, "time_constant": 1e-3}
    by_mujoco = DrivenPlant(rbi.MujocoPlant(arm, limits=False), **settings)
    by_pinocchio = DrivenPlant(arm, **settings)
    ends = []
    for plant in (by_mujoco, by_pinocchio):
        start = plant.begin(arm.neutral, np.zeros(6), 2.5e-4)
        ends.append(plant.measured(steps(plant, start, np.full(6, 2.0), 2.5e-4, 800)[-1]))
    np.testing.assert_allclose(ends[0].q, ends[1].q, atol=1e-8)
    np.testing.assert_allclose(ends[0].v, ends[1].v, atol=1e-7)


def test_hardware_in_front_of_mujoco_is_that_in_front_of_pinocchio() -> None:
    pytest.importorskip("mujoco")
    arm = rbi.load_robot("ur5", armature=0.1)
    hardware = rbi.Hardware(encoder_bits=24, torque_lag=2e-3, delay=1, ripple=0.03)
    law = rbi.HardwareController(arm, hardware, bandwidths=(20.0, 60.0))
    motion = rbi.trajectories.cosine(arm, amplitude=0.1, period=2.0)
    ends = [
        rbi.simulate(law, plant, motion, hardware=hardware, duration=0.3).q[-1]
        for plant in (arm, rbi.MujocoPlant(arm, limits=False))
    ]
    assert np.abs(ends[0] - ends[1]).max() < 1e-6
    assert np.abs(ends[0] - arm.neutral).max() > 1e-3  # and it moved


def test_drives_of_a_description_refuse_an_engine_that_they_do_not_fit() -> None:
    engine = RigidPlant(manipulator().with_armature(0.1))
    for hardware in (rbi.Hardware(joint_stiffness=1e4), rbi.Hardware(rotor_inertia=0.2)):
        with pytest.raises(rbi.ParameterError):
            DrivenPlant.for_(hardware, engine)
    law = rbi.HardwareController(engine.arm, rbi.Hardware(), bandwidths=(20.0, 60.0))
    driven, hold = DrivenPlant(engine), rbi.trajectories.hold(engine.arm)
    with pytest.raises(rbi.ParameterError, match="without drives"):
        rbi.simulate(law, driven, hold, hardware=rbi.Hardware(), duration=0.01)


# --- what is refused ----------------------------------------------------------------------------------------------


def test_step_that_is_too_long_for_a_spring_is_refused_with_the_substeps_that_it_needs() -> None:
    arm, h = manipulator(), 1e-3
    plant = DrivenPlant(arm, stiffness=[1e3, 1e3, 1e3, 1e3, 1e3, 1e7])
    with pytest.raises(rbi.ParameterError, match=f"joint '{arm.joint_names[5]}'") as caught:
        plant.begin(arm.neutral, np.zeros(6), h)
    needed = int(str(caught.value).split(" times the substeps")[0].split()[-1])
    plant.begin(arm.neutral, np.zeros(6), h / needed)
    with pytest.raises(rbi.ParameterError, match="2 times the substeps"):
        plant.begin(arm.neutral, np.zeros(6), h / (needed - 1))


@pytest.mark.parametrize(("share", "is_stable"), [(0.98, True), (1.02, False)])
def test_rule_for_the_step_is_where_two_masses_part(share: float, is_stable: bool) -> None:
    mobility = 1.0 / M + 1.0 / B
    h = share * (np.sqrt(D**2 + 4.0 * K / mobility) - D) / K  # (h²·K + 2·h·D)·(1/M + 1/B) = 4
    plant = DrivenPlant(floating(), stiffness=K, damping=D)
    start = stretched(plant, np.array([0.01]), 1e-4)
    delta = np.abs(column(steps(plant, start, np.zeros(1), h, 300), "delta"))
    assert (delta[-1] < 0.01) == is_stable
    with pytest.raises(rbi.ParameterError):
        plant.begin(np.zeros(1), np.zeros(1), h)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"stiffness": 0.0}, "stiffness must be positive"),
        ({"stiffness": [1e3, np.nan, 1e3]}, "stiffness must be positive"),
        ({"time_constant": -1e-3}, "time_constant must be zero or positive"),
        ({"ripple": -0.1}, "ripple must be zero or positive"),
        ({"cogging": np.inf}, "cogging must be zero or positive"),
        ({"ripple_periods": 2.5}, "ripple_periods must be whole"),
        ({"stiffness": 1e3, "damping": -1.0}, "damping must be zero or positive"),
        ({"stiffness": 1e3, "rotor_inertia": 0.0}, "at joint 'spin'"),
        ({"encoders": "wheel"}, "encoders must be"),
    ],
)
def test_parameter_that_cannot_be_is_refused(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(rbi.ParameterError, match=words):
        DrivenPlant(spinner(), **settings)


def test_parameters_for_another_arm_are_refused() -> None:
    with pytest.raises(rbi.DimensionError, match="time_constant"):
        DrivenPlant(spinner(), time_constant=[1e-3, 1e-3])
    with pytest.raises(rbi.DimensionError, match="stiffness"):
        DrivenPlant(spinner(), stiffness=[1e3, 1e3])


def test_rotors_are_not_counted_twice() -> None:
    links: Any = RigidPlant(spinner())
    with pytest.raises(rbi.ParameterError, match="armature of the links must be 0 at joint 'spin'"):
        DrivenPlant(links, stiffness=1e3)
    assert DrivenPlant(links, stiffness=np.inf).arm is links.arm


def test_something_that_is_no_plant_is_refused() -> None:
    links: Any = "ur5"
    with pytest.raises(rbi.ParameterError, match="links must be an ArmModel or a Plant"):
        DrivenPlant(links)


@pytest.mark.parametrize("coulomb", [0.0, 0.3])
def test_compiled_step_is_the_readable_one(coulomb: float) -> None:
    arm = spinner().with_armature(0.1).with_friction(coulomb / 2.0, coulomb)
    links = StickingPlant(arm, 0.3) if coulomb else arm
    drives: dict[str, Any] = {"time_constant": 2e-3, "ripple": 0.1, "cogging": 0.2}
    plant, h = DrivenPlant(links, dead_time=2e-3, **drives), 1e-3
    rng = np.random.default_rng(0)
    states = [plant.begin(arm.neutral, rng.normal(size=arm.nv), h)] * 2
    for i in range(200):
        tau = 3.0 * rng.normal(size=arm.nv)
        arguments = tau, rbi.JointTorque(0.1 * np.ones(arm.nv)), i * h, h
        states = [plant.step(states[0], *arguments), plant._plain_step(states[1], *arguments)]
        for one, other in zip(states[0].links, states[1].links, strict=True):
            assert one == pytest.approx(other, rel=1e-9, abs=1e-9)
    assert states[0].torque == pytest.approx(states[1].torque, abs=1e-9)
    assert np.array_equal(states[0].pending, states[1].pending)


def test_dead_time_holds_a_torque_back_for_its_whole_steps() -> None:
    arm, h = floating(), 1e-3
    plant = DrivenPlant(arm, dead_time=3e-3)
    states = steps(plant, plant.begin(arm.neutral, np.zeros(1), h), np.array([0.7]), h, 5)
    v = np.array([state.links.v[0] for state in states])
    assert v[:4] == pytest.approx(0.0, abs=1e-15)
    assert np.diff(v)[3:] == pytest.approx(h * 0.7 / (M + B), rel=1e-9)
    with pytest.raises(rbi.ParameterError, match="dead_time"):
        plant.begin(arm.neutral, np.zeros(1), 2e-3)
