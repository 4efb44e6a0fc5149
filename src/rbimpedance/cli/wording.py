"""The library's words in the terms of the command line: its messages name arguments, here they are options."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import TypeAlias

_Rule: TypeAlias = tuple[str, str | Callable[[re.Match[str]], str]]

_OPTIONS = {
    "package_dirs": "--package-dir",
    "xacro_args": "--xacro-arg",
    "tool_frame": "--tool-frame",
    "check_limits": "--center, --amplitude",
    "environment": "--wrench",
    "effort": "--limits",
    "rate": "--limits",
    "q0": "--start",
} | {
    name: "--" + name.replace("_", "-")
    for name in (
        *("joints", "lock", "armature", "gravity", "massless", "repair"),
        *("center", "amplitude", "period", "start", "dt", "duration", "substeps", "integrator"),
        *("payload", "payload_com", "payload_gyration", "inertia_scale", "viscous", "coulomb"),
        *("torque_constant", "position_noise", "velocity_noise", "delay", "seed"),
        *("mass", "damping", "stiffness", "limits", "k1", "k2", "surface", "scheme", "gains"),
        *("accuracy", "samples", "jobs", "port", "out", "html"),
    )
}
"""The option of an argument, where their names differ or the same."""


def _each(option: str) -> Callable[[re.Match[str]], str]:
    """An option repeated for each of the names in quotes."""

    def words(found: re.Match[str]) -> str:
        return " ".join(f"{option} {name}" for name in re.findall(r"[\"']([^\"']+)[\"']", found[0]))

    return words


def _option_of(found: re.Match[str]) -> str:
    return _OPTIONS.get(found["name"], found[0])


_RULES: Sequence[_Rule] = (
    (r"\block=\((?:[\"'][^\"']+[\"'],? ?)+\)", _each("--lock")),
    (r"\b(lock|joints)=\(\.\.\.\)", r"--\1 NAME"),
    (r'repair="[\w-]+" fixes this \(--repair on the command line\)', "--repair fixes this"),
    (r'repair="[\w-]+" \(--repair\)', "--repair"),
    (
        r"massless=True with the rotors' inertia as armature= \(--massless --armature\)",
        "--massless --armature A, with the rotors' inertia A",
    ),
    (r"xacro_args=\{[^}]*\} \((--xacro-arg [^)]*)\)", r"\1"),
    (r"\bjoint_stops=True gives it some\b", "leave out --no-stops"),
    (r"; check_limits=False allows it", "; choose another --center, --amplitude or --start"),
    (
        r"a known armature, if the arm is geared: ([\d.e+-]+) kg·m² for example",
        r"--armature \1 (kg m^2, for example), if the arm is geared: its description gives no rotor inertia",
    ),
    (r"armature=\[([^\]]*)\]", lambda found: "--armature " + found[1].replace(" ", "")),
    (r"a start on the motion, q0 = trajectory\(0\.0\)\.q", "a start on the motion, without --start"),
    (r" \(surface=None\)", ""),
    (
        r"a motion ([\d.]+) times slower, over ([\d.]+) s",
        r"a slower motion: --period \1 times as long, with --duration \2",
    ),
    (r"There was no time for more; remedy_time= gives some\.", "There was no time for more."),
    (r"the result so far is in the error's \.result\. ", ""),
    (r"\b(?P<name>duration|accuracy|dt) = (?P<value>[\d.e+-]+)(?: s\b| rad or m\b| rad\b| m\b)?(?= instead|$|:|,)",
     lambda found: f"{_OPTIONS[found['name']]} {found['value']}"),
    (
        r"\ba source is a path to a \.urdf or \.xacro file, .* or a RobotWrapper",
        "ROBOT is the path of a .urdf or .xacro file, a name that `rbimpedance robots` lists, or - for standard input",
    ),
    (r"np\.\w+\(([^()]*)\)", r"\1"),
    (r"\barray\((\[[^()]*\])\)", r"\1"),
    (r"\bshape \(nv,\) = \((\d+),\), got shape \((\d+),\)", r"\1 numbers, got \2"),
    (
        r"\b(?:SuperTwisting|Impedance|Limits|Uncertainty)\.(?P<name>\w+)(?= must)",
        _option_of,
    ),
    (r"(?<![\w-])(?P<name>\w+)(?= must be| puts joint)", _option_of),
    (r"\bcenter ± amplitude\b|(?<=center ± )--amplitude", "--amplitude"),
    (r"\bcenter ± (?=--amplitude)", "--center ± "),
    (r"(?<![\w-])(?P<name>[a-z_0-9]+)=(?:True|False|None)?(?![\w=\"])", _option_of),
)  # fmt: skip


def as_options(words: str) -> str:
    """Return a message of the library with options in place of arguments.

    Args:
        words: One message, of one or more lines.
    """
    for pattern, instead in _RULES:
        words = re.sub(pattern, instead, words, flags=re.MULTILINE)
    return words
