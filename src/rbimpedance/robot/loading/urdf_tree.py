"""Whether the links and joints of a document belong together: unique names, one tree, moments that a body can have."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from ..._common.suggestions import suggest
from ...exceptions import ModelError
from .urdf_document import Joint, UrdfDocument
from .wording import listed

_RESERVED = "universe"
_NO_MOMENT = 1e-12  # kg·m²; smaller ones are rounding


def check_links(document: UrdfDocument) -> None:
    """Refuse a document whose links and joints do not make one robot.

    Args:
        document: The document.

    Raises:
        ModelError: Which link or joint is wrong, and what would be right.
    """
    _check_names(document)
    _check_tree(document)
    _check_moments(document)


def _check_names(document: UrdfDocument) -> None:
    for kind, things in (("link", document.links), ("joint", document.joints)):
        seen: set[str] = set()
        for thing in things:
            if thing.name in seen:
                raise ModelError(f"two {kind}s are called '{thing.name}'; names must be unique")
            if thing.name == _RESERVED:
                raise ModelError(f"the {kind} name '{thing.name}' is reserved; rename it")
            seen.add(thing.name)


def _check_tree(document: UrdfDocument) -> None:
    names = [link.name for link in document.links]
    if not names:
        raise ModelError("there is no <link>")
    children: dict[str, list[str]] = {name: [] for name in names}
    parents: dict[str, str] = {}
    for joint in document.joints:
        _check_ends(joint, children)
        if joint.child in parents:
            raise ModelError(
                f"link '{joint.child}' is the child of two joints, '{parents[joint.child]}' and '{joint.name}'; "
                "a URDF is a tree"
            )
        parents[joint.child] = joint.name
        children[joint.parent].append(joint.child)
    _check_connected(children, [name for name in names if name not in parents])


def _check_ends(joint: Joint, links: Collection[str]) -> None:
    """Refuse a joint whose links are not there, or one and the same."""
    for end, other, tag in (
        (joint.parent, joint.child, "parent"),
        (joint.child, joint.parent, "child"),
    ):
        if end not in links:
            others = [name for name in links if name != other]
            near = suggest(end, others) if others else ""
            raise ModelError(
                f"joint '{joint.name}' has the {tag} link '{end}', and there is no <link name=\"{end}\">{near}"
            )
    if joint.parent == joint.child:
        raise ModelError(
            f"joint '{joint.name}' joins link '{joint.child}' to itself; a joint joins two links"
        )


def _check_connected(children: Mapping[str, list[str]], roots: list[str]) -> None:
    if len(roots) > 1:
        raise ModelError(
            f"the links {listed(roots)} have no parent joint; a robot has one root link"
        )
    reached: set[str] = set()
    stack = list(roots)
    while stack:
        name = stack.pop()
        reached.add(name)
        stack.extend(children[name])
    if lost := [name for name in children if name not in reached]:
        raise ModelError(
            f"the joints of the links {listed(lost)} run in a circle; a robot has one root link"
        )


def _check_moments(document: UrdfDocument) -> None:
    """Refuse negative moments of inertia of links that move; fixed links do not affect the dynamics."""
    carriers = document.carriers()
    for link in document.links:
        if carriers[link.name] is not None and link.inertial is not None:
            smallest, *_, largest = link.inertial.principal()
            if smallest < -1e-9 * abs(largest) - _NO_MOMENT:
                raise ModelError(
                    f"link '{link.name}': its <inertia> has the negative principal moment {smallest:.3g} kg·m²; "
                    "the matrix must be positive semi-definite"
                )
