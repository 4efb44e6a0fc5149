"""Options that commands share, and what they mean in the library's terms."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer

from .._common.arrays import Array
from ..exceptions import ParameterError
from ..law.super_twisting import Scheme
from ..robot.arm_model import ArmModel
from ..robot.knowledge import Knowledge, as_knowledge
from ..robot.load import load_robot
from ..robot.loading.encoding import decoded
from ..robot.loading.strict_xml import MAX_CHARACTERS
from ..simulation.scenarios import SurfaceName
from .terminal import say


def option(panel: str, words: str, metavar: str | None = None, name: str | None = None) -> Any:
    """Return an option in a panel of the help, named after its field unless a name is given.

    Choices stand in its words, since a list of them breaks within words.
    """
    names = () if name is None else (name,)
    return typer.Option(*names, help=words, rich_help_panel=panel, metavar=metavar)


_robot = partial(option, "Robot")


Robot = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="Path of a URDF or xacro file, a name (see rbimpedance robots), or - for URDF text on "
        "standard input.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress bar and no table.")]
Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")]
Period = Annotated[float, typer.Option("--dt", metavar="S", help="Control period in s.")]
Duration = Annotated[float, typer.Option("--duration", metavar="S", help="Length of the run in s.")]
Surface = Annotated[
    SurfaceName,
    typer.Option("--surface", metavar="NAME", help="power, fast-terminal, nonsingular-terminal."),
]
SchemeName = Annotated[
    Scheme, typer.Option("--scheme", metavar="NAME", help="explicit, matched or implicit.")
]


@dataclass(frozen=True, kw_only=True)
class KnowledgeOptions:
    """What the controller knows of the arm."""

    model: Annotated[
        Literal["full", "inertia"] | None,
        typer.Option("--model", metavar="NAME", help="What the controller knows: full, inertia."),
    ] = None
    known: Annotated[
        Literal["full", "inertia", "mass"] | None, typer.Option("--known", hidden=True)
    ] = None

    def knowledge(self, default: Knowledge) -> Knowledge:
        """Return the word; the old option works and says what it is now."""
        if self.known is None:
            return self.model or default
        now = as_knowledge({"mass": "inertia"}.get(self.known, self.known))
        say(f"warning: --known {self.known} is deprecated; write --model {now}")
        return self.model or now


@dataclass(frozen=True, kw_only=True)
class DescriptionOptions:
    """How a robot's description is read."""

    joints: Annotated[
        list[str] | None, _robot("Control these alone, and freeze the others; repeatable.", "NAME")
    ] = None
    lock: Annotated[list[str] | None, _robot("Freeze a joint; repeatable.", "NAME")] = None
    tool_frame: Annotated[str | None, _robot("Default: the deepest leaf.", "NAME")] = None
    package_dir: Annotated[
        list[Path] | None, _robot("Where package:// resolves; repeatable.", "DIR")
    ] = None
    xacro_arg: Annotated[
        list[str] | None, _robot("Argument of a xacro file; repeatable.", "N:=V")
    ] = None
    repair: Annotated[
        bool,
        _robot("Repair defects of the description that have one obvious repair.", name="--repair"),
    ] = False

    def load_for_display(self, robot: str) -> ArmModel:
        """Load a robot of which only the picture counts, which needs no masses."""
        return self._load(robot, armature=1.0, massless=True)

    def _load(self, robot: str, **physics: Any) -> ArmModel:
        return load_robot(
            _standard_input() if robot == "-" else robot,
            joints=None if self.joints is None else _names(self.joints),
            lock=_names(self.lock or ()),
            tool_frame=self.tool_frame,
            package_dirs=tuple(self.package_dir or ()),
            xacro_args=_xacro_arguments(self.xacro_arg),
            repair=self.repair,
            **physics,
        )


@dataclass(frozen=True, kw_only=True)
class RobotOptions(DescriptionOptions):
    """The same, and what a description may leave out."""

    armature: Annotated[str | None, _robot("Reflected rotor inertia in kg m^2.", "A[,A..]")] = None
    gravity: Annotated[str | None, _robot("In world axes in m/s^2.", "X,Y,Z")] = None
    massless: Annotated[
        bool, _robot("Accept links without mass: no gravity is known there.", name="--massless")
    ] = False

    def load(self, robot: str) -> ArmModel:
        """Load the robot."""
        armature, gravity = self.armature, self.gravity
        return self._load(
            robot,
            armature=None if armature is None else numbers("--armature", armature),
            gravity=None if gravity is None else numbers("--gravity", gravity, 3),
            massless=self.massless,
        )


@dataclass(frozen=True, kw_only=True)
class OutputOptions:
    """Where results go."""

    out: Out = Path("out")
    as_json: Json = False
    quiet: Quiet = False

    @property
    def silent(self) -> bool:
        """Whether neither progress nor tables are shown."""
        return self.quiet or self.as_json


def numbers(option: str, text: str, *counts: int) -> Array:
    """Read "1" or "1,2,3"; a single number stays a scalar unless a count is given.

    Args:
        option: Its name, for the error.
        text: What was given.
        counts: How many numbers it may be; any by default.

    Raises:
        ParameterError: It is something else.
    """
    how_many = " or ".join(map(str, counts))
    wanted = (
        f"{how_many} numbers separated by commas"
        if counts
        else "a number or numbers separated by commas"
    )
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError as error:
        raise ParameterError(option, text, wanted) from error
    if np.isnan(values).any() or (counts and len(values) not in counts):
        raise ParameterError(option, text, wanted)
    return values if counts or len(values) > 1 else values[0]


def _names(given: list[str] | tuple[()]) -> tuple[str, ...]:
    """Names given one by one, or several in one with commas."""
    return tuple(name for text in given for name in text.split(","))


def _xacro_arguments(given: list[str] | None) -> dict[str, str]:
    """Read "name:=value" from each."""
    pairs = {}
    for text in given or ():
        name, separator, value = text.partition(":=")
        if not name or not separator:
            raise ParameterError("--xacro-arg", text, "NAME:=VALUE")
        pairs[name] = value
    return pairs


def _standard_input() -> str:
    """The text on standard input, bounded in size."""
    text, _ = decoded(sys.stdin.buffer.read(MAX_CHARACTERS + 1), "standard input", ())
    return text
