"""Arguments and objects that `load_robot` must not take: wrong types and numbers, broken Pinocchio models."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from functools import partial

import numpy as np
import pinocchio as pin

import rbimpedance as rbi

from .case import ARM, Case, entry, given, of_model, of_text, setting

# --- arguments --------------------------------------------------------------------------------------------------


def arguments() -> Iterator[Case]:
    nan = float("nan")
    for name, options, outcome, word in (
        ("lock of nothing", {"lock": "elbow"}, "ModelError", "names 'elbow'"),
        ("lock of a number", {"lock": 5}, "ModelError", "takes names of joints, got 5"),
        ("lock of numbers", {"lock": [5]}, "ModelError", "names '5'"),
        ("lock of lists", {"lock": [["slide"]]}, "ModelError", "is no movable joint"),
        (
            "lock of everything",
            {"lock": ("shoulder", "slide")},
            "ModelError",
            "no movable joint remains",
        ),
        ("lock of an escape", {"lock": "\x1b[31m"}, "ModelError", r"\\x1b"),
        ("joints none", {"joints": []}, "ModelError", "no movable joint remains"),
        ("joints unknown", {"joints": ["slid"]}, "ModelError", "did you mean 'slide'"),
        ("joints a number", {"joints": 5}, "ModelError", "takes names of joints"),
        ("tool frame unknown", {"tool_frame": "tol"}, "ModelError", "did you mean 'tool'"),
        ("tool frame empty", {"tool_frame": ""}, "ModelError", "no frame ''"),
        ("tool frame a number", {"tool_frame": 5}, "ModelError", "takes the name of a frame"),
        ("tool frame a joint", {"tool_frame": "slide"}, "sound", ""),
        ("tool frame of an escape", {"tool_frame": "\x1b[2J"}, "ModelError", r"\\x1b"),
        ("gravity nan", {"gravity": (0, 0, nan)}, "NonFiniteError", "gravity"),
        ("gravity short", {"gravity": (0, 0)}, "DimensionError", "gravity"),
        ("gravity text", {"gravity": "down"}, "DimensionError", "gravity"),
        ("gravity 1e308", {"gravity": (0, 0, 1e308)}, "ModelError", "disagree|finite"),
        ("armature negative", {"armature": -0.1}, "ParameterError", "armature"),
        ("armature nan", {"armature": nan}, "ParameterError", "armature"),
        ("armature infinite", {"armature": [1.0, np.inf]}, "ParameterError", "armature"),
        ("armature short", {"armature": [1.0]}, "DimensionError", "armature"),
        ("armature complex", {"armature": 1j}, "ParameterError", "armature"),
        ("armature 1e308", {"armature": 1e308}, "ModelError", "has the inertia 1e.308"),
        ("armature uneven", {"armature": [1e11, -0.0]}, "sound", ""),
        (
            "position of a free joint",
            {"locked_configuration": {"slide": 0.1}},
            "ModelError",
            "not locked",
        ),
        (
            "position nan",
            {"lock": "slide", "locked_configuration": {"slide": nan}},
            "ModelError",
            "one finite",
        ),
        (
            "position 1e300",
            {"lock": "slide", "locked_configuration": {"slide": 1e300}},
            "ModelError",
            "one finite",
        ),
        (
            "position too large an int",
            {"lock": "slide", "locked_configuration": {"slide": 10**400}},
            "ModelError",
            "one finite",
        ),
        (
            "position text",
            {"lock": "slide", "locked_configuration": {"slide": "0.1"}},
            "ModelError",
            "one finite",
        ),
        (
            "position fraction",
            {"lock": ["slide"], "locked_configuration": {"slide": Fraction(1, 9)}},
            "sound",
            "",
        ),
        ("positions a number", {"locked_configuration": 5}, "ModelError", "positions by name"),
        ("package_dirs a number", {"package_dirs": 5}, "ModelError", "takes folders"),
        ("package_dirs with NUL", {"package_dirs": ["a\0b"]}, "sound", ""),
        ("repair unknown", {"repair": "axis"}, "ModelError", 'names .*"comma".*got .axis.'),
        ("repair a number", {"repair": 5}, "ModelError", "got 5"),
    ):
        yield of_text(f"argument {name}", ARM, outcome, word, **options)


class _Writer:
    """Something like a yourdfpy.URDF."""

    def __init__(self, answer: object) -> None:
        self._answer = answer

    def write_xml_string(self) -> object:
        if isinstance(self._answer, Exception):
            raise self._answer
        return self._answer


def objects() -> Iterator[Case]:
    kinds: dict[str, tuple[object, str]] = {
        "None": (None, "from a NoneType"),
        "number": (7, "from a int"),
        "bytes": (ARM.encode(), "from a bytes"),
        "list": ([ARM], "from a list"),
        "class": (rbi.ArmModel, "from a type"),
        "writer of bytes that are no text": (_Writer(b"\xff\xfe"), "cannot write this URDF"),
        "writer that fails": (_Writer(KeyError("x")), "cannot write this URDF"),
        "writer of a number": (_Writer(5), "well-formed"),
        "writer of nothing": (_Writer(b""), "well-formed"),
        "empty model": (pin.Model(), "no movable joint"),
        "wrapper of nothing": (pin.RobotWrapper(pin.Model()), "no movable joint"),
    }
    for name, (source, word) in kinds.items():
        yield Case(f"object {name}", given(source), "ModelError", word)
    good = pin.SE3.Identity()
    lost = pin.SE3(np.eye(3), np.full(3, np.nan))
    vectors = (
        "damping",
        "armature",
        "upperDryFrictionLimit",
        "lowerPositionLimit",
        "upperEffortLimit",
    )
    for name in vectors:
        yield of_model(
            f"model {name} nan",
            setting(name, np.full(2, np.nan)),
            "ModelError",
            name,
        )
        yield of_model(f"model {name} short", setting(name, np.zeros(1)), "ModelError", name)
    for name in vectors[:3]:
        yield of_model(
            f"model {name} negative",
            setting(name, np.full(2, -1.0)),
            "ModelError",
            "negative",
        )
    for name in (
        "inertias",
        "jointPlacements",
        "joints",
        "parents",
        "names",
        "supports",
        "subtrees",
        "children",
    ):
        yield of_model(
            f"model without {name}",
            partial(_without_entry, name),
            "ModelError",
            f"{name} has",
        )
    for name, spoil, word in (
        ("limits inverted", setting("lowerPositionLimit", np.full(2, 9.0)), "above"),
        ("gravity nan", lambda m: setattr(m.gravity, "linear", np.full(3, np.nan)), "gravity"),
        (
            "inertia nan",
            entry("inertias", 1, pin.Inertia(np.nan, np.zeros(3), np.eye(3))),
            "not finite",
        ),
        (
            "mass negative",
            entry("inertias", 1, pin.Inertia(-1.0, np.zeros(3), np.eye(3))),
            "negative mass",
        ),
        ("placement nan", entry("jointPlacements", 1, lost), "placement of 'shoulder'"),
        ("frame nan", lambda m: setattr(m.frames[3], "placement", lost), "placement"),
        (
            "rotation scaled",
            entry("jointPlacements", 1, pin.SE3(2 * np.eye(3), np.zeros(3))),
            "no rotation",
        ),
        ("parent later", entry("parents", 1, 2), "before its parent"),
        ("parent far", entry("parents", 2, 10**6), "before its parent"),
        ("frame far", lambda m: setattr(m.frames[3], "parentJoint", 10**6), "does not exist"),
        ("names twice", entry("names", 2, "shoulder"), "same name"),
        ("joint swapped", lambda m: m.joints.__setitem__(1, m.joints[2]), "tables"),
        ("joint unplaced", entry("joints", 1, pin.JointModelRX()), "tables"),
        ("subtree wrong", lambda m: m.subtrees.__setitem__(1, m.subtrees[2]), "subtrees"),
        ("support wrong", lambda m: m.supports.__setitem__(2, m.supports[0]), "supports"),
    ):
        yield of_model(f"model {name}", spoil, "ModelError", word)
    yield of_model(
        "model without inertia",
        lambda m: m.inertias.__setitem__(2, pin.Inertia.Zero()),
        "UnsupportedJointError",
        "have no mass",
    )
    yield of_model("model name with an escape", setting("name", "\x1b[31m"), "sound", "")
    yield of_model(
        "model extra joint",
        lambda m: m.addJoint(2, pin.JointModelFreeFlyer(), good, "free"),
        "UnsupportedJointError",
        "lock=.*free",
    )


def _without_entry(name: str, model: pin.Model) -> None:
    del getattr(model, name)[1:2]


GROUPS = (arguments, objects)
