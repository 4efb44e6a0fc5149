"""`load_robot`: any robot description becomes an `ArmModel`, with every check on the way in."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from numbers import Real
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .._common.arrays import Array, gain, per_joint, vector
from ..exceptions import ModelError, UnsupportedJointError
from .arm_model import ArmModel
from .description import Description
from .loading.joint_selection import joints_to_lock, locked_positions
from .loading.model_building import build_model, checked_copy
from .loading.repair import repair_names
from .loading.robot_sources import read_source
from .loading.robot_text import RobotText, folders_of
from .loading.soundness import check_inertia, check_mass, massless_joints
from .loading.srdf import ready_positions
from .loading.urdf_appearance import mesh_notes
from .loading.urdf_document import listed
from .loading.urdf_reader import FARTHEST_LIMIT, parse_urdf
from .loading.wording import printable
from .postures import set_ready

MAX_DOF = 200
"""Most degrees of freedom of a loaded robot: Pinocchio's data grow with their third power (0.5 GB at 200)."""

_FLOATING_BASE = "root_joint"


def load_robot(
    source: object,
    *,
    joints: Iterable[str] | None = None,
    lock: Iterable[str] = (),
    locked_configuration: Mapping[str, float] | None = None,
    tool_frame: str | None = None,
    gravity: ArrayLike | None = None,
    armature: ArrayLike | None = None,
    massless: bool = False,
    package_dirs: str | Path | Sequence[str | Path] = (),
    xacro_args: Mapping[str, object] | None = None,
    repair: bool | str | Iterable[str] = False,
) -> ArmModel:
    """Load a robot and check it on the way in.

    Args:
        source: Path to a .urdf or .xacro file; XML text; the name of a robot that is bundled ("two_link"), comes with
            example-robot-data ("panda") or with robot_descriptions ("iiwa7_description"), looked up in this order; a
            `yourdfpy.URDF`; a `pinocchio.Model` or `RobotWrapper`.
        joints: Names of the joints to keep; all others are locked, a floating base too. Joints that mimic a kept one
            are kept with it.
        lock: Names of joints to freeze. "root_joint" welds a floating base to the world.
        locked_configuration: Positions of locked joints by name [rad or m]. The others are locked in Pinocchio's
            neutral configuration, moved into the position limits; mimicking joints where what they follow puts them.
        tool_frame: Frame that Jacobians and wrenches refer to by default. Without it, the link at the end of the
            longest chain of joints (fixed ones count) that can move; of several, the one with more movable joints on
            its chain, then the first of the document.
        gravity: Acceleration of free fall in world axes, shape (3,) [m/s²]. Without it, what the document asks for in
            `<rbimpedance><gravity xyz="0 0 -9.8"/></rbimpedance>`, else (0, 0, -9.81).
        armature: Reflected inertia of the rotors on the diagonal of M, scalar or (nv,) [kg·m² or kg]; replaces what a
            `pinocchio.Model` carries.
        massless: True accepts joints that move links without mass. Their gravity torque is 0 in the model, so that the
            controller does not hold the real links; `notes` name the joints. They need `armature`.
        package_dirs: Folders that hold ROS packages: for `package://` addresses of meshes, and for $(find package) in
            xacro files. The file's own package and its neighbours, AMENT_PREFIX_PATH and ROS_PACKAGE_PATH follow.
        xacro_args: Arguments of a xacro file by name, as in `xacro file.xacro name:=value`. A module of
            robot_descriptions brings its own, which these replace.
        repair: True mends defects of a document that have one obvious mend; names of `loading.repair.REPAIRS` mend
            those only. What was mended stands in `notes`.

    Returns:
        The arm; its `notes` say what was found on the way: limits that are not given, meshes that are not there, ...

    Raises:
        ModelError: No such source, or its description is not sound; says which element and what would be right.
        UnsupportedJointError: Joints that cannot be controlled, by name, with the way out.
        MissingExtraError: A robot_descriptions name without that package.
        ParameterError: `armature` is negative or not finite.
        DimensionError: `gravity` or `armature` has a wrong shape.
        NonFiniteError: `gravity` holds NaN or infinity.
    """
    values, repairs = _positions(locked_configuration), repair_names(repair)
    if isinstance(source, pin.RobotWrapper):
        source = source.model
    if isinstance(source, pin.Model):
        origin = "the pinocchio.Model"
        with error_context(origin):
            robot = _from_model(source, joints, lock, values)
    else:
        with error_context(""):
            text = read_source(source, package_dirs, repairs, xacro_args)
        origin = text.origin
        with error_context(origin):
            robot = _from_text(text, joints, lock, values, repairs)
            robot = replace(robot, description=_with_recipe(robot, source, package_dirs, repairs))
    with error_context(origin):
        return _arm(robot, tool_frame, gravity, armature, massless=massless)


