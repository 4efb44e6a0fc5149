"""The command `rbimpedance view`."""

from __future__ import annotations

import warnings
from contextlib import suppress
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated

import typer

from ..simulation.result import SimulationResult
from .option_groups import with_options
from .options import DescriptionOptions, Json, Quiet
from .recording import prepare, say_written
from .terminal import print_json, progress, say, stdout

if TYPE_CHECKING:
    from ..pictures.viewer import Viewer


@with_options
def view(
    shown: Annotated[
        str,
        typer.Argument(metavar="ROBOT|RESULT", help="A robot as for run, or a result (.npz)."),
    ],
    reading: DescriptionOptions,
    html: Annotated[
        Path | None,
        typer.Option("--html", metavar="FILE", help="Write the page as one HTML file instead."),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", hidden=True)] = None,
    open_browser: Annotated[
        bool, typer.Option("--open", help="Open the system's browser.")
    ] = False,
    port: Annotated[
        int, typer.Option("--port", metavar="N", help="Port on 127.0.0.1; 0: any free one.")
    ] = 0,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Show a robot, or the animation of a result, in a browser: served on this machine, or as one file."""
    if out is not None:
        say(f"warning: --out {out} is deprecated; write --html {out}")
        html = html or out
    prepare(html)
    from ..pictures import viewer as pictures  # noqa: PLC0415  (takes a second)

    with progress(f"drawing {shown}", quiet=quiet or as_json):
        viewer = (
            pictures.animate(SimulationResult.load(shown), port=port)
            if shown.endswith(".npz")
            else pictures.view(reading.load_for_display(shown), port=port)
        )
    for note in viewer.notes if not as_json else ():
        say(f"note: {note}")
    if html is None:
        _serve(viewer, as_json=as_json, open_browser=open_browser)
    else:
        _write(viewer, html, as_json=as_json)


def _write(viewer: Viewer, html: Path, *, as_json: bool) -> None:
    file = viewer.save_html(html)
    if as_json:
        print_json({"file": str(file), "notes": viewer.notes})
    else:
        say_written([file])


def _serve(viewer: Viewer, *, as_json: bool, open_browser: bool) -> None:
    """Serve the page until Ctrl-C."""
    with viewer:
        if as_json:
            print_json({"url": viewer.url, "notes": viewer.notes})
        else:
            stdout.print(f"{viewer.url} shows it, until Ctrl-C", soft_wrap=True, markup=False)
        if open_browser:
            _open(viewer)
        with suppress(KeyboardInterrupt):
            Event().wait()


def _open(viewer: Viewer) -> None:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        viewer.open()
    for warning in said:
        say(f"note: {warning.message}")
