"""`SimulationResult`: the log of a run, its metrics, and its file."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol
from uuid import uuid4

import numpy as np

from .._common.arrays import Array, BoolArray
from .._common.deprecation import renamed_arguments, renamed_attribute
from .._common.leaf import leaf
from ..control.telemetry import FLAGS
from ..exceptions import ModelError, ParameterError
from ..interaction import EnvironmentLike
from ..robot.arm_model import ArmModel

SETTLING_TOLERANCES = (1e-2, 1e-3, 1e-4)
"""Errors whose settling times are reported [rad or m]."""

UNITS = {
    "t": "s",
    "q": "rad or m; (cos, sin) on continuous joints",
    "v": "rad/s or m/s",
    "q_r": "as q",
    "e1": "rad or m",
    "e2": "rad/s or m/s",
    "e_im": "N·m or N",
    "s": "rad/s or m/s",
    "tau": "N·m or N",
    "tau_ext": "N·m or N",
} | dict.fromkeys(FLAGS, "bool")
"""Unit of every channel."""

_FORMAT = 2


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
class SimulationResult:
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
    """

    t: Array
    q: Array
    v: Array
    q_r: Array
    e1: Array
    e2: Array
    e_im: Array
    s: Array
    tau: Array
    tau_ext: Array
    saturated: BoolArray
    rate_limited: BoolArray
    clipped: BoolArray
    reference_limited: BoolArray
    provenance: Mapping[str, Any]
    plant: ArmModel | None = None

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the columns."""
        return tuple(self.provenance["plant"]["joint_names"])

    def metrics(self, *, after: float = 0.0) -> dict[str, Array]:
        """Return figures of merit per joint, each of shape (nv,).

        `e1_max`, `e1_rms` (and so for e2 and e_im): largest and root-mean-square absolute value.
        `settling_1e-2`, `_1e-3`, `_1e-4`: first time from which abs(e1) stays within that [s]; infinite if never.
        `tau_peak`: largest absolute torque. `tau_variation`: total variation of the torque per second [N·m/s].

        Args:
            after: Leave out the samples before this time [s] (settling times always look at the whole run).

        Raises:
            ParameterError: Fewer than two samples remain.
        """
        kept = self.t >= after
        if np.count_nonzero(kept) < 2:
            raise ParameterError(
                "after", after, f"before the last two samples, below {self.t[-1]:g} s"
            )
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
        return figures

    def settling_time(self, tolerance: float) -> Array:
        """Return the first time from which abs(e1) stays within a tolerance, shape (nv,) [s]; infinite if never.

        Args:
            tolerance: Error allowed [rad or m].
        """
        outside = np.abs(self.e1) > tolerance
        after_last = len(self.t) - np.argmax(outside[::-1], axis=0)
        times = np.append(self.t, np.inf)[after_last]
        settled: Array = np.where(outside.any(axis=0), times, self.t[0])
        return settled

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
        target = Path(path)
        if target.suffix != ".npz":
            target = target.with_name(target.name + ".npz")
        header = {"format": _FORMAT, "units": UNITS, "provenance": self.provenance}
        arrays = {name: getattr(self, name) for name in UNITS}
        part = target.with_name(f"{target.name}.{uuid4().hex}.part")
        try:
            with part.open("xb") as file:
                np.savez_compressed(file, header=np.array(json.dumps(header)), **arrays)
                file.flush()
                os.fsync(file.fileno())
            part.replace(target)
        finally:
            part.unlink(missing_ok=True)
        return target

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> SimulationResult:
        """Read a result that `save` wrote.

        Args:
            path: The npz file.

        Raises:
            ModelError: The file is missing, damaged, or not a result of this library.
        """
        try:
            with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as archive:
                header = json.loads(str(archive["header"]))
                if header["format"] != _FORMAT:
                    raise ModelError(
                        f"'{path}' has result format {header['format']}; this version reads {_FORMAT}"
                    )
                arrays = {name: archive[name] for name in UNITS}
                return cls(**arrays, provenance=header["provenance"])
        except FileNotFoundError as error:
            raise ModelError(f"no result file '{path}'") from error
        except ModelError:
            raise
        except Exception as error:
            raise ModelError(
                f"'{path}' is not a whole result file written by SimulationResult.save"
            ) from error

    held = renamed_attribute("held", "reference_limited")
