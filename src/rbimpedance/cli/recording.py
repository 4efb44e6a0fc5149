"""Runs with a progress bar, whose data and figures are written, and what is said of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING

from .._common.files import remove_parts
from ..exceptions import DivergenceError
from ..simulation.closed_loop import OnTick
from ..simulation.result import SimulationResult
from .options import OutputOptions
from .terminal import progress, say, stdout

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FAILED = 1
"""Exit code of a run that was lost, and of gains that were refused."""

BAD_INPUT = 2
"""Exit code of what cannot be run as asked."""


def record(
    simulate: Callable[[OnTick], SimulationResult],
    name: str,
    title: str,
    output: OutputOptions,
) -> SimulationResult:
    """Run and write the data, those of a diverged run too.

    Args:
        simulate: What runs; gets the callback of the progress bar.
        name: Stem of the file.
        title: Of the progress bar.
        output: Where to.

    Raises:
        DivergenceError: The run diverged.
    """
    output.out.mkdir(parents=True, exist_ok=True)
    file = output.out / f"{name}.npz"
    remove_parts(file)
    try:
        with progress(title, quiet=output.silent) as on_tick:
            result = simulate(on_tick)
    except DivergenceError as error:
        error.result.save(file)
        say(f"the run until it diverged is in {file}")
        raise
    result.save(file)
    return result


def draw(
    result: SimulationResult | Mapping[str, SimulationResult],
    figures: dict[str, str],
    folder: Path,
    formats: Sequence[str] = ("png",),
) -> list[Path]:
    """Write figures of a run, or of several.

    Args:
        result: The run.
        figures: Names of functions of `pictures.figures` by the stem of their file.
        folder: Where to.
        formats: Endings of the files: "png" for a screen, "pdf" to print.
    """
    from ..pictures import figures as pictures  # noqa: PLC0415  (Matplotlib takes half a second)

    drawn: dict[str, Figure] = {
        stem: getattr(pictures, name)(result) for stem, name in figures.items()
    }
    return [
        pictures.save(figure, folder / f"{stem}.{ending}")
        for stem, figure in drawn.items()
        for ending in formats
    ]


def prepare(*places: Path | None) -> None:
    """Make the folders of files, before any work is done.

    Args:
        places: Folders, or files by a name with an ending.

    Raises:
        OSError: One cannot be made or written to.
    """
    for place in places:
        if place is not None:
            _check_writable(place.parent if place.suffix else place)


def _check_writable(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(folder)) from error


def say_failed(reasons: Sequence[str], remedies: Sequence[str] = ()) -> None:
    """Say in one line what is wrong, and in one more each what would help."""
    for line in (f"failed: {'; '.join(reasons)}", *(f"- {remedy}" for remedy in remedies)):
        say(line)


def say_written(files: Sequence[Path]) -> None:
    """Name the files that were written."""
    stdout.print("written: " + ", ".join(map(str, files)), soft_wrap=True, markup=False)
