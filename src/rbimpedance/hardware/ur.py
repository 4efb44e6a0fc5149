"""Universal Robots by ur_rtde's direct torque at 500 Hz. Untested: there was neither a robot nor a simulator of one.

The conventions are those of the makers of robot and client; try it with limits of a tenth of the drives' first.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, choice
from ..exceptions import MissingExtraError, RobotError
from ..robot.arm_model import ArmModel
from .protocol import Conventions, RobotState

JOINTS = (
    *("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"),
    *("wrist_1_joint", "wrist_2_joint", "wrist_3_joint"),
)

EFFORT = {
    "ur3e": (56.0, 56.0, 28.0, 12.0, 12.0, 12.0),
    "ur5e": (150.0, 150.0, 150.0, 28.0, 28.0, 28.0),
    "ur10e": (330.0, 330.0, 150.0, 56.0, 56.0, 56.0),
}
"""Largest torque of the joints by the maker's descriptions [N·m]."""


def conventions(kind: str = "ur5e", *, torque_rate: ArrayLike = 2000.0) -> Conventions:
    """Return what a robot of this series expects.

    Args:
        kind: One of `EFFORT`.
        torque_rate: Largest change of the command in a second, scalar or (6,) [N·m/s]; the maker names none, so this is
            a choice.

    Raises:
        ParameterError: Another kind.
    """
    choice("kind", kind, EFFORT)
    return Conventions(
        kind,
        JOINTS,
        period=2e-3,
        effort=EFFORT[kind],
        torque_rate=torque_rate,
        velocity=np.pi,
        adds_gravity=True,
        adds_friction=True,
        longest_gap=10,
        notes=(
            "direct torque needs PolyScope 5.23 or 10.10, and remote control",
            "the robot adds the gravity torque of itself and the declared payload; the command goes without it",
            "the robot compensates 80 to 90 % of its joints' friction, as the client asks with every command",
            "q and v are of the joints in rad and rad/s; the base frame is turned by half a turn about z against the "
            "URDF's base_link",
            "where commands fail to come the control script ends with a protective stop",
        ),
    )


class UniversalRobot:
    """An e-series robot under direct torque. Untested: see the module.

    It reports no command: the last one that was sent stands for it, so that a lost one is not seen.

    Attributes:
        conventions: See `conventions`.

    Args:
        host: Address of the robot.
        arm: The robot as it knows itself, with the declared payload: it reports no gravity torque.
        kind: One of `EFFORT`.
        torque_rate: Largest change of the command in a second, scalar or (6,) [N·m/s].

    Raises:
        MissingExtraError: ur_rtde is not installed.
        ParameterError: Another kind.
        RobotError: There is no robot at the address, or it refuses.
    """

    def __init__(
        self,
        host: str,
        arm: ArmModel,
        *,
        kind: str = "ur5e",
        torque_rate: ArrayLike = 2000.0,
    ) -> None:
        self.conventions, self._arm = conventions(kind, torque_rate=torque_rate), arm.copy()
        try:
            import rtde_control  # noqa: PLC0415 (an optional extra)
            import rtde_receive  # noqa: PLC0415
        except ImportError as error:
            raise MissingExtraError("a Universal Robot", "ur") from error
        rate = 1.0 / self.conventions.period
        try:
            self._receive: Any = rtde_receive.RTDEReceiveInterface(host, rate)
            self._control: Any = rtde_control.RTDEControlInterface(host, rate)
        except RuntimeError as error:
            raise RobotError(kind, str(error)) from error
        self._command, self._time, self._runs = np.zeros(arm.nv), -np.inf, False

    def start(self) -> None:
        """Begin torque control with a command of zero; see `Robot.start`."""
        self._command, self._runs = np.zeros(self._arm.nv), True

    def read(self) -> RobotState:
        """Wait for the next cycle; see `Robot.read`."""
        begun = self._control.initPeriod()
        while (time := self._receive.getTimestamp()) <= self._time:
            self._control.waitPeriod(begun)
            if not self._receive.isConnected():
                raise RobotError(self.conventions.name, "the connection is lost")
        self._time = time
        q, v = self._receive.getActualQ(), self._receive.getActualQd()
        return RobotState(
            time, np.array(q), np.array(v), self._command.copy(), np.zeros(self._arm.nv)
        )

    def gravity(self, q: Array) -> Array:
        """Return the gravity torque that the robot adds, by the model given; see `Robot.gravity`."""
        return self._arm.raw_dynamics.bias(q, np.zeros(self._arm.nv))

    def write(self, command: Array) -> None:
        """Send the torque of this cycle; see `Robot.write`."""
        if not self._control.directTorque(command.tolist()):
            raise RobotError(self.conventions.name, "the control script does not take the torque")
        self._command = np.array(command)

    def stop(self) -> None:
        """End torque control: the script stops, and the robot holds itself; see `Robot.stop`."""
        if self._runs:
            self._runs = False
            self._control.stopScript()
