"""`load_robot`: any robot description becomes an `ArmModel`, with every check on the way in."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from ._arrays import vector
from ._description import Description
from .dynamics import ArmModel
from .exceptions import ModelError, UnsupportedJointError
from .loading.joint_selection import check_mimics, joints_to_lock, locked_positions, root_mimics
from .loading.robot_sources import RobotText, read_source
from .loading.soundness import check_inertia
from .loading.stderr import captured_stderr
from .loading.urdf_appearance import appearance_notes
from .loading.urdf_document import Mimic, UrdfDocument, listed
from .loading.urdf_reader import parse_urdf

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
    package_dirs: str | Path | Sequence[str | Path] = (),
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
        package_dirs: Folders in which `package://` addresses of meshes are looked up.

    Returns:
        The arm; its `notes` say what was found on the way: limits that are not given, meshes that are not there, ...

    Raises:
        ModelError: No such source, or its description is not sound; says which element and what would be right.
        UnsupportedJointError: Joints that cannot be controlled, by name, with the way out.
        MissingExtraError: A robot_descriptions name without that package.
        GainError: `armature` is negative or not finite.
        DimensionError: `gravity` or `armature` has a wrong shape.
        NonFiniteError: `gravity` holds NaN or infinity.
    """
    values = dict(locked_configuration or {})
    if isinstance(source, pin.RobotWrapper):
        source = source.model
    if isinstance(source, pin.Model):
        robot = _from_model(source, joints, lock, values)
    else:
        robot = _from_text(read_source(source, package_dirs), joints, lock, values)
    model = _reduced(robot)
    if gravity is not None:
        model.gravity.linear = vector("gravity", gravity, 3, "x, y, z")
    tool = _default_tool_frame(model, robot.link_order) if tool_frame is None else tool_frame
    notes = (*robot.notes, *_limit_notes(model), *_rotor_notes(model, robot.rotors))
    description = _with_recipe(robot, source, package_dirs)
    arm = ArmModel(model, name=robot.name, tool_frame=tool, notes=notes, description=description)
    if armature is not None:
        arm = arm.with_armature(armature)
    check_inertia(arm)
    return arm


@dataclass(frozen=True)
class _Robot:
    """A full model and what is to be done with it."""

    model: pin.Model
    name: str
    locked: frozenset[str]
    values: Mapping[str, float]
    link_order: tuple[str, ...] = ()
    rotors: Path | None = None
    notes: tuple[str, ...] = ()
    description: Description | None = None
    is_named: bool = False
    floats: bool = False


def _with_recipe(
    robot: _Robot, source: object, package_dirs: str | Path | Sequence[str | Path]
) -> Description | None:
    """The description with the way to load it again, where the source has a name or a path."""
    description = robot.description
    if description is None or description.folder is None:
        return description
    folders = (package_dirs,) if isinstance(package_dirs, (str, Path)) else package_dirs
    recipe = {
        "source": str(source) if robot.is_named else str(Path(str(source)).absolute()),
        "lock": sorted(robot.locked) + ([_FLOATING_BASE] if robot.floats else []),
        "locked_configuration": {name: float(value) for name, value in robot.values.items()},
        "package_dirs": [str(Path(folder).absolute()) for folder in folders],
    }
    return replace(description, recipe=recipe)


def _from_model(
    source: pin.Model,
    joints: Iterable[str] | None,
    lock: Iterable[str],
    values: Mapping[str, float],
) -> _Robot:
    model = pin.Model(source)
    names = list(model.names)
    pairs = zip(model.mimicking_joints, model.mimicked_joints, strict=True)
    primaries = {names[mimicking]: names[primary] for mimicking, primary in pairs}
    locked = joints_to_lock(names[1:], primaries, (), joints, lock)
    if following := sorted(values.keys() & primaries.keys()):
        name = following[0]
        raise ModelError(
            f"locked_configuration: '{name}' follows '{primaries[name]}'; give that one's position"
        )
    for name, body in zip(names[1:], model.inertias[1:], strict=True):
        if not np.isfinite(body.matrix()).all():
            raise ModelError(f"the inertia of the body of joint '{name}' is not finite")
        smallest, *_, largest = np.linalg.eigvalsh(body.inertia)
        if body.mass < 0.0 or smallest < -1e-9 * largest:
            raise ModelError(f"the body of joint '{name}' has a negative mass or moment of inertia")
    for j in range(1, model.njoints):
        if not model.existFrame(names[j]):
            model.addJointFrame(j)
    return _Robot(model, model.name or "robot", locked, values)


