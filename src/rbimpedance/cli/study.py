"""The command `rbimpedance study`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .._common.files import whole_file
from ..study import Study, find_study, run_study, summarize
from .study_tables import LEGEND, tables
from .terminal import explain, print_json, print_table, progress, say, stdout

if TYPE_CHECKING:
    import pyarrow as pa

INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""

Scheduler = Annotated[str | None, typer.Option(metavar="ADDRESS", help="Run on this Dask cluster.")]
Names = Annotated[list[str] | None, typer.Option(metavar="NAME", help="Only these; repeatable.")]


def study(
    which: Annotated[
        str,
        typer.Argument(
            metavar="STUDY",
            help="standard, linear, or FILE.py:NAME or MODULE:NAME, whose code is then run.",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Its folder; default: its name.")
    ] = None,
    jobs: Annotated[int, typer.Option("--jobs", help="Processes on this machine.")] = 1,
    scheduler: Scheduler = None,
    samples: Annotated[
        int | None, typer.Option("--samples", metavar="N", help="Only the first N of each.")
    ] = None,
    robots: Names = None,
    controllers: Names = None,
    disturbances: Names = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar and no table.")] = False,
) -> None:
    """Run many controllers on many robots under many disturbances: one table, a summary, figures.

    The same command continues a study that was stopped.
    """
    chosen = find_study(which).part(
        robots=tuple(robots or ()),
        controllers=tuple(controllers or ()),
        disturbances=tuple(disturbances or ()),
        samples=samples,
    )
    folder = Path(chosen.name) if out is None else out
    rows = _rows(chosen, folder, jobs, scheduler, quiet=quiet or as_json)
    summary = summarize(rows)
    files = _written(chosen, folder, rows, summary)
    if as_json:
        print_json(summary)
        return
    if not quiet:
        for told in tables(summary):
            print_table(told)
        explain(LEGEND)
    stdout.print("written: " + ", ".join(map(str, files)), soft_wrap=True, markup=False)


def _rows(
    chosen: Study, folder: Path, jobs: int, scheduler: str | None, *, quiet: bool
) -> pa.Table:
    """The table; Ctrl-C exits with a message on how to continue."""
    try:
        with progress(chosen.name, quiet=quiet, every=1) as on_run:
            return run_study(chosen, folder, jobs=jobs, scheduler=scheduler, on_run=on_run)
    except KeyboardInterrupt:
        words = (
            f"stopped: what is done is kept in '{folder}'; the same command continues from there"
        )
        say(words)
        raise typer.Exit(INTERRUPTED) from None


def _written(chosen: Study, folder: Path, rows: pa.Table, summary: dict[str, Any]) -> list[Path]:
    """Write summary and figures beside the table; returns all files."""
    from ..pictures import figures as plotting  # noqa: PLC0415  (Matplotlib takes half a second)
    from ..pictures.figures.study import FIGURES  # noqa: PLC0415

    files = [folder / f"{chosen.name}.parquet", folder / "summary.json"]
    with whole_file(files[1]) as file:
        file.write((json.dumps(summary, indent=1, allow_nan=False) + "\n").encode())
    for name, draw in FIGURES.items():
        files.append(plotting.save(draw(rows), folder / f"{name}.png"))
    return files
