"""The whole benchmark, with C++ and other libraries: python -m benchmarks.speed --write docs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as ProgressBar

from rbimpedance._common.suggestions import suggest
from rbimpedance.cli.bench import describe
from rbimpedance.cli.terminal import print_json, print_table, stderr, stdout
from rbimpedance.cli.timing import Progress
from rbimpedance.exceptions import ParameterError, RBImpedanceError
from rbimpedance.pictures import figures as plotting

from . import goals, page, report
from .cases import load
from .comparison import compare
from .cost_tables import memory, start_up
from .figure import draw
from .loop_tables import batch, loop, paced
from .plan import FULL, MINUTE, QUICK, Setting
from .report import Report, Section
from .tick_tables import arms, laws, phases, scaling, tick

_MAIN = "panda"
_PAGE, _FIGURE = "benchmarks.md", "figures/benchmarks.png"
_PLANS = {"quick": QUICK, "minute": MINUTE, "full": FULL}


def _one(measure: Callable[[Setting], Section]) -> Callable[[Setting], tuple[Section, ...]]:
    return lambda setting: (measure(setting),)


SECTIONS: dict[str, Callable[[Setting], tuple[Section, ...]]] = {
    "tick": _one(tick),
    "phases": _one(phases),
    "laws": _one(laws),
    "arms": _one(arms),
    "paced": _one(paced),
    "loop": _one(loop),
    "batch": _one(batch),
    "scaling": _one(scaling),
    "start-up": _one(start_up),
    "memory": _one(memory),
    "peers": compare,
}
"""In the order of the report."""

OF_ANY_ARM = ("tick", "phases", "laws", "paced", "loop", "batch", "memory")
"""Measured by default on an arm that is not the panda."""


def main(
    robot: Annotated[
        str, typer.Argument(metavar="ROBOT", help="A robot, or chain-N; the panda without fingers.")
    ] = _MAIN,
    plan: Annotated[
        str, typer.Option("--plan", metavar="|".join(_PLANS), help="How much is measured.")
    ] = "full",
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
) -> None:
    """Measure ticks, loops, start-up and memory beside C++ and other libraries: a quarter of an hour."""
    if plan not in _PLANS:
        raise ParameterError("--plan", plan, f"one of {', '.join(_PLANS)}")
    before = None if compare_with is None else report.load(compare_with)
    found = measure(robot, _chosen(section, robot), plan, show=not as_json)
    if as_json:
        print_json(found.data())
    elif before is not None:
        print_table(page.change_table(list(report.changes(before, found))))
    if save is not None:
        found.save(save)
    if write is not None:
        plotting.save(draw(found), write / _FIGURE)
        page.write(found, write / _PAGE, _FIGURE)
        stdout.print(f"written: {write / _PAGE}", soft_wrap=True, markup=False)


def measure(robot: str, names: Sequence[str], plan: str, *, show: bool) -> Report:
    """Measure some of the sections.

    Args:
        robot: Name of the arm that everything is measured on.
        names: Short names of the sections.
        plan: How much is measured: "quick", "minute" or "full".
        show: Show a progress bar, and each table when it is there.
    """
    machine, arm = describe(), load(robot)
    sections: list[Section] = []
    for name in names:
        with _progress(name, show=show) as on_tick:
            new = SECTIONS[name](Setting(robot, arm, _PLANS[plan], on_tick))
        for section in new if show else ():
            print_table(page.section_table(section))
        sections += new
    reached = goals.section(Report(machine, tuple(sections)))
    if show:
        print_table(page.section_table(reached))
    return Report(machine, (reached, *sections))


@contextmanager
def _progress(title: str, *, show: bool) -> Iterator[Progress]:
    """A progress bar that moves only between measurements: one with a thread of its own would disturb them."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    hidden = not (show and stderr.is_terminal)
    with ProgressBar(
        *columns, console=stderr, transient=True, auto_refresh=False, disable=hidden
    ) as bar:
        task = bar.add_task(title, total=None)
        bar.refresh()

        def update(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total, refresh=True)

        yield update


def _chosen(wanted: list[str] | None, robot: str) -> list[str]:
    for name in wanted or ():
        if name not in SECTIONS:
            words = f"the name of a table{suggest(name, SECTIONS)}"
            raise ParameterError("--section", name, words)
    if wanted:
        return [name for name in SECTIONS if name in wanted]
    return list(SECTIONS if robot == _MAIN else OF_ANY_ARM)


if __name__ == "__main__":
    try:
        typer.run(main)
    except RBImpedanceError as error:
        stderr.print(f"error: {error}", soft_wrap=True, markup=False)
        sys.exit(2)
