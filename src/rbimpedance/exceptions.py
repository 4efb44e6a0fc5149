"""Every error that the library raises on purpose; all descend from `RBImpedanceError`.

Messages are built in ``__str__`` from the fields of the error, so that errors survive pickling (worker processes)
with their attributes.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

_MOST_NAMES = 12


class RBImpedanceError(Exception):
    """Base of all errors of this library."""

    def __post_init__(self) -> None:
        """Let the error be pickled with its fields, however they were given."""
        self.args = tuple(vars(self).values())


class ModelError(RBImpedanceError, ValueError):
    """A robot description cannot become a sound model; the message says which element and what would be right."""


@dataclass(eq=False, repr=False)
class UnsupportedJointError(ModelError):
    """Joints of a kind that the controller cannot drive (floating, planar, spherical, ...).

    Attributes:
        joints: Names of the joints.
        reason: What is wrong with them and the remedy.
    """

    joints: Sequence[str]
    reason: str

    def __post_init__(self) -> None:
        """Keep a tuple, whatever sequence is given."""
        self.joints = tuple(self.joints)
        super().__post_init__()

    def __str__(self) -> str:
        names = ", ".join(f"'{name}'" for name in self.joints[:_MOST_NAMES])
        if len(self.joints) > _MOST_NAMES:
            names += f" and {len(self.joints) - _MOST_NAMES} more"
        return f"unsupported joint {names}: {self.reason}"


@dataclass(eq=False, repr=False)
class ParameterError(RBImpedanceError, ValueError):
    """A gain or setting lies outside its admissible set.

    Attributes:
        name: Name of the parameter.
        value: What was given.
        admissible: What would be right, in words.
    """

    name: str
    value: object
    admissible: str

    def __str__(self) -> str:
        value = self.value.tolist() if hasattr(self.value, "tolist") else self.value
        return f"{self.name} must be {self.admissible}, got {value!r}"


class InputError(RBImpedanceError, ValueError):
    """A value handed over at run time (configuration, velocity, wrench, ...) cannot be used."""


@dataclass(eq=False, repr=False)
class DimensionError(InputError):
    """An array has the wrong shape or kind.

    Attributes:
        name: Name of the argument.
        expected: What would be right, in words.
        actual: What was given, in words.
    """

    name: str
    expected: str
    actual: str

    def __str__(self) -> str:
        return f"{self.name} must be {self.expected}, got {self.actual}"


@dataclass(eq=False, repr=False)
class NonFiniteError(InputError):
    """An array holds NaN or infinity.

    Attributes:
        name: Name of the argument.
        index: Indices of the offending entries.
    """

    name: str
    index: Sequence[int]

    def __post_init__(self) -> None:
        """Keep a tuple, whatever sequence is given."""
        self.index = tuple(self.index)
        super().__post_init__()

    def __str__(self) -> str:
        where = ", ".join(str(i) for i in self.index)
        return f"{self.name} must be finite; entry {where} is NaN or infinite"


@dataclass(eq=False, repr=False)
class JointLimitError(InputError):
    """A desired position lies outside the limits of a joint.

    Attributes:
        name: What was given.
        joint: Name of the joint.
        value: Its position [rad or m].
        limits: Its lower and upper position limit [rad or m].
    """

    name: str
    joint: str
    value: float
    limits: tuple[float, float]

    def __str__(self) -> str:
        lower, upper = self.limits
        return (
            f"{self.name} puts joint '{self.joint}' at {self.value:.6g}, outside its position limits "
            f"[{lower:.6g}, {upper:.6g}] (rad or m); check_limits=False allows it"
        )


@dataclass(eq=False, repr=False)
class LogError(RBImpedanceError, ValueError):
    """A log cannot be read, or what it holds does not fit together.

    Attributes:
        source: The file or what else it is from.
        problem: What is wrong, and where.
        remedy: What would be right.
    """

    source: str
    problem: str
    remedy: str

    def __str__(self) -> str:
        return f"'{self.source}': {self.problem}; {self.remedy}"


@dataclass(eq=False, repr=False)
class UnsafeError(RBImpedanceError, ValueError):
    """A robot is not driven, since something about the controller, the start or the model is not safe.

    Attributes:
        robot: Name of the robot.
        reasons: What is wrong and what would be right, one sentence each.
    """

    robot: str
    reasons: Sequence[str]

    def __post_init__(self) -> None:
        """Keep a tuple, whatever sequence is given."""
        self.reasons = tuple(self.reasons)
        super().__post_init__()

    def __str__(self) -> str:
        return f"{self.robot} is not driven: {'; '.join(self.reasons)}"


@dataclass(eq=False, repr=False)
class RobotError(RBImpedanceError, RuntimeError):
    """A robot refuses, or has stopped by itself.

    Attributes:
        robot: Name of the robot.
        reason: What it reports.
        run: The `RobotRun` up to then; None before a run.
    """

    robot: str
    reason: str
    run: Any = None

    def __str__(self) -> str:
        return f"{self.robot}: {self.reason}"


class VelocityLimitWarning(UserWarning):
    """A desired motion is faster than a joint's velocity limit."""


@dataclass(eq=False, repr=False)
class DivergenceError(RBImpedanceError, ArithmeticError):
    """A simulation left every sensible range.

    Attributes:
        time: Time of the last sound sample [s].
        joint: Name of the joint that left first.
        result: The `SimulationResult` up to that time.
    """

    time: float
    joint: str
    result: Any

    def __str__(self) -> str:
        return (
            f"the simulation diverged after t = {self.time:.6g} s at joint '{self.joint}'; "
            "the result so far is in the error's .result. Lower gains, a shorter period, a smaller payload or known "
            "armature are the usual remedies"
        )


@dataclass(eq=False, repr=False)
class MissingExtraError(RBImpedanceError, ImportError):
    """An optional dependency is not installed.

    Attributes:
        feature: The requested feature.
        extra: Name of the optional extra that brings it.
    """

    feature: str
    extra: str

    def __str__(self) -> str:
        return (
            f"{self.feature} needs an optional dependency; in the checkout: "
            f'pip install -e ".[{self.extra}]"'
        )


def __getattr__(name: str) -> object:
    """Answer the old name of an error, for one release."""
    if name == "GainError":
        warnings.warn("GainError is now ParameterError", DeprecationWarning, stacklevel=2)
        return ParameterError
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