def _arm(
    robot: _Robot,
    tool_frame: str | None,
    gravity: ArrayLike | None,
    armature: ArrayLike | None,
    *,
    massless: bool,
) -> ArmModel:
    """Freeze what is locked, set what was asked for, and check the dynamics."""
    model = _reduced(robot)
    if not massless:
        check_mass(model)
    if gravity is not None:
        model.gravity.linear = vector("gravity", gravity, 3, "x, y, z")
    tool = _default_tool_frame(model, robot.link_order) if tool_frame is None else tool_frame
    if not isinstance(tool, str):
        raise ModelError(f"tool_frame= takes the name of a frame, got {tool!r}")
    notes = (
        *_mass_notes(model),
        *robot.notes,
        *_follower_notes(robot),
        *_limit_notes(model),
        *_rotor_notes(model, robot.rotors),
    )
    if armature is not None:
        given = gain("armature", armature, "non-negative", lambda x: x >= 0.0)
        model.armature = np.array(per_joint("armature", given, model.nv))
    if robot.posture:
        set_ready(model, robot.posture)
    arm = ArmModel(
        model,
        name=printable(robot.name),
        tool_frame=tool,
        notes=tuple(printable(note) for note in notes),
        description=_accepted(robot.description, model) if massless else robot.description,
    )
    check_inertia(arm)
    return arm


@contextmanager
def error_context(origin: str) -> Iterator[None]:
    """Let every error of the model name its origin, and hold nothing that a terminal would not print."""
    try:
        yield
    except UnsupportedJointError as error:
        reason = error.reason if origin in error.reason else f"in {origin}: {error.reason}"
        raise UnsupportedJointError(
            [printable(joint) for joint in error.joints], printable(reason)
        ) from error.__cause__
    except ModelError as error:
        message = str(error) if origin in str(error) else f"{origin}: {error}"
        raise ModelError(printable(message)) from error.__cause__
    except MemoryError as error:
        raise ModelError(f"{origin or 'the source'}: there is not enough memory for it") from error


def _positions(given: Mapping[str, float] | None) -> dict[str, float]:
    """Check `locked_configuration=`."""
    try:
        values = dict(given or {})
    except (TypeError, ValueError) as error:
        raise ModelError(f"locked_configuration= takes positions by name, got {given!r}") from error
    for name, value in values.items():
        try:
            number = float(value) if isinstance(value, Real) else math.nan
        except OverflowError:
            number = math.inf
        if not isinstance(name, str) or not abs(number) <= FARTHEST_LIMIT:
            raise ModelError(
                f"locked_configuration: '{name}' takes one finite number of at most {FARTHEST_LIMIT:g}, got {value!r}"
            )
        values[name] = number
    return values


@dataclass(frozen=True)
class _Robot:
    """A full model and what is to be done with it."""

    model: pin.Model
    name: str
    locked: frozenset[str]
    values: Mapping[str, float]
    link_order: tuple[str, ...] = ()
    rotors: Path | None = None
    posture: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    description: Description | None = None
    is_named: bool = False
    floats: bool = False
    follows: Mapping[str, str] = field(default_factory=dict)


RECIPE = frozenset(
    {
        *("source", "lock", "locked_configuration", "package_dirs", "repair", "tool_frame"),
        *("massless", "armature"),
    }
)
"""What a result's recipe for its robot may hold: arguments of `load_robot`."""


def _with_recipe(
    robot: _Robot,
    source: object,
    package_dirs: str | Path | Sequence[str | Path],
    repairs: tuple[str, ...],
) -> Description | None:
    """The description with the way to load it again, where the source has a name or a path."""
    description = robot.description
    if description is None or description.folder is None:
        return description
    recipe = {
        "source": str(source) if robot.is_named else str(Path(str(source)).absolute()),
        "lock": sorted(robot.locked) + ([_FLOATING_BASE] if robot.floats else []),
        "locked_configuration": {name: float(value) for name, value in robot.values.items()},
        "package_dirs": [str(folder.absolute()) for folder in folders_of(package_dirs)],
    }
    if repairs:
        recipe["repair"] = list(repairs)
    return replace(description, recipe=recipe)


def _accepted(description: Description | None, model: pin.Model) -> Description | None:
    """The description whose recipe accepts links without mass."""
    if description is None or description.recipe is None:
        return description
    recipe = {**description.recipe, "massless": True, "armature": model.armature.tolist()}
    return replace(description, recipe=recipe)