def _from_text(
    text: RobotText, joints: Iterable[str] | None, lock: Iterable[str], values: Mapping[str, float]
) -> _Robot:
    document = parse_urdf(text.text, text.origin)
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
    model = _build(document.without_mimics(locked), text.origin)
    if document.gravity is not None:
        model.gravity.linear = np.array(document.gravity)
    return _Robot(
        model=model,
        name=text.name or document.name,
        locked=locked,
        values=locked_positions(document, locked, values),
        link_order=tuple(link.name for link in document.links),
        rotors=text.rotors,
        notes=(*text.notes, *document.notes(), *appearance_notes(document, text)),
        description=Description(document.xml, text.folder, text.package_dirs),
        is_named=text.name is not None,
        floats=text.floating,
    )


# --- the document becomes a Pinocchio model ---------------------------------------------------------------------


def _build(document: UrdfDocument, origin: str) -> pin.Model:
    """Build the full model and hold it against the document."""
    mimics = document.mimics()
    free = _pinocchio_model(document.without_mimics(mimics), origin)
    _compare(document, free, origin)
    if not mimics:
        return free
    roots = root_mimics(mimics)
    check_mimics(document, roots, list(free.names))
    model = _pinocchio_model(document.with_mimics(roots), origin)
    _add_mimicking_friction(model, document, roots)
    return model


def _pinocchio_model(document: UrdfDocument, origin: str) -> pin.Model:
    with captured_stderr() as messages:
        try:
            return pin.buildModelFromXML(document.to_xml(), True)
        except (ValueError, RuntimeError) as error:
            reason = f"{error} {messages()}".strip()
    raise ModelError(f"{origin}: Pinocchio cannot build this robot: {reason}")


def _add_mimicking_friction(
    model: pin.Model, document: UrdfDocument, mimics: Mapping[str, Mimic]
) -> None:
    """Give the friction of mimicking joints, which Pinocchio leaves out, to the joints that they follow."""
    damping, friction = np.array(model.damping), np.array(model.upperDryFrictionLimit)
    for joint in document.joints:
        if joint.name in mimics:
            mimic = mimics[joint.name]
            i = model.joints[model.getJointId(mimic.joint)].idx_v
            damping[i] += mimic.multiplier**2 * joint.damping
            friction[i] += abs(mimic.multiplier) * joint.friction
    model.damping = damping
    model.upperDryFrictionLimit, model.lowerDryFrictionLimit = friction, -friction


def _compare(document: UrdfDocument, model: pin.Model, origin: str) -> None:
    """Refuse a model that lacks a link, a joint or mass of the document."""
    kinds = pin.FrameType
    bodies = {frame.name for frame in model.frames if frame.type == kinds.BODY}
    joints = {f.name for f in model.frames if f.type in (kinds.JOINT, kinds.FIXED_JOINT)}
    lost = [f"link '{link.name}'" for link in document.links if link.name not in bodies]
    lost += [f"joint '{joint.name}'" for joint in document.joints if joint.name not in joints]
    if lost:
        raise ModelError(f"{origin}: Pinocchio dropped {', '.join(lost[:8])}")
    masses = dict.fromkeys(document.movable(), 0.0)
    carriers = document.carriers()
    for link in document.links:
        carrier = carriers[link.name]
        if carrier is not None and link.inertial is not None:
            masses[carrier] += link.inertial.mass
    for name, mass in masses.items():
        built = model.inertias[model.getJointId(name)].mass
        if abs(built - mass) > 1e-9 * max(mass, 1.0):
            raise ModelError(
                f"{origin}: joint '{name}' carries {mass} kg, and {built} kg in Pinocchio's model"
            )


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
        if joint.nv != 1 or not isinstance(value, Real) or not np.isfinite(value):
            raise ModelError(
                f"locked_configuration: '{name}' takes one finite number, got {value!r}"
            )
        place = slice(joint.idx_q, joint.idx_q + joint.nq)
        q[place] = value if joint.nq == 1 else (np.cos(value), np.sin(value))
    if robot.locked:
        model = pin.buildReducedModel(model, [model.getJointId(name) for name in robot.locked], q)
        _mend_parent_frames(model, robot.model)
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
