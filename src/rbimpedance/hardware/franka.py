"""Franka Research 3 by the maker's own client, pylibfranka: torque control at 1 kHz."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from .._common.arrays import Array
from ..exceptions import MissingExtraError, RobotError
from ..robot.arm_model import ArmModel
from .protocol import Conventions, RobotState

JOINTS = tuple(f"fr3_joint{i}" for i in range(1, 8))

FR3 = Conventions(
    "franka",
    JOINTS,
    period=1e-3,
    effort=[87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0],
    torque_rate=1000.0,
    velocity=[2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26],
    adds_gravity=True,
    adds_friction=True,
    longest_gap=20,
    notes=(
        "the robot adds the gravity torque of itself, its end effector and the declared load; the command goes "
        "without it",
        "a command may differ from the one before by 1 N·m (1000 N·m/s): controller_torque_discontinuity",
        "a cycle without a command repeats the last torque; 20 in a row stop the robot: "
        "communication_constraints_violation",
        "the reflex stops the robot where its estimate of the external torque passes `collision`; an undeclared "
        "payload is part of that",
        "the motors' friction is compensated below the torque command",
        "q and v are of the joints in rad and rad/s; forces of O_F_ext are in the base frame O, of K_F_ext in the "
        "stiffness frame K",
        "start it unlocked, with FCI activated, and the external activation device released",
    ),
)
"""Conventions of the Franka Research 3, by the maker's documentation of the Franka Control Interface."""


def client() -> ModuleType:
    """Return the module pylibfranka.

    Raises:
        MissingExtraError: It is not installed.
    """
    try:
        import pylibfranka  # noqa: PLC0415 (an optional extra)
    except ImportError as error:
        raise MissingExtraError("a Franka robot", "franka") from error
    module: ModuleType = pylibfranka
    return module


class Franka:
    """A Franka Research 3, or a server that speaks its protocol.

    Attributes:
        conventions: `FR3`.

    Args:
        host: Address of the robot.
        arm: The robot as it knows itself, with the end effector and the declared load, if it does not report
            its gravity: a server that simulates one may not.
        realtime: Whether a kernel with real-time scheduling is required (PREEMPT_RT).
        collision: Thresholds of the external torque at which the reflex stops the robot, shape (7,) [N·m]; the forces
            at the tool have as many newtons as the largest.

    Raises:
        MissingExtraError: pylibfranka is not installed.
        RobotError: There is no robot at the address, or it refuses.
    """

    def __init__(
        self,
        host: str,
        arm: ArmModel | None = None,
        *,
        realtime: bool = False,
        collision: tuple[float, ...] = (87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0),
    ) -> None:
        self.conventions, self._arm = FR3, None if arm is None else arm.copy()
        self._library: Any = client()
        self._control: Any = None
        config = self._library.RealtimeConfig
        mode = config.kEnforce if realtime else config.kIgnore
        self._robot: Any = self._ask(self._library.Robot, host, mode)
        self._model: Any = self._ask(self._robot.load_model)
        joints, forces = list(collision), [max(collision)] * 6
        behaviour = (joints, joints, forces, forces)
        self._ask(self._robot.set_collision_behavior, *behaviour)
        self._last: Any = None

    def start(self) -> None:
        """Begin torque control; an error that is still latched is cleared first. See `Robot.start`."""
        self._ask(self._robot.automatic_error_recovery)
        self._control = self._ask(self._robot.start_torque_control)

    def read(self) -> RobotState:
        """Wait for the next cycle; see `Robot.read`."""
        if self._control is None:
            state = self._ask(self._robot.read_once)
        else:
            state, _ = self._ask(self._control.readOnce)
        self._last = state
        arrays = (state.q, state.dq, state.tau_J_d, state.tau_ext_hat_filtered)
        return RobotState(state.time.to_sec(), *(np.array(x) for x in arrays))

    def gravity(self, q: Array) -> Array:
        """Return the gravity torque that the robot adds, by its own model at its latest state; see `Robot.gravity`.

        Raises:
            RobotError: The robot reports no gravity, and no `arm` is given.
        """
        if any(self._last.O_ddP_O):
            return np.array(self._model.gravity(self._last))
        if self._arm is None:
            words = "it reports no gravity (O_ddP_O is zero); give the model that it has of itself, arm="
            raise RobotError(self.conventions.name, words)
        return self._arm.raw_dynamics.bias(q, np.zeros(self._arm.nv))

    def write(self, command: Array) -> None:
        """Send the torque of this cycle; see `Robot.write`."""
        self._ask(self._control.writeOnce, self._library.Torques(command.tolist()))

    def stop(self) -> None:
        """End torque control: the robot holds itself; see `Robot.stop`."""
        control, self._control = self._control, None
        if control is None:
            return
        try:
            last = self._library.Torques(list(self._last.tau_J_d))
            last.motion_finished = True
            control.writeOnce(last)
        except Exception:
            self._quietly(self._robot.stop)

    def _ask(self, function: Any, *arguments: Any) -> Any:
        """Call the client; its exceptions become a `RobotError`."""
        try:
            return function(*arguments)
        except (
            RuntimeError,
            ValueError,
        ) as error:  # every exception of the client is a RuntimeError
            raise RobotError(self.conventions.name, str(error)) from error

    @staticmethod
    def _quietly(function: Any) -> None:
        try:
            function()
        except RuntimeError:
            return
