"""Which joints of a robot move: `joints=`, `lock=` and what mimicking joints follow. Names only, no dynamics."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ..._common.suggestions import suggest
from ...exceptions import ModelError
from .urdf_document import UrdfDocument
from .wording import listed


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
        while name not in given and (mimic := mimics.get(name)) is not None:
            if mimic.joint in seen or mimic.joint not in joints:
                break
            multiplier, offset = multiplier * mimic.multiplier, offset + multiplier * mimic.offset
            name = mimic.joint
            seen.add(name)
        leader = joints[name]
        own = given[name] if name in given else min(max(0.0, leader.lower), leader.upper)
        return multiplier * own + offset

    return {**given, **{name: position(name) for name in locked if name in mimics}}


def _leaders(name: str, follows: Mapping[str, str]) -> list[str]:
    """What a joint follows, what that follows, and so on."""
    leaders: dict[str, None] = {}
    while name in follows and follows[name] not in leaders:
        name = follows[name]
        leaders[name] = None
    return list(leaders)


def _known(argument: str, names: Iterable[str], known: Sequence[str]) -> set[str]:
    """Return the names as a set; one name alone may be given as a string."""
    try:
        given = [names] if isinstance(names, str) else list(names)
    except TypeError as error:
        raise ModelError(f"{argument}= takes names of joints, got {names!r}") from error
    there = set(known)
    for name in given:
        if not isinstance(name, str) or name not in there:
            raise ModelError(
                f"{argument}= names '{name}', which is no movable joint{suggest(str(name), known)}"
            )
    return set(given)
