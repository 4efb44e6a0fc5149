"""Options of the law, and the controller that they mean: gains from a file, as given, or tuned."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from ..control.cartesian import CartesianController, Posture
from ..control.controller import ImpedanceController
from ..control.tool_view import AnyController
from ..exceptions import ParameterError
from ..law.super_twisting import Scheme, SuperTwisting
from ..simulation.scenarios import SurfaceName, paper_surface
from ..tuning import CartesianGainProposal, GainProposal, propose_gains
from ..tuning.gains_file import load_gains
from .notes import say_whether_rotors_lack
from .options import KnowledgeOptions, numbers, option
from .task_options import MotionOptions, Task
from .terminal import progress, say

_gains = partial(option, "Gains")

REMEDY_TIME, WITHOUT_ROTORS = 20.0, 1.0
"""Time after which no more remedies are tried for gains that are refused, and where the reason is known before [s]."""

TUNING_TIME = 5.0
"""Least length of the motion that gains are tuned for, however short the run is [s]."""


@dataclass(frozen=True, kw_only=True)
class LawOptions(KnowledgeOptions):
    """Gains, surface and scheme; without gains they are tuned."""

    gains: Annotated[
        Path | None, _gains("Gains that tune wrote, with their surface and dt.", "FILE")
    ] = None
    k1: Annotated[str | None, _gains("Gain k1, with --k2. Default: tuned.", "K[,K..]")] = None
    k2: Annotated[str | None, _gains("Gain k2, with --k1. Default: tuned.", "K[,K..]")] = None
    surface: Annotated[
        SurfaceName | None,
        _gains("With k1, k2: power, fast-terminal (default) or nonsingular-terminal.", "NAME"),
    ] = None
    scheme: Annotated[
        Scheme | None, _gains("With k1, k2: explicit, matched (default) or implicit.", "NAME")
    ] = None

    def controller(self, task: Task) -> tuple[AnyController, str] | None:
        """Return the controller of given gains and words on it; None where gains are to be tuned.

        Raises:
            ParameterError: Options that do not go together.
        """
        if self.gains is not None:
            return self._from_file(self.gains, task), f"gains of {self.gains}"
        if self.k1 is None and self.k2 is None:
            self._check_nothing_given()
            return None
        if self.k1 is None or self.k2 is None:
            given = "--k2 alone" if self.k1 is None else "--k1 alone"
            raise ParameterError(
                "--k1 and --k2", given, "given together, or neither, for tuned gains"
            )
        surface, scheme = self.surface or "fast-terminal", self.scheme or "matched"
        if task.tool.frame is not None:
            return self._at_tool(task, scheme), f"given gains, {scheme} scheme"
        made = ImpedanceController(
            task.arm,
            impedance=task.impedance(),
            surface=paper_surface(surface),
            reaching=SuperTwisting(numbers("--k1", self.k1), numbers("--k2", self.k2), scheme),
            dt=task.motion.dt,
            model=self.knowledge("full"),
            limits=task.target.torque_limits(task.arm),
        )
        return made, f"{surface} surface, {scheme} scheme"

    def remedies(self) -> list[str]:
        """Return what would help a run that failed with these gains."""
        given = "--gains" if self.gains is not None else "--k1 and --k2"
        is_given = self.gains is not None or self.k1 is not None
        return [f"leave out {given}: run then tunes gains for this task"] if is_given else []

    def _at_tool(self, task: Task, scheme: Scheme) -> CartesianController:
        """Build the law of a frame with gains of translation, rotation and null space."""
        if self.surface is not None:
            raise ParameterError("--surface", self.surface, "left out with --frame")
        if self.knowledge("full") != "full":
            raise ParameterError("--model", self.model, "full with --frame")
        k1, k2 = (
            np.broadcast_to(numbers(name, given or "", 1, 3), 3)
            for name, given in (("--k1", self.k1), ("--k2", self.k2))
        )
        at_tool = SuperTwisting(np.repeat(k1[:2], 3), np.repeat(k2[:2], 3), scheme)
        null = SuperTwisting(float(k1[2]), float(k2[2]), scheme)
        return CartesianController(
            task.arm,
            task.impedance(),
            reaching=at_tool,
            dt=task.motion.dt,
            posture=Posture(reaching=null),
            limits=task.target.torque_limits(task.arm),
        )

    def _from_file(self, file: Path, task: Task) -> AnyController:
        """Build the controller of a file; what the file was not made for is noted."""
        gains, target = load_gains(file), task.target
        limits = None
        others = list(gains.outside(task.arm, task.unknown.plant(task.arm)))
        if task.motion.dt not in {MotionOptions.dt, gains.dt}:
            others.append(f"--dt {task.motion.dt:g} s instead of {gains.dt:g}, which is used")
        if target.limits is not None:
            given = target.torque_limits(task.arm)
            limits = np.array(np.inf) if given is None else given
            made_for = np.inf if gains.limits is None else gains.limits.effort
            if (limits < made_for).any():
                others.append(f"--limits {target.limits}, lower than {np.min(made_for):g} N·m")
        if others:
            say(
                f"note: '{file}' was tuned for something else: {'; '.join(others)}; tune again for this"
            )
        controller: AnyController = gains.controller(task.arm, task.impedance(), limits=limits)
        return controller

    def _check_nothing_given(self) -> None:
        choices = {"surface": self.surface, "scheme": self.scheme, "model": self.knowledge("full")}
        for name, value in choices.items():
            if value not in {None, "full"}:
                wanted = (
                    "given with --k1 and --k2: tuned gains come with their own surface, scheme and "
                    "model"
                )
                raise ParameterError(f"--{name}", value, wanted)


def tuned(
    task: Task, *, quiet: bool, at_least: float = 0.0
) -> GainProposal | CartesianGainProposal:
    """Propose gains for a task, with a progress bar.

    Args:
        task: What they are for.
        quiet: No progress bar.
        at_least: Least length of the motion [s].
    """
    arm, motion = task.arm, task.motion
    lacking = say_whether_rotors_lack(arm, task.unknown.plant(arm).plant)
    with progress(f"tuning {arm.name}", quiet=quiet) as on_tick:
        options: dict[str, Any] = {"frame": task.tool.frame}
        proposal: GainProposal | CartesianGainProposal = propose_gains(
            arm,
            task.unknown.uncertainty(),
            task.trajectory(),
            motion.dt,
            **options,
            impedance=task.impedance(),
            q0=task.start(),
            limits=task.target.torque_limits(arm),
            accuracy=task.target.accuracy,
            duration=max(motion.duration, at_least),
            seed=task.unknown.seed,
            on_tick=on_tick,
            remedy_time=WITHOUT_ROTORS if lacking else REMEDY_TIME,
        )
    return proposal