def _from_model(
    source: pin.Model,
    joints: Iterable[str] | None,
    lock: Iterable[str],
    values: Mapping[str, float],
) -> _Robot:
    model = checked_copy(source)
    names = list(model.names)
    pairs = zip(model.mimicking_joints, model.mimicked_joints, strict=True)
    primaries = {names[mimicking]: names[primary] for mimicking, primary in pairs}
    locked = joints_to_lock(names[1:], primaries, (), joints, lock)
    if following := sorted(values.keys() & primaries.keys()):
        name = following[0]
        raise ModelError(
            f"locked_configuration: '{name}' follows '{primaries[name]}'; give that one's position"
        )
    return _Robot(model, model.name or "robot", locked, values, follows=primaries)


def _from_text(
    text: RobotText,
    joints: Iterable[str] | None,
    lock: Iterable[str],
    values: Mapping[str, float],
    repairs: tuple[str, ...],
) -> _Robot:
    document = parse_urdf(text.text, text.origin, repairs)
    base = (_FLOATING_BASE,) if text.floating else ()
    follows = {name: mimic.joint for name, mimic in document.mimics().items()}
    movable = (*base, *document.movable())
    locked = joints_to_lock(movable, follows, document.fixed(), joints, lock)
    if not locked.issuperset(base):
        raise UnsupportedJointError(
            base,
            f'the base of {text.origin} floats; weld it to the world with lock=("{_FLOATING_BASE}",)',
        )
    locked -= set(base)
    model = build_model(document.without_mimics(locked), text.origin)
    if document.gravity is not None:
        model.gravity.linear = np.array(document.gravity)
    posture, unread = _posture(text)
    return _Robot(
        model=model,
        name=text.name or document.name,
        locked=locked,
        values=locked_positions(document, locked, values),
        link_order=tuple(link.name for link in document.links),
        rotors=text.srdf if text.has_rotors else None,
        posture=posture,
        notes=(*text.notes, *document.notes(), *unread, *mesh_notes(document.mesh_files, text)),
        description=Description(document.xml, text.folder, text.package_dirs),
        is_named=text.name is not None,
        floats=text.floating,
        follows=follows,
    )


def _posture(text: RobotText) -> tuple[dict[str, float], tuple[str, ...]]:
    """The posture that the description's SRDF file offers, and a note where that cannot be read."""
    if text.srdf is None:
        return {}, ()
    try:
        return ready_positions(text.srdf, text.posture), ()
    except ModelError as error:
        return {}, (f"{error}: arm.ready is the middle of the limits",)


# --- what is locked, is frozen ----------------------------------------------------------------------------------


def _reduced(robot: _Robot) -> pin.Model:
    """Freeze the locked joints and refuse what cannot be controlled."""
    model = robot.model
    q = np.clip(pin.neutral(model), model.lowerPositionLimit, model.upperPositionLimit)
    for name, value in robot.values.items():
        if name not in robot.locked:
            raise ModelError(
                f"locked_configuration gives a position for '{name}', which is not locked"
            )
        joint = model.joints[model.getJointId(name)]
        if joint.nv != 1:
            raise ModelError(f"locked_configuration: '{name}' has {joint.nv} degrees of freedom")
        place = slice(joint.idx_q, joint.idx_q + joint.nq)
        q[place] = value if joint.nq == 1 else (np.cos(value), np.sin(value))
    if robot.locked:
        model = _frozen(model, [model.getJointId(name) for name in robot.locked], q)
    names = zip(model.names[1:], model.joints[1:], strict=True)
    if wide := [name for name, joint in names if not _is_controllable(joint)]:
        raise UnsupportedJointError(
            wide, f"only revolute, continuous and prismatic joints are controlled; {_way_out(wide)}"
        )
    if model.nv > MAX_DOF:
        raise ModelError(
            f"{model.nv} degrees of freedom; at most {MAX_DOF} are carried: lock some with lock=(...)"
        )
    return model


def _frozen(full: pin.Model, locked: list[int], q: Array) -> pin.Model:
    """`pin.buildReducedModel` (4.1), which takes no two frames of one name, such as a link's and a joint's."""
    shared = {name for name, count in Counter(f.name for f in full.frames).items() if count > 1}
    distinct, names = pin.Model(full), {}
    for i, frame in enumerate(full.frames):
        if frame.name in shared and frame.type != pin.FrameType.JOINT:
            distinct.frames[i].name = f"{i}\N{NULL}{frame.name}"
            names[distinct.frames[i].name] = frame.name
    model = pin.buildReducedModel(distinct, locked, q)
    _mend_parent_frames(model, distinct)
    for frame in model.frames:
        frame.name = names.get(frame.name, frame.name)
    return model


