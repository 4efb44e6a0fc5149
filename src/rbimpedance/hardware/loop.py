"""The one loop for every robot: checks, soft start, guard, limits in the robot's cycles, statistics, clean stop."""

from __future__ import annotations

import gc
from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np

from .._common.arrays import Array, positive_number
from ..control.guards import FaultError, FaultGuard, OperatingRange, SoftStart
from ..control.protocol import WrappableController
from ..control.telemetry import Situation
from ..exceptions import RobotError
from ..trajectories import Reference, Trajectory, hold
from ..trajectories.blends import to_rest
from .checks import check_controller, check_start
from .limiter import CommandLimiter
from .protocol import Robot, RobotState
from .report import Recorder, RobotRun

SPEED_SHARE = 0.9
"""Share of the robot's speed limit from which the guard stops the arm: the robot's own reflex is harder."""


class Driver:
    """A controller on a robot, cycle by cycle; `run` is the loop around it.

    Args:
        robot: The robot.
        controller: What drives it, without guards: they are put around it here.
        soft_start: Time in which the controller takes the arm over [s].
        compliant: Whether the robot's estimate of the external torque goes to the controller: the arm yields to a
            push, and to a payload that the robot does not know. Without it the arm holds against both.
        log: Ticks that the log holds.

    Raises:
        UnsafeError: The controller is for another robot or period, or has no limits.
    """

    def __init__(
        self,
        robot: Robot,
        controller: WrappableController[Any],
        *,
        soft_start: float = 1.0,
        compliant: bool = False,
        log: int = 10_000,
    ) -> None:
        arm, conventions = controller.arm, robot.conventions
        self.robot, self.controller, self.compliant = robot, controller, compliant
        self.soft_start = positive_number("soft_start", soft_start, "time in seconds")
        self.recorder = Recorder(arm.nq, arm.nv, log)
        self._limiter = CommandLimiter(conventions)
        check_controller(conventions, controller)
        speed = np.minimum(arm.velocity_limit, SPEED_SHARE * conventions.velocity)
        self._guard = FaultGuard(
            SoftStart(controller, soft_start),
            "stop",
            range=OperatingRange(arm, velocity=speed),
            on_event=self.recorder.events.append,
        )
        self._guard.warm_up()
        self._zero = np.zeros(arm.nv)

    def begin(self, reference: Reference) -> None:
        """Check the start, and begin torque control with the torque that the robot gives now.

        Args:
            reference: Desired motion at the start.

        Raises:
            UnsafeError: Something is not safe; nothing was sent.
            RobotError: The robot refuses.
        """
        check_start(self.robot, self.controller, self.robot.read(), reference)
        self.robot.start()
        self._before = now = self.robot.read()
        self._start, self._command = now.time, now.command
        tau = now.command + self.robot.gravity(now.q)
        given = Situation(now.q, now.v, self._zero, reference, tau, self._zero)
        self._state = self._guard.handover(self._guard.init(), given)
        self._tick(now, 1, reference, perf_counter())

    @property
    def time(self) -> float:
        """Time of the latest state since the start, on the robot's clock [s]."""
        return self._before.time - self._start

    def cycle(self, trajectory: Trajectory) -> bool:
        """Wait for the next state and answer it; return whether brakes are requested.

        A state of the same cycle is answered with the same command, and one that comes cycles late with a tick over
        that time.

        Args:
            trajectory: Desired motion.

        Raises:
            RobotError: The robot has stopped.
        """
        now = self.robot.read()
        begun = perf_counter()
        cycles = round((now.time - self._before.time) / self.robot.conventions.period)
        if cycles < 1:
            self.recorder.repeated += 1
            self.robot.write(self._command)
            return False
        self._before = now
        return self._tick(now, cycles, trajectory(self.time), begun)

    def _tick(self, now: RobotState, cycles: int, reference: Reference, begun: float) -> bool:
        """The torque for a state, within the limits, in the robot's convention."""
        period = None if cycles == 1 else cycles * self.robot.conventions.period
        pushed = now.tau_ext if self.compliant else self._zero
        output, self._state = self._guard.step(self._state, now.q, now.v, reference, pushed, period)
        wanted = output.tau - self.robot.gravity(now.q)
        command, is_limited = self._limiter.limit(wanted, now.command)
        self.robot.write(command)
        self._record(now, cycles, output.e1, output.tau, command, is_limited, begun)
        self._command = command
        return bool(output.brakes_requested)

    def _record(
        self,
        now: RobotState,
        cycles: int,
        e1: Array,
        tau: Array,
        command: Array,
        is_limited: bool,
        begun: float,
    ) -> None:
        delay, work = self._limiter.on_their_way, perf_counter() - begun
        row = (self.time, now.q, now.v, e1, tau, command, cycles, delay, work)
        counts = self.time > 2.0 * self.soft_start
        self.recorder.add(row, limited=is_limited, counts=counts, before=self._command)


