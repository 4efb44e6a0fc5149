"""`SimulationResult`: the log of a run, its metrics, and its file."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from .._common.arrays import Array, BoolArray
from .._common.deprecation import renamed_arguments, renamed_attribute
from .._common.leaf import leaf
from ..control.telemetry import CHANNELS
from ..exceptions import ModelError, ParameterError
from ..interaction import EnvironmentLike
from ..logs import Log
from ..logs.arm_log import positions
from ..robot.arm_model import ArmModel
from . import result_file
from .forces import Forces
from .run_log import RunLog, settling_time
from .tool_log import tool_log
from .verdict import Verdict, growth, verdict_of
from .violations import Excess, excess

SETTLING_TOLERANCES = (1e-2, 1e-3, 1e-4)
"""Errors whose settling times are reported [rad or m]."""


class Animation(Protocol):
    """What `SimulationResult.animate` returns: a `Viewer`."""

    @property
    def arm(self) -> ArmModel:
        """The arm that is shown."""

    @property
    def url(self) -> str:
        """Address of the animation on this machine."""

    def html(self) -> str:
        """Return the page."""

    def open(self) -> Animation:
        """Open it in the browser."""

    def save_html(self, path: str | os.PathLike[str]) -> Path:
        """Write it as one HTML file that works offline."""

    def close(self) -> None:
        """Stop serving it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SimulationResult(RunLog):
    """Log of a closed loop; the first axis of every array is time.

    Attributes:
        t: Times k·dt, shape (N,) [s].
        q: Configuration, shape (N, nq).
        v: Velocity, shape (N, nv) [rad/s or m/s].
        q_r: Impedance reference, shape (N, nq).
        e1: Position error q_r (-) q, shape (N, nv) [rad or m].
        e2: Velocity error, shape (N, nv) [rad/s or m/s].
        e_im: Impedance error of the paper's eq. (5), shape (N, nv) [N·m or N].
        s: Sliding variable, shape (N, nv).
        tau: Motor torque held from t on, shape (N, nv) [N·m or N].
        tau_ext: Torque of the environment at t, shape (N, nv) [N·m or N].
        saturated: Whether the joint is at its torque limit, shape (N, nv), bool.
        rate_limited: Whether its torque may not change faster, shape (N, nv), bool.
        clipped: Whether a `BoundedSurface` sees less than its whole error, shape (N, nv), bool.
        reference_limited: Whether a `ReferenceGuard` holds its reference back, shape (N, nv), bool.
        provenance: What produced it: versions, model names and digests, gains, periods.
        plant: The simulated arm, for pictures; None in a result from a file, which does not hold it.
        tool: What a `CartesianController` did at its frame; None for other controllers.
        forces: What pushed on it, for `wrench` and `tau_stop`; None in a result from a file or another process.
    """

    plant: ArmModel | None = None
    forces: Forces | None = field(default=None, repr=False)
    _derived: dict[str, Array] = field(default_factory=dict, init=False, repr=False)

    def __repr__(self) -> str:
        name = self.provenance.get("plant", {}).get("name", "")
        size = f"{len(self.t)} samples of {self.v.shape[1]} joints, t = {self.t[0]:g} to {self.t[-1]:g} s"
        return f"SimulationResult({name!r}, {size}:\n    {self.verdict()})"

    @property
    def wrench(self) -> Array:
        """Wrench of the environment at the tool frame, in world axes, shape (N, 6) [N, N·m].

        Force and moment on the robot of all that acts at frames (`FrameWrench`, `Wall`, `Push`), the moment about the
        tool frame's origin: for a `Wall` at the tool, its contact force. Zero where nothing acts at a frame, and for a
        `JointTorque`, which is no wrench. NaN for an interaction of one's own without `wrenches`, and in files of
        versions that did not log it. Contacts that a plant has by itself are in `tau_ext` only.
        """
        return self._derive("wrench")

    @property
    def tau_stop(self) -> Array:
        """Torque of the joint stops, shape (N, nv) [N·m or N]; zero without stops, NaN in files without it."""
        return self._derive("tau_stop")

    def _derive(self, name: str) -> Array:
        if name not in self._derived:
            if self.forces is None or self.plant is None:
                samples = len(self.t), self.q.shape[1], self.v.shape[1]
                (channel,) = (c for c in CHANNELS if c.name == name)
                array = np.full_like(channel.empty(*samples), np.nan)
            elif name == "wrench":
                array = self.forces.wrench(self.plant, self.t, self.q, self.v)
            else:
                array = self.forces.tau_stop(self.plant, self.q, self.v)
            self._derived[name] = array
        return self._derived[name]

    def __getstate__(self) -> dict[str, Any]:
        """Leave what pushed on the arm, which may be functions, behind."""
        derived = {name: self._derive(name) for name in ("wrench", "tau_stop")}
        return self.__dict__ | {"forces": None, "_derived": derived}

    def samples_after(self, after: float) -> BoolArray:
        """Return which samples are not before a time, shape (N,).

        Args:
            after: The time [s].

        Raises:
            ParameterError: Fewer than two samples remain.
        """
        kept: BoolArray = self.t >= after
        if np.count_nonzero(kept) < 2:
            words = f"before the last two samples, below {self.t[-1]:g} s"
            raise ParameterError("after", after, words)
        return kept

    def metrics(self, *, after: float = 0.0) -> dict[str, Array]:
        """Return figures of merit per joint, each of shape (nv,).

        `e1_max`, `e1_rms` (and so for e2 and e_im): largest and root-mean-square absolute value.
        `settling_1e-2`, `_1e-3`, `_1e-4`: first time from which abs(e1) stays within that [s]; infinite if never.
        `tau_peak`: largest absolute torque. `tau_variation`: total variation of the torque per second [N·m/s].
        `position_violations`, `velocity_violations`, `effort_violations`: number of samples beyond the arm's limit;
        `position_excess` and so on: how far beyond at most, 0 inside (`excess` says when).
        `e1_growth`: rms error of the last quarter relative to that of the one before; 1 where both are zero.

        Args:
            after: Leave out the samples before this time [s] (settling times always look at the whole run).

        Raises:
            ParameterError: Fewer than two samples remain.
        """
        kept = self.samples_after(after)
        figures: dict[str, Array] = {}
        for name in ("e1", "e2", "e_im"):
            size = np.abs(getattr(self, name)[kept])
            figures[f"{name}_max"] = size.max(axis=0)
            figures[f"{name}_rms"] = np.sqrt(np.mean(size**2, axis=0))
        for tolerance in SETTLING_TOLERANCES:
            figures[f"settling_1e{round(np.log10(tolerance))}"] = self.settling_time(tolerance)
        tau, span = self.tau[kept], self.t[kept][-1] - self.t[kept][0]
        figures["tau_peak"] = np.abs(tau).max(axis=0)
        figures["tau_variation"] = np.abs(np.diff(tau, axis=0)).sum(axis=0) / span
        for name, beyond in excess(self)._asdict().items():
            figures[f"{name}_violations"] = np.count_nonzero(beyond[kept] > 0.0, axis=0).astype(
                float
            )
            figures[f"{name}_excess"] = np.maximum(beyond[kept].max(axis=0), 0.0)
        figures["e1_growth"] = growth(self)
        return figures

    def excess(self) -> Excess:
        """Return how far every joint is beyond its position, velocity and effort limit at every sample.

        Negative inside, -inf where there is no limit, or where a file does not say them: `excess().position > 0` says
        when which joint was outside.
        """
        return excess(self)

    def verdict(self) -> Verdict:
        """Return whether the run failed, and why; as text it is one sentence.

        The whole run counts. Its start ends when the error has fallen to a tenth, at the latest in its middle.
        Errors are those from the impedance reference, which yields to a push that is measured: an arm that gives way
        as its target says has none; a `CompliantController` may yield as far as its spring does. As a truth value it is
        True for a run that did not fail. A run has failed if

        - a joint diverged: the run ended with a `DivergenceError`, whose `result` this is;
        - a joint was more than 0.01 rad or m beyond its position limit, and beyond where it began;
        - its error is large and does not fall: in the last quarter of the run, the root-mean-square of e1 is above
          0.05 rad or 0.01 m plus a tenth of the range of the joint's reference, at most 0.5, and above 0.8 times that
          of the quarter before;
        - the pose error of a controller at the tool is large and does not fall: above 0.05 m or rad in the same sense;
        - a joint deviated far, also where it came back: abs(e1) was above 0.1 rad or 0.02 m plus half of the range of
          its reference, at most 0.5, plus 1.5 times the largest error at the start and what half a second of the
          velocity error there makes. With more than that, the arm was somewhere else than its motion;
        - a torque passed the effort limit of its joint: no motor could have done it;
        - a torque was at its limit in more than a tenth of the ticks after the start: the arm needs more than it has;
        - a torque chatters after the start: it varies by more than ten times what its motion needs, with a ripple above
          a thousandth of the joint's torque limit. Where sensors are noisy, above a tenth (`simulation.chatter`).

        A joint that only touches its stop, saturates on its way from a far start, or follows a small error is not
        a failure; neither is one that was faster than its velocity limit, which `metrics` counts.
        """
        return verdict_of(self)

    def settling_time(self, tolerance: float) -> Array:
        """Return the first time from which abs(e1) stays within a tolerance, shape (nv,) [s]; infinite if never.

        Args:
            tolerance: Error allowed [rad or m].
        """
        return settling_time(self.t, self.e1, tolerance)

    @renamed_arguments(wrench="environment")
    def animate(
        self,
        *,
        robot: object = None,
        environment: EnvironmentLike | None = None,
        fps: float = 30.0,
        open: bool = False,
        port: int = 0,
    ) -> Animation:
        """Show the run: the arm, its reference as a ghost, the force on it, the path of its tool.

        The same as `pictures.animate`, where the arguments and errors are described; it returns at once.
        """
        viewer: Animation = leaf("pictures.viewer").animate(
            self, robot=robot, environment=environment, fps=fps, open=open, port=port
        )
        return viewer

    @renamed_arguments(wrench="environment")
    def save_html(
        self,
        path: str | os.PathLike[str],
        *,
        robot: object = None,
        environment: EnvironmentLike | None = None,
        fps: float = 30.0,
    ) -> Path:
        """Write the animation of `animate` as one HTML file that works offline.

        Args:
            path: Where to.
            robot: See `pictures.animate`, as for the others.
            environment: What `simulate` was given.
            fps: Frames per second of the run.

        Returns:
            The path that was written.

        Raises:
            ModelError: The result does not say which robot it was, or the robot given has other joints.
            ParameterError: `fps` is not positive.
        """
        return self.animate(robot=robot, environment=environment, fps=fps).save_html(path)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the result as an npz file with units and provenance; the file appears whole or not at all.

        Args:
            path: Where to; ".npz" is appended where the name has no such ending.

        Returns:
            The path that was written.
        """
        arrays = {channel.name: getattr(self, channel.name) for channel in CHANNELS}
        arrays |= {} if self.tool is None else self.tool.channels()
        return result_file.write(path, result_file.Content(arrays, self.provenance))

    def log(self, arm: ArmModel | None = None) -> Log:
        """Return what the arm's own sensors saw as a `Log`: positions, velocities, motor torques and tau_ext.

        Args:
            arm: The arm, where the result is from a file, which does not hold it.

        Raises:
            ParameterError: No arm is known, and the configurations do not say the joints' positions.
        """
        arm = arm or self.plant
        if arm is None and self.q.shape != self.v.shape:
            raise ParameterError("arm", arm, "the arm of this run: it has continuous joints")
        return Log.from_arrays(
            self.t,
            self.q if arm is None else positions(arm, self.q),
            joint_names=self.joint_names,
            velocity=self.v,
            effort=self.tau,
            external=self.tau_ext,
        )

    def save_mcap(self, path: str | os.PathLike[str]) -> Path:
        """Write `log()` as an MCAP file with the messages of ROS 2.

        Args:
            path: Where to, ending in ".mcap".

        Returns:
            The path that was written.

        Raises:
            LogError: Another ending.
            MissingExtraError: The libraries of the extra "logs" are not installed.
        """
        return self.log().save(path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> SimulationResult:
        """Read a result that `save` wrote, in this version or an earlier one.

        Channels that the earlier version did not log are NaN, flags False.

        Args:
            path: The npz file.

        Raises:
            ModelError: The file is missing, damaged, or not a result of this library.
        """
        content = result_file.read(path)
        try:
            arrays = result_file.with_unknown(content.arrays)
            tool = tool_log(arrays)
            arrays = {c.name: arrays[c.name] for c in CHANNELS}
            derived = {c.name: arrays.pop(c.name) for c in CHANNELS if c.source == "derived"}
        except KeyError as error:
            raise ModelError(
                f"'{path}' is not a complete result file written by SimulationResult.save"
            ) from error
        result = cls(**arrays, tool=tool, provenance=content.provenance)
        result._derived.update(derived)
        return result

    held = renamed_attribute("held", "reference_limited")
