"""The loop on a simulated robot as strict as a real one: it starts, tracks, tolerates losses, refuses and stops."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance._common.arrays import Array
from rbimpedance.control.losses import Losses
from rbimpedance.hardware import SimulatedRobot, run

ARM = rbi.load_robot("two_link")
Q = np.array([0.4, 1.2])
LIMITS = rbi.Limits(effort=30.0, rate=800.0)
RATE = 1000.0


def controller(**options: Any) -> rbi.ImpedanceController:
    return rbi.ImpedanceController(ARM, dt=1e-3, **{"limits": LIMITS, **options})


def robot(**options: Any) -> SimulatedRobot:
    plant = options.pop("plant", ARM.with_payload(0.3))
    return SimulatedRobot(ARM, plant, Q, **{"torque_rate": RATE, **options})


def swing(t: float) -> rbi.Reference:
    """A cosine that begins at rest."""
    w = np.array([3.0, 4.0])
    return rbi.Reference(
        Q + 0.2 * (1.0 - np.cos(w * t)), 0.2 * w * np.sin(w * t), 0.2 * w**2 * np.cos(w * t)
    )


def test_arm_with_a_payload_that_nobody_declared_is_held_and_handed_back_at_rest() -> None:
    simulated = robot()
    driven = run(simulated, controller(), duration=1.0, soft_start=0.3)
    assert driven.report.ended == "finished"
    assert driven.report.error_rms.max() < 1e-5
    assert np.abs(driven.log["v"][-1]).max() < 1e-3
    np.testing.assert_array_equal(simulated.read().v, 0.0)


def test_first_command_is_the_torque_that_the_robot_gave_before() -> None:
    driven = run(robot(), controller(), duration=0.1, stop_time=0.05)
    assert np.abs(driven.log["command"][0]).max() < 1e-9  # gravity is the robot's own
    steps = np.diff(driven.log["command"], axis=0)
    assert np.abs(steps).max() <= RATE * 1e-3


def test_command_leaves_without_the_gravity_that_the_robot_adds() -> None:
    driven = run(robot(plant=ARM), controller(), duration=0.6, soft_start=0.2)
    weight = ARM.bias(Q, np.zeros(2))
    np.testing.assert_allclose(driven.log["tau"][-1], weight, atol=1e-3)
    np.testing.assert_allclose(driven.log["command"][-1], 0.0, atol=1e-3)


@pytest.mark.parametrize("losses", [Losses(0.1, 5, 1), Losses(0.2, 19, 2)], ids=["10 %", "20 %"])
def test_run_survives_lost_cycles_on_a_robot_that_enforces_its_limits(losses: Losses) -> None:
    driven = run(robot(losses=losses), controller(), swing, duration=1.2, soft_start=0.3)
    assert driven.report.ended == "finished"
    assert driven.report.missed > 0.7 * losses.share * driven.report.ticks
    assert driven.report.longest_gap <= losses.burst + 1
    assert driven.report.error_rms.max() < 0.05


def test_robot_that_stops_ends_the_run_as_an_error_that_holds_the_record() -> None:
    simulated = robot(losses=Losses(0.5, 60, 0))
    with pytest.raises(rbi.RobotError, match="cycles without a command") as caught:
        run(simulated, controller(), duration=5.0)
    assert caught.value.run.report.ticks > 0
    assert caught.value.run.report.ended == caught.value.reason


class Interrupted:
    """A motion during which somebody presses Ctrl-C."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, t: float) -> rbi.Reference:
        self.calls += 1
        if self.calls == 400:
            raise KeyboardInterrupt
        return swing(t)


def test_interrupted_motion_comes_to_rest_without_a_jump() -> None:
    driven = run(robot(), controller(), Interrupted(), duration=10.0, soft_start=0.3)
    assert driven.report.ended == "interrupted"
    assert driven.report.ticks < 1500
    assert np.abs(driven.log["v"][-1]).max() < 0.02
    assert np.abs(np.diff(driven.log["command"], axis=0)).max() <= RATE * 1e-3


class Doubling:
    """A robot that reports every fifth state twice."""

    def __init__(self, inner: SimulatedRobot) -> None:
        self.inner, self.conventions, self.reads, self.state = (
            inner,
            inner.conventions,
            0,
            inner.read(),
        )

    def read(self) -> Any:
        self.reads += 1
        if self.reads % 5:
            self.state = self.inner.read()
        return self.state

    def __getattr__(self, name: str) -> Any:
        return getattr(self.inner, name)


def test_state_that_comes_twice_gets_the_same_command_and_no_tick() -> None:
    driven = run(Doubling(robot()), controller(), duration=0.4, stop_time=0.05)
    assert driven.report.repeated > 50
    assert np.diff(driven.log["t"]).min() > 0.5e-3


# --- what is refused ------------------------------------------------------------------------------------------


def refusal(simulated: SimulatedRobot, made: Any, *arguments: Any) -> str:
    with pytest.raises(rbi.UnsafeError) as caught:
        run(simulated, made, *arguments, duration=1.0)
    assert simulated.read().time < 0.01  # nothing was sent
    return str(caught.value)


def test_controller_without_limits_is_refused() -> None:
    assert "no limits" in refusal(robot(), controller(limits=None))


def test_limits_beyond_those_of_the_robot_are_refused() -> None:
    beyond = rbi.Limits(effort=30.0, rate=2000.0)
    assert "torque rate is 2000" in refusal(robot(), controller(limits=beyond))


def test_start_far_from_the_motion_is_refused() -> None:
    away = rbi.trajectories.hold(ARM, Q + 0.5)
    assert "away from where the motion begins" in refusal(robot(), controller(), away)


def test_gravity_that_is_counted_twice_is_refused() -> None:
    weightless = ARM.with_gravity([0.0, 0.0, 0.0])
    made = rbi.ImpedanceController(weightless, dt=1e-3, limits=LIMITS)
    assert "gravity is counted twice or not at all" in refusal(robot(), made)


def test_controller_of_another_period_or_another_arm_is_refused() -> None:
    slow = rbi.ImpedanceController(ARM, dt=2e-3, limits=LIMITS)
    assert "period is 0.002 s, the robot's 0.001 s" in refusal(robot(), slow)
    other = rbi.load_robot("ur5")
    wrong = rbi.ImpedanceController(other, dt=1e-3, limits=other.effort_limit)
    assert "6 joints, the robot 2" in refusal(robot(), wrong, rbi.trajectories.hold(other))


def test_report_is_a_line_of_plain_words() -> None:
    said = repr(run(robot(), controller(), duration=0.1, stop_time=0.05).report)
    assert "ticks" in said
    assert "\n" not in said


def test_robot_that_moves_is_refused() -> None:
    simulated = robot()
    moving = simulated.read()._replace(v=np.array([0.5, 0.0]))
    with pytest.raises(rbi.UnsafeError, match="moves already"):
        rbi.hardware.check_start(simulated, controller(), moving, swing(0.0))


def rows(driven: rbi.hardware.RobotRun) -> Array:
    return driven.log["t"]


def test_log_holds_the_last_part_of_the_run() -> None:
    driven = run(robot(), controller(), duration=0.2, stop_time=0.1, log=0.1)
    assert len(rows(driven)) == 100
    assert rows(driven)[-1] == pytest.approx(0.35, abs=0.01)
    assert (np.diff(rows(driven)) > 0.0).all()
