"""The command `rbimpedance tune`."""

from __future__ import annotations

from pathlib import Path

import typer

from ..tuning import CartesianGainProposal, GainProposal
from ..tuning.gains_file import proposal_data, save_gains
from .law import tuned
from .notes import say_grave_notes
from .option_groups import with_options
from .options import OutputOptions
from .recording import FAILED, prepare, say_written
from .task_options import TaskOptions
from .terminal import explain, print_json, print_table, tell
from .tune_tables import (
    BLOCKS_LEGEND,
    LEGEND,
    WORST_AT_TOOL_LEGEND,
    WORST_LEGEND,
    blocks_table,
    case_names,
    gains_tables,
    step_error,
    torque_tables,
    worst_at_tool,
    worst_table,
)


@with_options
def tune(
    asked: TaskOptions,
    output: OutputOptions,
) -> None:
    """Propose gains for what is not known about a robot, or say why there are none (exit code 1)."""
    task = asked.task()
    say_grave_notes(task.arm)
    task.check()
    prepare(output.out)
    proposal = tuned(task, quiet=output.silent)
    files = _write(proposal, output.out)
    if output.as_json:
        print_json(proposal_data(proposal))
    else:
        if not output.quiet:
            _print_tables(proposal)
        tell(proposal.explain())
        say_written(files)
    if not proposal.feasible:
        raise typer.Exit(FAILED)


def _print_tables(proposal: GainProposal | CartesianGainProposal) -> None:
    if isinstance(proposal, CartesianGainProposal):
        print_table(blocks_table(proposal))
        explain(BLOCKS_LEGEND)
        if proposal.worst:
            print_table(worst_at_tool(proposal))
            explain(WORST_AT_TOOL_LEGEND)
        return
    for shown in gains_tables(proposal):
        print_table(shown)
    explain(LEGEND)
    for shown in torque_tables(proposal):
        print_table(shown)
    if proposal.worst:
        print_table(worst_table(proposal))
        explain(WORST_LEGEND.format(step=step_error(proposal)))


def _write(proposal: GainProposal | CartesianGainProposal, out: Path) -> list[Path]:
    """Write gains.json, and the errors of the worst samples where any was simulated."""
    from ..pictures import figures  # noqa: PLC0415  (Matplotlib takes half a second)

    files = [save_gains(proposal, out / "gains.json")]
    if isinstance(proposal, GainProposal) and proposal.worst:
        cases = zip(case_names(proposal), proposal.worst, strict=True)
        runs = {name: (case.result.t, case.true_error) for name, case in cases}
        files.append(figures.save(figures.error_sizes(runs), out / "worst_samples.png"))
    return files
