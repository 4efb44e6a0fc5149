"""The command line: `rbimpedance run`, `tune`, `inspect`, `view`, `robots`, `paper`, `study`, `connect` and `bench`.

Exit codes: 0 done, 1 failed (an arm was lost, a robot stopped, or no gains do), 2 bad input, 130 a study was stopped by
Ctrl-C.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from typing import Annotated

import typer

from .. import __version__
from .._common import first_sign
from ..exceptions import DivergenceError, RBImpedanceError, RobotError
from .bench import bench
from .connect import connect
from .inspect import inspect
from .paper import paper
from .recording import BAD_INPUT, FAILED
from .robots import robots
from .run import run
from .study import study
from .terminal import say
from .tune import tune
from .view import view

app = typer.Typer(
    help="Robust impedance control of any URDF arm.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

_EXAMPLES: dict[Callable[..., None], str] = {
    run: "run panda --lock panda_finger_joint1 --payload 2 --armature 0.1 --html out/run.html",
    tune: "tune ur5 --payload 2 --inertia-scale 1.1 --out out",
    inspect: "inspect ur5",
    view: "view panda --html panda.html",
    robots: "robots ur",
    paper: "paper --surface fast-terminal --scheme matched --out out",
    study: "study standard --jobs 2",
    connect: "connect sim two_link --payload 0.3 --duration 5",
    bench: "bench panda --compare before.json",
}
for _command, _example in _EXAMPLES.items():
    app.command(epilog=f"Example: rbimpedance {_example}")(_command)


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and leave.")
    ] = False,
) -> None:
    if version:
        print(f"rbimpedance {__version__}")
        raise typer.Exit


def main() -> None:
    """Run the command line; every expected failure becomes a message and an exit code."""
    first_sign.loaded()
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _say_warning
            app()
    except (DivergenceError, RobotError) as error:
        _leave(f"failed: {error}", FAILED)
    except RBImpedanceError as error:
        _leave(f"error: {error}", BAD_INPUT)
    except OSError as error:
        what = f"{error.strerror}: '{error.filename}'" if error.filename else str(error)
        _leave(f"error: {what}", BAD_INPUT)


def _say_warning(message: Warning | str, *_: object, **__: object) -> None:
    say(f"warning: {message}")


def _leave(words: str, code: int) -> None:
    say(words)
    sys.exit(code)
