"""Units of figures: joints that turn and joints that slide have tables of their own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from ..robot.units import FORCE


class Units(NamedTuple):
    """What the figures of one kind of joint are in, and which joints these are.

    Attributes:
        position: Of positions and errors.
        force: Of the motor's force or torque.
        inertia: Of its inertia.
        joints: Numbers of the joints.
    """

    position: str
    force: str
    inertia: str
    joints: tuple[int, ...]

    def write(self, label: str) -> str:
        """Return a label with this kind's units for `{x}`, `{f}` and `{m}`."""
        return label.format(x=self.position, f=self.force, m=self.inertia)


def kinds(units: Sequence[str]) -> Iterator[Units]:
    """Return the kinds that there are, those that turn first.

    Args:
        units: "rad" or "m" of each joint.
    """
    for position, inertia in (("rad", "kg·m^2"), ("m", "kg")):
        joints = tuple(i for i, unit in enumerate(units) if unit == position)
        if joints:
            yield Units(position, FORCE[position], inertia, joints)
