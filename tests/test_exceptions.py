"""The errors: what they say, what they carry, and that both survive a trip between processes."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import rbimpedance as rbi

ERRORS: dict[str, tuple[rbi.RBImpedanceError, dict[str, object], str]] = {
    "ModelError": (rbi.ModelError("link 'a' has no mass"), {}, "link 'a' has no mass"),
    "UnsupportedJointError": (
        rbi.UnsupportedJointError(["base", "hip"], "floating; lock it"),
        {"joints": ("base", "hip"), "reason": "floating; lock it"},
        "unsupported joint 'base', 'hip': floating; lock it",
    ),
    "ParameterError": (
        rbi.ParameterError("k1", -2.0, "positive"),
        {"name": "k1", "value": -2.0, "admissible": "positive"},
        "k1 must be positive, got -2.0",
    ),
    "InputError": (rbi.InputError("no"), {}, "no"),
    "DimensionError": (
        rbi.DimensionError("q", "of shape (nq,) = (3,)", "shape (2,)"),
        {"name": "q", "expected": "of shape (nq,) = (3,)", "actual": "shape (2,)"},
        "q must be of shape (nq,) = (3,), got shape (2,)",
    ),
    "NonFiniteError": (
        rbi.NonFiniteError("tau_ext", [1, 4]),
        {"name": "tau_ext", "index": (1, 4)},
        "tau_ext must be finite; entry 1, 4 is NaN or infinite",
    ),
    "JointLimitError": (
        rbi.JointLimitError("q", "elbow", 3.5, (-3.0, 3.0)),
        {"name": "q", "joint": "elbow", "value": 3.5, "limits": (-3.0, 3.0)},
        "q puts joint 'elbow' at 3.5, outside its position limits [-3, 3] (rad or m); check_limits=False allows it",
    ),
    "LogError": (
        rbi.LogError("run.csv", "no column is the time", "name one"),
        {"source": "run.csv", "problem": "no column is the time", "remedy": "name one"},
        "'run.csv': no column is the time; name one",
    ),
    "DivergenceError": (
        rbi.DivergenceError(0.25, "elbow", "partial"),
        {"time": 0.25, "joint": "elbow", "result": "partial"},
        "the simulation diverged after t = 0.25 s at joint 'elbow'; "
        "the result so far is in the error's .result. Lower gains, a shorter period, "
        "a smaller payload or known armature are the usual remedies",
    ),
    "UnsafeError": (
        rbi.UnsafeError("fr3", ["it moves", "no limits"]),
        {"robot": "fr3", "reasons": ("it moves", "no limits")},
        "fr3 is not driven: it moves; no limits",
    ),
    "RobotError": (
        rbi.RobotError("fr3", "reflex", "record"),
        {"robot": "fr3", "reason": "reflex", "run": "record"},
        "fr3: reflex",
    ),
    "MissingExtraError": (
        rbi.MissingExtraError("the robot 'x'", "descriptions"),
        {"feature": "the robot 'x'", "extra": "descriptions"},
        "the robot 'x' needs an optional dependency; in the checkout: pip install -e \".[descriptions]\"",
    ),
}


@pytest.mark.parametrize(("error", "attributes", "message"), ERRORS.values(), ids=ERRORS)
@pytest.mark.parametrize(
    "passed_on",
    [lambda e: e, lambda e: pickle.loads(pickle.dumps(e)), copy.copy, copy.deepcopy],
    ids=["itself", "pickled", "copied", "deep copied"],
)
def test_error_keeps_message_and_attributes(
    passed_on: object, error: rbi.RBImpedanceError, attributes: dict[str, object], message: str
) -> None:
    assert callable(passed_on)
    other = passed_on(error)
    assert type(other) is type(error)
    assert str(other) == message
    assert {name: getattr(other, name) for name in attributes} == attributes


@pytest.mark.parametrize(
    ("error", "builtin"),
    [
        (rbi.ModelError, ValueError),
        (rbi.ParameterError, ValueError),
        (rbi.InputError, ValueError),
        (rbi.DimensionError, rbi.InputError),
        (rbi.NonFiniteError, rbi.InputError),
        (rbi.JointLimitError, rbi.InputError),
        (rbi.UnsupportedJointError, rbi.ModelError),
        (rbi.DivergenceError, ArithmeticError),
        (rbi.LogError, ValueError),
        (rbi.UnsafeError, ValueError),
        (rbi.RobotError, RuntimeError),
        (rbi.MissingExtraError, ImportError),
    ],
)
def test_error_is_caught_as_what_it_is_and_as_ours(
    error: type[Exception], builtin: type[Exception]
) -> None:
    assert issubclass(error, builtin)
    assert issubclass(error, rbi.RBImpedanceError)


def test_every_error_of_the_package_has_a_case_here() -> None:
    public = {
        name
        for name, value in vars(rbi).items()
        if isinstance(value, type) and issubclass(value, rbi.RBImpedanceError)
    }
    assert public - {"RBImpedanceError", "FaultError"} == set(
        ERRORS
    )  # FaultError: test_fault_guard.py


def test_array_in_an_error_survives_pickling() -> None:
    error = pickle.loads(pickle.dumps(rbi.ParameterError("k1", np.array([1.0, -1.0]), "positive")))
    np.testing.assert_array_equal(error.value, [1.0, -1.0])


def test_thousand_unsupported_joints_are_not_all_named() -> None:
    error = rbi.UnsupportedJointError([f"joint{i}" for i in range(1000)], "floating; lock them")
    assert str(error).endswith("'joint11' and 988 more: floating; lock them")
    assert len(error.joints) == 1000