def _mend_parent_frames(model: pin.Model, full: pin.Model) -> None:
    """Undo that `pin.buildReducedModel` (4.1) makes the frame of each locked joint its own parent."""
    for i, frame in enumerate(model.frames):
        if i > 0 and frame.parentFrame == i and full.frames[i].name == frame.name:
            model.frames[i].parentFrame = full.frames[i].parentFrame


def _is_controllable(joint: pin.JointModel) -> bool:
    kind = joint.shortname()
    return kind == "JointModelMimic" or (
        joint.nv == 1 and not kind.startswith(("JointModelH", "JointModelC"))
    )


def _way_out(names: Sequence[str]) -> str:
    quoted = ", ".join(f'"{name}"' for name in names)
    return f"freeze with lock=({quoted},)"


# --- what the model is like -------------------------------------------------------------------------------------


def _default_tool_frame(model: pin.Model, link_order: Sequence[str]) -> str:
    """The moving leaf link at the end of the longest chain of joints; ties as `load_robot` documents."""
    frames = list(model.frames)
    bodies = [i for i, frame in enumerate(frames) if frame.type == pin.FrameType.BODY]
    chains = {i: _chain(frames, i) for i in bodies}
    inner = {i for chain in chains.values() for i in chain[1:]}
    leaves = [i for i in bodies if i not in inner and frames[i].parentJoint > 0]
    if not leaves:
        return str(model.names[model.njoints - 1])
    place = {name: k for k, name in enumerate(link_order)}

    def rank(leaf: int) -> tuple[int, int, int]:
        kinds = [frames[i].type for i in chains[leaf]]
        movable = kinds.count(pin.FrameType.JOINT)
        length = movable + kinds.count(pin.FrameType.FIXED_JOINT)
        return length, movable, -place.get(frames[leaf].name, leaf)

    return str(frames[max(leaves, key=rank)].name)


def _chain(frames: Sequence[pin.Frame], i: int) -> list[int]:
    """Indices of a frame and all frames above it, without the universe."""
    chain = []
    while i > 0:
        chain.append(i)
        parent = frames[i].parentFrame
        i = parent if parent < i else 0
    return chain


def _mass_notes(model: pin.Model) -> tuple[str, ...]:
    """Say which joints move no mass."""
    names = massless_joints(model)
    if not names:
        return ()
    return (
        f"NO GRAVITY: the links that {listed(names)} move have no mass in this model; the torque that carries them is "
        "taken as 0, and the real links will fall",
    )


def _follower_notes(robot: _Robot) -> tuple[str, ...]:
    """Say which joints are frozen although what they follow moves."""
    frozen = [name for name, leader in robot.follows.items() if leader not in robot.locked]
    if not (frozen := sorted(robot.locked.intersection(frozen))):
        return ()
    return (
        f"frozen by lock=, although what they follow moves: {listed(frozen)}; in the real robot they move too",
    )


def _limit_notes(model: pin.Model) -> tuple[str, ...]:
    """Say which limits are taken as not given and which position ranges are empty."""
    joints = {
        name: joint
        for name, joint in zip(model.names[1:], model.joints[1:], strict=True)
        if joint.nv == 1
    }
    notes = []
    for kind, limit in (("effort", model.upperEffortLimit), ("velocity", model.upperVelocityLimit)):
        if zero := [
            name for name, joint in joints.items() if not 0.0 < limit[joint.idx_v] < np.inf
        ]:
            notes.append(f"the {kind} limit is 0 or missing, taken as not given, at {listed(zero)}")
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    if empty := [
        n
        for n, joint in joints.items()
        if joint.nq == 1 and lower[joint.idx_q] == upper[joint.idx_q]
    ]:
        notes.append(f"the lower position limit equals the upper one at {listed(empty)}")
    return tuple(notes)


def _rotor_notes(model: pin.Model, srdf: Path | None) -> tuple[str, ...]:
    """Say what reflected inertia an SRDF file beside the URDF gives."""
    if srdf is None:
        return ()
    rotors = pin.Model(model)
    pin.loadRotorParameters(rotors, str(srdf), False)
    armature = np.array(rotors.rotorInertia) * np.array(rotors.rotorGearRatio) ** 2
    if not armature.any():
        return ()
    return (
        f"its SRDF gives reflected rotor inertia, not applied here; to do so: armature={armature.tolist()}",
    )
