"""The command `rbimpedance bench`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as ProgressBar

from ..._common.suggestions import suggest
from ...exceptions import ParameterError
from ...pictures import figures as plotting
from ..terminal import print_json, print_table, stderr, stdout
from . import goals, page, report
from .cases import load
from .comparison import compare
from .figure import draw
from .machine import describe
from .plan import FULL, MINUTE, QUICK, Plan
from .report import Report, Section
from .sections import SECTIONS
from .setting import Setting
from .timing import Progress

PEERS = "peers"
_MAIN, _ANY_ARM = "panda", ("tick", "phases", "laws", "paced", "loop", "batch", "memory")
_PAGE, _FIGURE = "benchmarks.md", "figures/benchmarks.png"


def bench(
    robot: Annotated[
        str, typer.Argument(metavar="ROBOT", help="As for run; the panda is taken without fingers.")
    ] = _MAIN,
    quick: Annotated[bool, typer.Option("--quick", help="A glance: figures of no worth.")] = False,
    full: Annotated[
        bool, typer.Option("--full", help="Everything: 1e5 ticks of each kind, C++ and peers.")
    ] = False,
    section: Annotated[
        list[str] | None,
        typer.Option("--section", metavar="NAME", help="Only this table; repeatable."),
    ] = None,
    save: Annotated[
        Path | None, typer.Option("--save", metavar="FILE", help="Write the figures as JSON.")
    ] = None,
    compare_with: Annotated[
        Path | None, typer.Option("--compare", metavar="FILE", help="Compare with a saved run.")
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option("--write", metavar="DIR", help=f"Write {_PAGE} and its figure there."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar, no table.")] = False,
) -> None:
    """Measure what the control loop costs here: about a minute, ten with --full."""
    plan = QUICK if quick else FULL if full else MINUTE
    before = None if compare_with is None else report.load(compare_with)
    names = _chosen(section, robot, with_peers=full)
    found = measure(robot, names, plan, quiet=quiet or as_json)
    if as_json:
        print_json(found.data())
    elif not quiet:
        for measured in found.sections:
            print_table(page.section_table(measured))
    if before is not None and not as_json:
        print_table(page.change_table(list(report.changes(before, found))))
    if save is not None:
        found.save(save)
    if write is not None:
        plotting.save(draw(found), write / _FIGURE)
        page.write(found, write / _PAGE, _FIGURE)
        stdout.print(f"written: {write / _PAGE}", soft_wrap=True, markup=False)


def measure(robot: str, names: Sequence[str], plan: Plan, *, quiet: bool) -> Report:
    """Measure some of the sections.

    Args:
        robot: Name of the arm that everything is measured on.
        names: Short names of the sections.
        plan: How much is measured.
        quiet: No progress bars.
    """
    machine, arm = describe(), load(robot)
    sections: list[Section] = []
    for name in names:
        with _progress(name, quiet=quiet) as on_tick:
            setting = Setting(robot, arm, plan, on_tick)
            sections += compare(setting) if name == PEERS else [SECTIONS[name](setting)]
    found = Report(machine, tuple(sections))
    return Report(machine, (goals.section(found), *sections))


@contextmanager
def _progress(title: str, *, quiet: bool) -> Iterator[Progress]:
    """A progress bar that moves only when it is told to: one with a thread of its own would disturb the measurement."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    hidden = quiet or not stderr.is_terminal
    with ProgressBar(
        *columns, console=stderr, transient=True, auto_refresh=False, disable=hidden
    ) as bar:
        task = bar.add_task(title, total=None)
        bar.refresh()

        def update(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total, refresh=True)

        yield update


def _chosen(wanted: list[str] | None, robot: str, *, with_peers: bool) -> list[str]:
    known = [*SECTIONS, PEERS]
    for name in wanted or ():
        if name not in known:
            words = f"the name of a table{suggest(name, known)}"
            raise ParameterError("--section", name, words)
    if wanted:
        return [name for name in known if name in wanted]
    if robot != _MAIN:
        return list(_ANY_ARM)
    return known if with_peers else list(SECTIONS)