def run(
    robot: Robot,
    controller: WrappableController[Any],
    trajectory: Trajectory | None = None,
    *,
    duration: float,
    soft_start: float = 1.0,
    stop_time: float = 0.5,
    compliant: bool = False,
    log: float = 60.0,
    on_tick: Callable[[float], object] | None = None,
) -> RobotRun:
    """Drive a robot: check, start softly, run, come to rest, hand the robot back.

    The torque of the controller leaves as the robot expects it: without gravity where the robot adds its own, within
    its limits of torque and torque rate, counted in its own cycles (`CommandLimiter`). It begins at the torque that the
    robot gives. Ctrl-C ends the motion as its end does: the reference comes to rest within `stop_time`.

    Args:
        robot: The robot.
        controller: What drives it, with limits; a guard and a soft start are put around it.
        trajectory: Desired motion over the time since the start, beginning near the arm; by default the arm holds where
            it is.
        duration: Length of the run, without coming to rest [s].
        soft_start: Time in which the controller takes the arm over [s].
        stop_time: Time in which the motion comes to rest at the end [s].
        compliant: Whether the robot's estimate of the external torque goes to the controller; see `Driver`.
        log: Length of the last part that is logged [s].
        on_tick: Called after every tick with its time, for progress.

    Raises:
        UnsafeError: Something is not safe; nothing was sent.
        RobotError: The robot has stopped by itself, or its measurements failed for so long that brakes were needed;
            its `run` is what was recorded.
    """
    length = round(min(log, duration + stop_time + 1.0) / controller.dt)
    driver = Driver(
        robot, controller, soft_start=soft_start, compliant=compliant, log=max(length, 1)
    )
    motion = (
        hold(controller.arm, robot.read().q, check_limits=False)
        if trajectory is None
        else trajectory
    )
    collected = gc.isenabled()
    gc.collect()
    gc.freeze()
    try:
        gc.disable()
        ended = _driven(driver, motion, duration, stop_time, on_tick)
    except (RobotError, FaultError) as error:
        reason = error.reason if isinstance(error, RobotError) else str(error)
        raise RobotError(robot.conventions.name, reason, driver.recorder.run(reason)) from error
    finally:
        robot.stop()
        gc.unfreeze()
        if collected:
            gc.enable()
    return driver.recorder.run(ended)


def _driven(
    driver: Driver,
    motion: Trajectory,
    duration: float,
    stop_time: float,
    on_tick: Callable[[float], object] | None,
) -> str:
    """Run to the end or to Ctrl-C, then to rest; return why the motion ended."""
    name, ended = driver.robot.conventions.name, "finished"
    driver.begin(motion(0.0))
    try:
        while driver.time < duration:
            if driver.cycle(motion):
                raise RobotError(name, "measurements are lost, brakes are needed")
            if on_tick is not None:
                on_tick(driver.time)
    except KeyboardInterrupt:
        ended = "interrupted"
    rest = to_rest(driver.controller.arm, motion(driver.time), driver.time, stop_time)
    while driver.time < rest.gap.start + 1.5 * stop_time:
        if driver.cycle(rest):
            raise RobotError(name, "measurements are lost, brakes are needed")
    return ended
