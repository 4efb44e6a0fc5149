"""`SimulatedRobot`: the library's own simulation behind the protocol of a real robot, as strict as one."""

from __future__ import annotations

from time import perf_counter, sleep
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, per_joint
from .._common.brief import brief_repr
from ..control.losses import Losses
from ..exceptions import RobotError
from ..interaction import Interaction
from ..interaction.wrenches import Nothing
from ..robot.arm_model import ArmModel
from ..simulation.plants.protocol import Plant
from ..simulation.plants.rigid import RigidPlant
from .protocol import Conventions, RobotState

_ROUNDING = 1e-6


@brief_repr("conventions", "losses")
class SimulatedRobot:
    """A robot out of the simulator, for trying a loop before there is a robot.

    It has a clock of its own, adds its own gravity, holds the last torque where a cycle gets no command, and stops with
    a `RobotError` where a real one would: too large a torque, a step of the torque, a joint that is too fast, too many
    cycles without a command.

    Attributes:
        conventions: What it expects.
        losses: Cycles whose state does not reach the controller.

    Args:
        arm: What the robot knows of itself: its gravity is added by it.
        plant: The links as they are, a payload that nobody has declared among them; `arm` by default.
        q: Where it starts, shape (nq,); `arm.ready` by default.
        period: Of its cycle [s].
        torque_rate: Largest change of the command in a second, scalar or (nv,) [N·m/s or N/s].
        adds_gravity: Whether it adds the torque that holds its own weight.
        losses: Cycles whose state is lost; none by default.
        paced: Whether its clock is the computer's: a cycle passes in real time, also while nobody answers. Otherwise
            the next cycle begins when it is read.
        environment: What pushes on it.
        substeps: Steps of the physics in a cycle.
    """

    def __init__(
        self,
        arm: ArmModel,
        plant: ArmModel | Plant[Any] | None = None,
        q: ArrayLike | None = None,
        *,
        period: float = 1e-3,
        torque_rate: ArrayLike = 1000.0,
        adds_gravity: bool = True,
        losses: Losses | None = None,
        paced: bool = False,
        environment: Interaction | None = None,
        substeps: int = 2,
    ) -> None:
        self._arm, links = arm.copy(), arm if plant is None else plant
        self._plant: Plant[Any] = RigidPlant(links) if isinstance(links, ArmModel) else links
        limits = (arm.effort_limit, arm.velocity_limit)
        effort, velocity = (np.where(np.isfinite(x), x, 1e3) for x in limits)
        self.conventions = Conventions(
            f"simulated {arm.name}",
            arm.joint_names,
            period=period,
            effort=effort,
            torque_rate=per_joint("torque_rate", np.asarray(torque_rate, dtype=float), arm.nv),
            velocity=velocity,
            adds_gravity=adds_gravity,
            adds_friction=False,
            notes=("a simulation: it stops where a real robot would, and harms nobody",),
        )
        self.losses = Losses() if losses is None else losses
        self._environment = Nothing() if environment is None else environment
        self._substeps, self._paced = substeps, paced
        start = arm.ready if q is None else arm.check_configuration("q", q)
        self._state = self._plant.begin(np.array(start), np.zeros(arm.nv), period / substeps)
        self._cycle = self._remaining = self._unanswered = 0
        self._command, self._sent = np.zeros(arm.nv), np.zeros(arm.nv)
        self._runs, self._due = False, perf_counter() + period

    def start(self) -> None:
        """Begin torque control; see `Robot.start`."""
        self._runs, self._unanswered = True, 0

    def stop(self) -> None:
        """End torque control: the arm is at rest, as with its brakes on; see `Robot.stop`."""
        q, v = self._plant.measured(self._state)
        h = self.conventions.period / self._substeps
        self._state = self._plant.begin(q, np.zeros_like(v), h)
        self._runs = False
        self._command = self._sent = np.zeros(self._arm.nv)

    def gravity(self, q: Array) -> Array:
        """Return the torque that holds its own weight; see `Robot.gravity`."""
        rest = np.zeros(self._arm.nv)
        return self._arm.raw_dynamics.bias(q, rest) if self.conventions.adds_gravity else rest

    def read(self) -> RobotState:
        """Continue to the next cycle whose state arrives; see `Robot.read`."""
        for _ in range(self._cycles_to_pass()):
            self._pass_cycle()
        while self._runs and self._is_lost():
            self._pass_cycle()
        q, v = self._plant.measured(self._state)
        time = self._cycle * self.conventions.period
        return RobotState(time, q.copy(), v.copy(), self._command.copy(), np.zeros(len(v)))

    def write(self, command: Array) -> None:
        """Take the torque of this cycle; see `Robot.write`."""
        self._sent, self._unanswered = np.array(command, dtype=float), 0

    def _cycles_to_pass(self) -> int:
        """One, or as many as the computer's clock says."""
        if not self._paced:
            return 1
        period = self.conventions.period
        if (early := self._due - perf_counter()) > 0.0:
            sleep(early)
        cycles = 1 + int((perf_counter() - self._due) / period)
        self._due += cycles * period
        return cycles

    def _is_lost(self) -> bool:
        self._remaining = self.losses.remaining(self._remaining, self._cycle)
        return self._remaining > 0

    def _pass_cycle(self) -> None:
        """A cycle under the last command that was sent."""
        self._cycle += 1
        if not self._runs:
            return
        self._take_command()
        h = self.conventions.period / self._substeps
        tau = self._command + self.gravity(self._plant.measured(self._state).q)
        t = self._cycle * self.conventions.period
        for k in range(self._substeps):
            self._state = self._plant.step(self._state, tau, self._environment, t + k * h, h)
        v = self._plant.measured(self._state).v
        self._stop_where(~(np.abs(v) <= self.conventions.velocity), "joint velocity violation", v)

    def _take_command(self) -> None:
        """Compare the command with the limits, as a robot does, and apply it."""
        known, period = self.conventions, self.conventions.period
        self._unanswered += 1
        if self._unanswered > known.longest_gap:
            self._runs = False
            words = f"communication: {self._unanswered} cycles without a command"
            raise RobotError(known.name, words)
        rate = (self._sent - self._command) / period
        beyond = ~(np.abs(rate) <= known.torque_rate * (1.0 + _ROUNDING))
        self._stop_where(beyond, "torque discontinuity", rate)
        beyond = ~(np.abs(self._sent) <= known.effort * (1.0 + _ROUNDING))
        self._stop_where(beyond, "torque beyond its limit", self._sent)
        self._command = self._sent

    def _stop_where(self, wrong: Any, words: str, values: Array) -> None:
        if wrong.any():
            self._runs = False
            j = int(np.argmax(wrong))
            name = self.conventions.joint_names[j]
            raise RobotError(self.conventions.name, f"{words} at {name}: {values[j]:.4g}")
