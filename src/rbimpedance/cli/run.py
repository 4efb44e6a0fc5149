"""The command `rbimpedance run`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from .._common.arrays import whole_number
from ..control.tool_view import AnyController
from ..exceptions import DivergenceError
from ..interaction import FrameWrench
from ..simulation.checkpoint import Checkpoint
from ..simulation.closed_loop import OnTick
from ..simulation.plants.integrators import Integrator
from ..simulation.result import SimulationResult
from ..simulation.run import number_of_ticks, simulate
from ..tuning import GainProposal
from ..tuning.gains_file import save_gains
from .law import TUNING_TIME, LawOptions, tuned
from .notes import say_grave_notes
from .option_groups import with_options
from .options import OutputOptions, numbers, option
from .recording import FAILED, draw, prepare, record, say_failed, say_written
from .run_tables import LEGEND, TOOL_LEGEND, result_figures, result_tables, tool_figures
from .task_options import MotionOptions, Task, TaskOptions, naming_joints
from .terminal import explain, print_json, print_table, tell
from .wording import as_options

_simulation = partial(option, "Simulation")

_NOTHING_UNKNOWN = "nothing is unknown: the simulated arm is the model (--payload, --coulomb and others change that)"

_FIGURES = {
    "errors": "tracking_errors",
    "impedance_error": "impedance_error",
    "torque": "torques",
}

_AT_TOOL = {"errors": "tool_errors", "path": "tool_path", "torque": "torques"}


@dataclass(frozen=True, kw_only=True)
class PlantOptions:
    """What acts on the arm, and how it is simulated."""

    wrench: Annotated[
        str | None,
        _simulation(
            "Force on the tool in world axes in N, and a moment in N m: ..,MX,MY,MZ.", "FX,FY,FZ"
        ),
    ] = None
    substeps: Annotated[int, _simulation("Physics steps per period.", "N")] = 4
    integrator: Annotated[Integrator, _simulation("semi-implicit or rk4.", "NAME")] = (
        "semi-implicit"
    )
    no_stops: Annotated[
        bool, _simulation("Leave out the stops at the joints' limits.", name="--no-stops")
    ] = False

    def check(self, motion: MotionOptions) -> None:
        """Say what cannot be run before gains are searched for.

        Raises:
            ParameterError: A wrench, a count of steps, or a duration that is no multiple of the period.
        """
        self.environment()
        whole_number("substeps", self.substeps, 1, "the period is a multiple of the physics step")
        number_of_ticks(motion.duration, motion.dt)

    def environment(self) -> FrameWrench | None:
        """Return the wrench at the tool, of a force or of a force and a moment; None without one."""
        if self.wrench is None:
            return None
        given = numbers("--wrench", self.wrench, 3, 6)
        return FrameWrench(np.concatenate([given, np.zeros(6 - len(given))]))


@dataclass(frozen=True, kw_only=True)
class RunOutputOptions(OutputOptions):
    """The same, and what only a run has."""

    html: Annotated[
        Path | None,
        typer.Option("--html", metavar="FILE", help="Write the animation as one HTML file."),
    ] = None
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue a run of this command that was killed.")
    ] = False


@with_options
def run(
    asked: TaskOptions,
    law: LawOptions,
    acting: PlantOptions,
    output: RunOutputOptions,
) -> None:
    """Simulate the controller on a robot that follows a cosine, or with --frame moves its tool.

    Gains are tuned unless given.

    The simulated arm has what is unknown, at the last number of each range.

    Exit code 1: the arm is lost or far from its motion, leaves its limits, needs more torque than it has for more than
    a moment, or its torque chatters.
    """
    task = asked.task()
    task.check()
    acting.check(task.motion)
    prepare(output.out / "result.npz", output.html)
    with naming_joints(task.arm):
        given = law.controller(task)
    say_grave_notes(task.arm)
    if task.unknown.is_nothing() and not output.silent:
        tell(_NOTHING_UNKNOWN)
    controller, words = given or _tuned(task, output)
    payload = task.unknown.plant(task.arm).payload
    title = f"{task.arm.name}, payload {payload:g} kg, {words}, dt = {controller.dt:g} s"
    remedies = law.remedies()
    checkpoint = Checkpoint(
        output.out / "result.checkpoint",
        f"{task.motion}, {acting}, {task.tool}",
        resume=output.resume,
    )
    try:
        result = record(
            lambda on_tick: _simulate(task, acting, controller, on_tick, checkpoint),
            "result",
            f"simulating {task.arm.name}",
            output,
        )
    except DivergenceError as error:
        checkpoint.remove()
        _end(output, title, [str(error)], remedies=remedies)
        raise typer.Exit(FAILED) from error
    checkpoint.remove()
    files = _drawn(result, acting, output)
    reasons = [finding.words for finding in result.verdict().findings]
    _end(output, title, reasons, result, files, remedies if reasons else ())


def _drawn(result: SimulationResult, acting: PlantOptions, output: RunOutputOptions) -> list[Path]:
    """Draw the figures and the animation, and return all files of the run."""
    figures = _FIGURES if result.tool is None else _AT_TOOL
    files = [*draw(result, figures, output.out), output.out / "result.npz"]
    if output.html is not None:
        files.append(result.save_html(output.html, environment=acting.environment()))
    return files


def _simulate(
    task: Task,
    acting: PlantOptions,
    controller: AnyController,
    on_tick: OnTick,
    checkpoint: Checkpoint,
) -> SimulationResult:
    """Run the controller against the arm that has what is unknown."""
    sample = task.unknown.plant(task.arm)
    return simulate(
        sample.wrap(controller),
        sample.plant,
        task.trajectory(),
        environment=acting.environment(),
        q0=task.start(),
        duration=task.motion.duration,
        substeps=acting.substeps,
        integrator=acting.integrator,
        joint_stops=not acting.no_stops,
        on_tick=on_tick,
        checkpoint=checkpoint,
    )


def _tuned(task: Task, output: OutputOptions) -> tuple[AnyController, str]:
    """Tune gains and say so; where there are none, say why and leave."""
    if not output.silent:
        tell(f"no gains given: tuning {task.arm.name}")
    proposal = tuned(task, quiet=output.silent, at_least=TUNING_TIME)
    if not proposal.feasible:
        remedies = proposal.remedies if isinstance(proposal, GainProposal) else ()
        _end(output, task.arm.name, [f"no gains: {proposal.reason}"], remedies=remedies)
    file = save_gains(proposal, output.out / "gains.json")
    if not output.silent:
        tell(proposal.explain())
    return proposal.controller(task.impedance()), f"tuned gains ({file})"


def _end(
    output: OutputOptions,
    title: str,
    reasons: Sequence[str],
    result: SimulationResult | None = None,
    files: Sequence[Path] = (),
    remedies: Sequence[str] = (),
) -> None:
    """Say what came out of a run: first what is wrong, then its figures and files; leave with 1 where it failed."""
    reasons, remedies = ([as_options(words) for words in given] for given in (reasons, remedies))
    if reasons:
        say_failed(reasons, remedies)
    if output.as_json:
        verdict = {"ok": not reasons, "failures": reasons, "remedies": remedies}
        said: dict[str, Any] = {"title": title, "verdict": verdict}
        if result is not None:
            said |= {"joints": result.joint_names, "metrics": result_figures(result)}
            said |= {} if result.tool is None else {"tool": tool_figures(result)}
        print_json(said)
    elif result is not None:
        if not output.quiet:
            for shown in result_tables(title, result):
                print_table(shown)
            explain(LEGEND if result.tool is None else TOOL_LEGEND)
            if not reasons:
                tell(f"ok: {result.verdict()}")
        say_written(files)
    if reasons:
        raise typer.Exit(FAILED)
