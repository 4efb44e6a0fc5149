"""Pinocchio models that are what they should be: built from a document and held against it, or given and checked."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pinocchio as pin

from ..._common.arrays import Array
from ..._common.suggestions import suggest
from ...exceptions import ModelError, UnsupportedJointError
from .strict_xml import LARGEST_NUMBER
from .urdf_document import Mimic, UrdfDocument
from .wording import listed

_ROUNDING = 1e-9  # relative
_SHOWN = 8  # reasons in one error

# --- a document becomes a model ---------------------------------------------------------------------------------


def build_model(document: UrdfDocument, origin: str) -> pin.Model:
    """Build the full model of a document and hold it against the document.

    Args:
        document: The document, in which locked joints mimic nothing any more.
        origin: Where it came from, for errors.

    Raises:
        ModelError: Pinocchio cannot build it, or left something out.
        UnsupportedJointError: Mimicking joints that Pinocchio cannot model.
    """
    mimics = document.mimics()
    free = _pinocchio_model(document.without_mimics(mimics), origin)
    _compare(document, free, origin)
    if not mimics:
        return free
    roots = root_mimics(mimics)
    _check_mimics(document, roots, list(free.names))
    model = _pinocchio_model(document.with_mimics(roots), origin)
    _add_mimicking_friction(model, document, roots)
    return model


def _pinocchio_model(document: UrdfDocument, origin: str) -> pin.Model:
    try:
        return pin.buildModelFromXML(document.to_xml(), True)
    except (ValueError, RuntimeError, IndexError) as error:
        raise ModelError(f"{origin}: Pinocchio cannot build this robot: {error}") from error


def root_mimics(mimics: Mapping[str, Mimic]) -> dict[str, Mimic]:
    """Resolve joints that mimic mimicking joints; circles are left out.

    Args:
        mimics: What each mimicking joint follows directly.

    Returns:
        What each follows in the end, with the multipliers and offsets of the chain composed.
    """
    resolved = {}
    for name in mimics:
        seen, last = {name}, mimics[name]
        while last.joint in mimics and last.joint not in seen:
            seen.add(last.joint)
            last = _composed(last, mimics[last.joint])
        if last.joint not in seen:
            resolved[name] = last
    return resolved


def _composed(mimic: Mimic, above: Mimic) -> Mimic:
    """What a joint follows whose primary follows another one."""
    multiplier = mimic.multiplier * above.multiplier
    return Mimic(above.joint, multiplier, mimic.multiplier * above.offset + mimic.offset)


def _check_mimics(
    document: UrdfDocument, mimics: Mapping[str, Mimic], order: Sequence[str]
) -> None:
    """Refuse mimicking joints that Pinocchio cannot model.

    Args:
        document: The document, in which locked joints mimic nothing any more.
        mimics: Its mimicking joints, resolved by `root_mimics`.
        order: Names of the joints in the order in which Pinocchio builds them.

    Raises:
        UnsupportedJointError: With the joints' names and the remedy.
    """
    kinds = {joint.name: joint.kind for joint in document.joints}
    faults: dict[tuple[str, str], list[str]] = {}
    for name, direct in document.mimics().items():
        rule = mimics.get(name, direct)
        circle = f"mimics '{rule.joint}' in a circle"
        reason = _mimic_fault(name, rule, kinds, order) if name in mimics else circle
        if reason:
            faults.setdefault((rule.joint, reason), []).append(name)
    if faults:
        raise _unsupported(faults, kinds)


def _unsupported(
    faults: Mapping[tuple[str, str], list[str]], kinds: Mapping[str, str]
) -> UnsupportedJointError:
    """The error of joints that cannot follow others, by what they mimic and the reason."""
    names = [name for group in faults.values() for name in group]
    reasons = [
        f"{listed(group)} {reason}" + ("" if primary in kinds else suggest(primary, kinds))
        for (primary, reason), group in list(faults.items())[:_SHOWN]
    ]
    more = "; ..." if len(faults) > _SHOWN else ""
    quoted = ", ".join(f'"{name}"' for name in names)
    return UnsupportedJointError(
        names, f"{'; '.join(reasons)}{more}; correct the file or freeze with lock=({quoted},)"
    )


def _mimic_fault(name: str, rule: Mimic, kinds: Mapping[str, str], order: Sequence[str]) -> str:
    """Why a joint cannot follow another one; empty where it can."""
    primary = rule.joint
    if primary not in kinds:
        return f"mimics '{primary}', which does not exist"
    allowed = ("continuous",) if kinds[primary] == "continuous" else ("revolute", "prismatic")
    if kinds[primary] not in allowed or kinds[name] not in allowed:
        return f"({kinds[name]}) mimics '{primary}' ({kinds[primary]}), which Pinocchio does not support"
    if order.index(primary) > order.index(name):
        return f"mimics '{primary}', which comes later in Pinocchio's tree"
    if not max(abs(rule.multiplier), abs(rule.offset)) <= LARGEST_NUMBER:
        return f"mimics '{primary}' with a multiplier or offset beyond {LARGEST_NUMBER:g}"
    return ""


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
    """Refuse a model that lacks a link, a joint, mass or inertia of the document."""
    kinds = pin.FrameType
    bodies = {frame.name for frame in model.frames if frame.type == kinds.BODY}
    joints = {f.name for f in model.frames if f.type in (kinds.JOINT, kinds.FIXED_JOINT)}
    lost = [f"link '{link.name}'" for link in document.links if link.name not in bodies]
    lost += [f"joint '{joint.name}'" for joint in document.joints if joint.name not in joints]
    if lost:
        raise ModelError(f"{origin}: Pinocchio dropped {', '.join(lost[:8])}")
    if set(model.names[1:]) != set(document.movable()):
        raise ModelError(f"{origin}: Pinocchio's joints are not the movable joints of the document")
    for name, wanted in _bodies(document, model).items():
        body = model.inertias[model.getJointId(name)]
        built = _moments(body.mass, np.array(body.lever), np.array(body.inertia))
        if abs(built[0] - wanted[0]) > _ROUNDING * max(wanted[0], 1.0):
            raise ModelError(
                f"{origin}: joint '{name}' has a body of {wanted[0]} kg, but {built[0]} kg in Pinocchio's model"
            )
        if not np.allclose(built, wanted, rtol=1e-6, atol=1e-12 * np.abs(wanted).max()):
            raise ModelError(
                f"{origin}: the body of joint '{name}' has a different inertia in Pinocchio's model"
            )


def _bodies(document: UrdfDocument, model: pin.Model) -> dict[str, Array]:
    """Moments of the body of each movable joint by the document: links that are fixed to each other are one body."""
    bodies = {name: np.zeros(13) for name in document.movable()}
    places = {frame.name: frame.placement for frame in model.frames if frame.type == pin.BODY}
    carriers = document.carriers()
    for link in document.links:
        carrier, inertial = carriers[link.name], link.inertial
        if carrier is not None and inertial is not None:
            place = places[link.name]
            R = place.rotation @ pin.rpy.rpyToMatrix(*inertial.rpy)
            centre = place.rotation @ np.array(inertial.xyz) + place.translation
            bodies[carrier] += _moments(inertial.mass, centre, R @ inertial.matrix() @ R.T)
    return bodies


def _moments(mass: float, centre: Array, inertia: Array) -> Array:
    """Mass, first and second moments of a body about the origin, shape (13,); those of two bodies add."""
    steiner = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return np.concatenate([[mass], mass * centre, (inertia + steiner).ravel()])


# --- a model that is given --------------------------------------------------------------------------------------


def checked_copy(source: pin.Model) -> pin.Model:
    """Copy a model that the user built, if it can be handed to Pinocchio's algorithms, which check nothing.

    Raises:
        ModelError: Its tables do not belong together, or hold numbers that no robot has.
    """
    checks = (
        _table_faults,
        _vector_faults,
        _body_faults,
    )  # before the copy: it reads beyond tables that are short
    for fault in itertools.chain.from_iterable(check(source) for check in checks):
        raise ModelError(f"the pinocchio.Model '{source.name}' is not sound: {fault}")
    model = pin.Model(source)
    for j in range(1, model.njoints):
        if not model.existFrame(model.names[j]):
            model.addJointFrame(j)
    return model


_TABLES = (
    *("names", "parents", "joints", "jointPlacements", "inertias"),
    *("children", "supports", "subtrees", "idx_qs", "nqs", "idx_vs", "nvs"),
)
"""One entry per joint."""


def _table_faults(model: pin.Model) -> Iterable[str]:
    """Say which tables do not fit each other: an index that leads nowhere crashes the process."""
    n = model.njoints
    if wrong := [name for name in _TABLES if len(getattr(model, name)) != n]:
        yield f"{wrong[0]} has {len(getattr(model, wrong[0]))} entries for {n} joints"
        return
    names = list(model.names)
    if len(set(names)) != n:
        yield "two joints have the same name"
    if len(model.frames) != model.nframes:
        yield f"there are {len(model.frames)} frames, not {model.nframes}"
    for frame in model.frames:
        if frame.parentJoint >= n or frame.parentFrame >= len(model.frames):
            yield f"the frame '{frame.name}' is attached to a joint or frame that does not exist"
    parents = list(model.parents)
    if any(parents[j] >= j for j in range(1, n)):
        yield "a joint comes before its parent"
        return
    yield from _order_faults(model, names, parents)


def _order_faults(model: pin.Model, names: list[str], parents: list[int]) -> Iterable[str]:
    """Say which joints are not where the model's tables have them."""
    supports = _supports(parents)
    below: list[list[int]] = [[] for _ in parents]
    for i, chain in enumerate(supports):
        for j in chain:
            below[j].append(i)
    q = v = 0
    mimicking = set(model.mimicking_joints)
    for j in range(1, model.njoints):
        joint = model.joints[j]
        place = (joint.id, joint.nq, joint.nv) == (j, model.nqs[j], model.nvs[j])
        if j not in mimicking:
            place &= (joint.idx_q, joint.idx_v) == (q, v) == (model.idx_qs[j], model.idx_vs[j])
        q, v = q + joint.nq, v + joint.nv
        if not place:
            yield f"the joint '{names[j]}' does not belong to its place in the tables"
        if list(model.supports[j]) != supports[j]:
            yield f"supports of '{names[j]}' is not the chain of its parents"
        if sorted(model.subtrees[j]) != below[j]:
            yield f"subtrees of '{names[j]}' is not what hangs on it"
    if (q, v) != (model.nq, model.nv):
        yield f"nq and nv are {model.nq} and {model.nv}; the joints have {q} and {v}"


