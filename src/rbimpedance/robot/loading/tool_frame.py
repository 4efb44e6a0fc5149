"""The frame that Jacobians and wrenches refer to where the user names none."""

from __future__ import annotations

from collections.abc import Sequence

import pinocchio as pin


def default_tool_frame(model: pin.Model, link_order: Sequence[str]) -> str:
    """Return the moving leaf link at the end of the longest chain of joints; ties as `load_robot` documents.

    Args:
        model: The model.
        link_order: Names of the links in the order of the document.
    """
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
