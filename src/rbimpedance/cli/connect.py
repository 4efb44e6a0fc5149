"""The command `rbimpedance connect`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer

from ..control.controller import ImpedanceController
from ..control.default_gains import default_impedance
from ..control.losses import Losses
from ..exceptions import ParameterError, RobotError
from ..hardware import Conventions, Robot, RobotRun, SimulatedRobot, franka, run, ur
from ..law.impedance import Impedance
from ..law.limits import Limits
from ..robot.arm_model import ArmModel
from ..trajectories import Trajectory, from_csv
from ..tuning.gains_file import load_gains
from .option_groups import with_options
from .options import OutputOptions, RobotOptions, option
from .options import Robot as RobotArgument
from .terminal import print_json, progress, say, tell

RATE_SHARE = 0.9
"""Share of the robot's torque rate that the law may use: the rest is for gravity that changes along the way."""

_connection = partial(option, "Connection")
_simulated = partial(option, "Simulated robot")


@dataclass(frozen=True, kw_only=True)
class ConnectionOptions:
    """Where the robot is, and what it is to do."""

    host: Annotated[str | None, _connection("Address of the robot.", "HOST")] = None
    gains: Annotated[
        Path | None, _connection("Gains that tune wrote. Default: those of the arm.", "FILE")
    ] = None
    trajectory: Annotated[
        Path | None, _connection("Motion as CSV (t, joints). Default: hold where it is.", "FILE")
    ] = None
    duration: Annotated[float, _connection("Length of the run in s.", "S")] = 10.0
    effort: Annotated[
        float, _connection("Share of the robot's torque limits that is used.", "SHARE")
    ] = 1.0
    compliant: Annotated[
        bool, _connection("Yield to the robot's own estimate of pushes.", name="--compliant")
    ] = False
    yes: Annotated[bool, _connection("Begin without a question.", name="--yes")] = False

    def limits(self, conventions: Conventions) -> Limits:
        """Return the limits of the law for a robot.

        Raises:
            ParameterError: A share that is not in (0, 1].
        """
        if not 0.0 < self.effort <= 1.0:
            raise ParameterError("--effort", self.effort, "more than 0 and at most 1")
        return Limits(self.effort * conventions.effort, RATE_SHARE * conventions.torque_rate)


@dataclass(frozen=True, kw_only=True)
class SimulatedOptions:
    """What is wrong with the simulated robot."""

    payload: Annotated[float, _simulated("Payload that nobody declared, in kg.", "KG")] = 0.0
    lost: Annotated[float, _simulated("Share of cycles that are lost.", "SHARE")] = 0.0
    burst: Annotated[int, _simulated("Longest burst of lost cycles.", "N")] = 5
    paced: Annotated[
        bool, _simulated("Its clock is the computer's, as a real one's.", name="--paced")
    ] = False


@with_options
def connect(
    kind: Annotated[
        Literal["sim", "franka", "ur"],
        typer.Argument(metavar="KIND", help="sim, franka or ur (untested)."),
    ],
    robot: RobotArgument,
    reading: RobotOptions,
    connection: ConnectionOptions,
    simulated: SimulatedOptions,
    output: OutputOptions,
) -> None:
    """Drive a robot: hold where it is, or follow a motion; it starts softly and stops softly, also at Ctrl-C.

    ROBOT is its description, with the end effector and the payload that the robot itself knows. What will happen is
    printed first. The log is written to connect.npz.

    Exit code 1: the robot stopped by itself. 2: it was not driven, since something is not safe.
    """
    arm = reading.load(robot)
    there = _robot(kind, arm, connection, simulated)
    controller = _controller(arm, there.conventions, connection)
    motion = None if connection.trajectory is None else from_csv(arm, connection.trajectory)
    if not output.silent:
        _say_plan(there.conventions, controller, connection)
    if kind != "sim" and not connection.yes:
        typer.confirm("Drive the robot?", abort=True, err=True)
    output.out.mkdir(parents=True, exist_ok=True)
    file = output.out / "connect.npz"
    try:
        driven = _driven(there, controller, motion, connection, output)
    except RobotError as error:
        if error.run is not None:
            error.run.save(str(file))
            say(str(error.run.report))
        raise
    driven.save(str(file))
    if output.as_json:
        print_json(_figures(driven))
    elif not output.quiet:
        tell(f"{driven.report}\nwritten: {file}")


def _robot(
    kind: str, arm: ArmModel, connection: ConnectionOptions, simulated: SimulatedOptions
) -> Robot:
    """The robot, connected."""
    if kind == "sim":
        losses = Losses(simulated.lost, simulated.burst)
        return SimulatedRobot(
            arm, arm.with_payload(simulated.payload), losses=losses, paced=simulated.paced
        )
    if connection.host is None:
        raise ParameterError("--host", None, f"the address of the robot for {kind}")
    if kind == "franka":
        return franka.Franka(connection.host, arm)
    return ur.UniversalRobot(connection.host, arm)


def _controller(
    arm: ArmModel, conventions: Conventions, connection: ConnectionOptions
) -> ImpedanceController:
    """The law: gains of a file, or those of the arm, within the robot's limits."""
    limits = connection.limits(conventions)
    if connection.gains is None:
        return ImpedanceController(arm, dt=conventions.period, limits=limits)
    gains = load_gains(connection.gains)
    if gains.limits is not None:
        effort = np.minimum(limits.effort, gains.limits.effort)
        limits = Limits(effort, np.minimum(limits.rate, gains.limits.rate))
    return gains.controller(arm, default_impedance(arm), limits=limits)


def _say_plan(
    conventions: Conventions, controller: ImpedanceController, connection: ConnectionOptions
) -> None:
    limits = controller.limits or Limits()
    effort = ", ".join(f"{x:g}" for x in np.broadcast_to(limits.effort, controller.arm.nv))
    motion = "hold where it is" if connection.trajectory is None else f"{connection.trajectory}"
    gains = "the arm's own" if connection.gains is None else f"{connection.gains}"
    lines = [
        f"{conventions.name}, {1.0 / conventions.period:g} Hz: {motion} for {connection.duration:g} s, then to rest",
        f"gains: {gains}; impedance: {_in_words(default_impedance(controller.arm))}",
        f"torque up to {effort} N·m, {np.min(limits.rate):g} N·m/s",
        "starts at the torque that the robot gives, within 1 s; stops where measurements fail; Ctrl-C: to rest",
        *conventions.notes,
    ]
    tell("\n- ".join(lines))


def _in_words(target: Impedance) -> str:
    parts = {"M_d": target.mass, "K_d": target.stiffness}
    words = [f"{name} {np.min(x):.3g} to {np.max(x):.3g}" for name, x in parts.items()]
    return f"{', '.join(words)}, critically damped"


def _driven(
    robot: Robot,
    controller: ImpedanceController,
    motion: Trajectory | None,
    connection: ConnectionOptions,
    output: OutputOptions,
) -> RobotRun:
    """Run with a progress bar."""
    total = round(connection.duration / controller.dt)
    with progress(f"driving {robot.conventions.name}", quiet=output.silent) as update:
        return run(
            robot,
            controller,
            motion,
            duration=connection.duration,
            compliant=connection.compliant,
            on_tick=lambda t: update(min(round(t / controller.dt), total), total),
        )


def _figures(driven: RobotRun) -> dict[str, Any]:
    """The report as plain data."""
    fields = driven.report._asdict()
    events = [{"tick": each.tick, "response": each.response} for each in fields.pop("events")]
    return {**fields, "events": events}