def _supports(parents: list[int]) -> list[list[int]]:
    """The chain of joints from the base to each joint, itself included."""
    supports: list[list[int]] = [[0]]
    for j in range(1, len(parents)):
        supports.append([*supports[parents[j]], j])
    return supports


def _vector_faults(model: pin.Model) -> Iterable[str]:
    """Say which vectors have a wrong length or hold numbers that they must not hold."""
    sizes = dict.fromkeys(("lowerPositionLimit", "upperPositionLimit"), model.nq)
    limits = ("upperEffortLimit", "upperVelocityLimit")
    positive = ("damping", "upperDryFrictionLimit", "armature")
    sizes |= dict.fromkeys((*limits, *positive, "rotorInertia", "rotorGearRatio"), model.nv)
    values = {name: np.array(getattr(model, name)).ravel() for name in sizes}
    for name, value in values.items():
        if len(value) != sizes[name]:
            yield f"{name} has {len(value)} entries, not {sizes[name]}"
        elif np.isnan(value).any():
            yield f"{name} holds NaN"
        elif name in positive and not (np.isfinite(value) & (value >= 0.0)).all():
            yield f"{name} holds negative or infinite numbers"
    for item in model.referenceConfigurations:
        if len(item.data()) != model.nq or not np.isfinite(item.data()).all():
            yield f"its reference configuration '{item.key()}' is not {model.nq} finite numbers"
    if not np.isfinite(np.array(model.gravity.vector)).all():
        yield "gravity is not finite"
    lower, upper = values["lowerPositionLimit"], values["upperPositionLimit"]
    if len(lower) == len(upper) and (lower > upper).any():
        yield "a lower position limit is above the upper one"


def _body_faults(model: pin.Model) -> Iterable[str]:
    """Say which bodies and placements no robot has."""
    for name, body in zip(list(model.names)[1:], list(model.inertias)[1:], strict=False):
        if not np.isfinite(body.matrix()).all():
            yield f"the inertia of the body of joint '{name}' is not finite"
            continue
        smallest, *_, largest = np.linalg.eigvalsh(body.inertia)
        if body.mass < 0.0 or smallest < -1e-9 * largest:
            yield f"the body of joint '{name}' has a negative mass or moment of inertia"
    placements = [*zip(model.names, model.jointPlacements, strict=False)]
    placements += [(frame.name, frame.placement) for frame in model.frames]
    for name, placement in placements[1:]:
        R = np.array(placement.rotation)
        if not np.isfinite(placement.translation).all() or not np.allclose(R @ R.T, np.eye(3)):
            yield f"the placement of '{name}' is not finite, or no rotation"
