"""Which joints of a robot move: `joints=`, `lock=` and what mimicking joints follow. Names only, no dynamics."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from numbers import Real

from ..._common.suggestions import suggest
from ...exceptions import ModelError, UnsupportedJointError
from .strict_xml import LARGEST_NUMBER
from .urdf_document import Mimic, UrdfDocument, listed
from .urdf_reader import FARTHEST_LIMIT

_SHOWN = 8  # reasons in one error


def joints_to_lock(
    movable: Sequence[str],
    follows: Mapping[str, str],
    fixed: Iterable[str],
    joints: Iterable[str] | None,
    lock: Iterable[str],
) -> frozenset[str]:
    """Return the names of the movable joints that are to be frozen.

    A joint that follows a frozen one is frozen too; one that follows a kept one is kept unless `lock` names it.

    Args:
        movable: Names of all movable joints.
        follows: What each mimicking joint follows directly.
        fixed: Names of the fixed joints: locking them changes nothing.
        joints: Names of the joints to keep; None keeps all.
        lock: Names of the joints to freeze.

    Raises:
        ModelError: An unknown name, a contradiction, or nothing would be left to move.
    """
    fixed = set(fixed)
    frozen = _known("lock", lock, [*movable, *fixed]) - fixed
    leaders = {name: _leaders(name, follows) for name in movable}
    if joints is not None:
        kept = _known("joints", joints, movable)
        if both := sorted(kept & frozen):
            raise ModelError(f"joint '{both[0]}' is both in joints= and in lock=")
        for name in sorted(kept):
            if missing := [leader for leader in leaders[name] if leader not in kept]:
                raise ModelError(f"joint '{name}' follows '{missing[0]}'; put that in joints= too")
        frozen |= {name for name in movable if kept.isdisjoint([name, *leaders[name][-1:]])}
    frozen |= {name for name in movable if not frozen.isdisjoint(leaders[name])}
    if not set(movable) - frozen - follows.keys():
        there_are = f" (there are {listed(movable)})" if movable else ""
        raise ModelError(
            f"no movable joint remains: the robot has none or all are locked{there_are}"
        )
    return frozenset(frozen)


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


def given_positions(given: Mapping[str, float] | None) -> dict[str, float]:
    """Return the positions that `locked_configuration=` gives.

    Args:
        given: Positions by joint [rad or m].

    Raises:
        ModelError: Something in it is no name, or no finite number.
    """
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


def locked_positions(
    document: UrdfDocument, locked: Iterable[str], given: Mapping[str, float]
) -> dict[str, float]:
    """Add to the given positions of locked joints those that follow from what a mimicking joint follows.

    Args:
        document: The document.
        locked: Names of the locked joints.
        given: Positions that the user gave [rad or m].
    """
    joints = {joint.name: joint for joint in document.joints}
    mimics = document.mimics()

    def position(name: str) -> float:
        multiplier, offset, seen = 1.0, 0.0, {name}
        while name not in given and name in mimics and mimics[name].joint in joints:
            mimic = mimics[name]
            if mimic.joint in seen:
                break
            seen.add(mimic.joint)
            multiplier, offset = multiplier * mimic.multiplier, offset + multiplier * mimic.offset
            name = mimic.joint
        leader = joints[name]
        own = given[name] if name in given else min(max(0.0, leader.lower), leader.upper)
        return multiplier * own + offset

    return {**given, **{name: position(name) for name in locked if name in mimics}}


def check_mimics(document: UrdfDocument, mimics: Mapping[str, Mimic], order: Sequence[str]) -> None:
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
        names = [name for group in faults.values() for name in group]
        reasons = [
            f"{listed(group)} {reason}" + ("" if primary in kinds else suggest(primary, kinds))
            for (primary, reason), group in list(faults.items())[:_SHOWN]
        ]
        more = "; ..." if len(faults) > _SHOWN else ""
        quoted = ", ".join(f'"{name}"' for name in names)
        raise UnsupportedJointError(
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


def _leaders(name: str, follows: Mapping[str, str]) -> list[str]:
    """What a joint follows, what that follows, and so on."""
    leaders: dict[str, None] = {}
    while name in follows and follows[name] not in leaders:
        name = follows[name]
        leaders[name] = None
    return list(leaders)


def _composed(mimic: Mimic, above: Mimic) -> Mimic:
    """What a joint follows whose primary follows another one."""
    multiplier = mimic.multiplier * above.multiplier
    return Mimic(above.joint, multiplier, mimic.multiplier * above.offset + mimic.offset)


def _known(argument: str, names: Iterable[str], known: Sequence[str]) -> set[str]:
    """Return the names as a set; one name alone may be given as a string."""
    try:
        given = [names] if isinstance(names, str) else list(names)
    except TypeError as error:
        raise ModelError(f"{argument}= takes names of joints, got {names!r}") from error
    there = set(known)
    for name in given:
        if not isinstance(name, str) or name not in there:
            near = suggest(str(name), known)
            raise ModelError(f"{argument}= names '{name}', which is no movable joint{near}")
    return set(given)
