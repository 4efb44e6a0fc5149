"""What people call robots: makers and models beside the names that sources give them."""

from __future__ import annotations

from collections.abc import Iterable

from ..._common.suggestions import suggest

_ALONE = (
    "aloha",
    "fetch",
    "gen2",
    "gen3",
    "iiwa14",
    "iiwa7",
    "piper",
    "ur10e",
    "ur3e",
    "ur5e",
    "yumi",
)

NICKNAMES = {
    **{name: (f"{name}_description",) for name in _ALONE},
    "barrett": ("wam7_description", "barrett_hand_description"),
    **dict.fromkeys(("emika", "franka"), ("panda", "fr3_description")),
    "fr3": ("fr3_description", "panda"),
    **dict.fromkeys(("iiwa", "kuka", "lbr"), ("iiwa14_description", "iiwa7_description")),
    "jaco": ("kinova", "gen2_description"),
    **dict.fromkeys(("lite6", "ufactory", "xarm"), ("xarm7",)),
    "pal": ("talos_arm", "tiago"),
    "so-arm100": ("so100",),
    "universal": ("ur5", "ur3", "ur10"),
    "unitree": ("z1", "g1", "go2"),
}
"""Names of `load_robot` by maker, family or model, the best first."""

EXTRA = "descriptions"
"""Extra that brings robot_descriptions, whose names end in `_description`."""


def suggest_robot(name: str, known: Iterable[str]) -> str:
    """Return "; did you mean ...?" for a name that people use, or near one that is known.

    Args:
        name: The requested name.
        known: Names of `load_robot` that are there.
    """
    known = list(known)
    wanted = _called(name)
    if not wanted:
        return suggest(name, known)
    there = [robot for robot in wanted if robot in known]
    if there:
        return "; did you mean " + " or ".join(f"'{robot}'" for robot in there) + "?"
    others = " or ".join(f"'{robot}'" for robot in wanted)
    return f"; did you mean {others} of robot_descriptions (the extra '{EXTRA}')?"


def _called(name: str) -> tuple[str, ...]:
    """The robots that a name means, by the first of its parts that is a nickname."""
    lower = name.lower()
    parts = lower.replace("-", "_").replace(" ", "_").split("_")
    return next((NICKNAMES[part] for part in (lower, *parts) if part in NICKNAMES), ())
