"""What `load_robot` is given, checked before anything is read."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from numbers import Real
from pathlib import Path

from ...exceptions import ModelError
from .repair import REPAIRS
from .urdf_reader import FARTHEST_LIMIT
from .wording import by_name


def folders_of(package_dirs: str | Path | Sequence[str | Path]) -> tuple[Path, ...]:
    """Return the folders that `package_dirs=` names.

    Raises:
        ModelError: It names none.
    """
    try:
        named = (package_dirs,) if isinstance(package_dirs, (str, Path)) else package_dirs
        return tuple(Path(folder) for folder in named)
    except TypeError as error:
        raise ModelError(f"package_dirs= takes folders, got {package_dirs!r}") from error


def given_positions(given: Mapping[str, float] | None) -> dict[str, float]:
    """Return the positions that `locked_configuration=` gives.

    Args:
        given: Positions by joint [rad or m].

    Raises:
        ModelError: Something in it is no name, or no finite number.
    """
    values = by_name("locked_configuration", given, "positions")
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


def repair_names(repair: bool | str | Iterable[str]) -> tuple[str, ...]:
    """Return the names of the repairs that `repair=` requests.

    Raises:
        ModelError: An unknown name.
    """
    if isinstance(repair, bool):
        return tuple(REPAIRS) if repair else ()
    try:
        names = (repair,) if isinstance(repair, str) else tuple(repair)
    except TypeError:
        names = (repair,)  # type: ignore[assignment]
    if unknown := [name for name in names if name not in REPAIRS]:
        there = ", ".join(f'"{name}"' for name in REPAIRS)
        raise ModelError(f"repair= takes True, False or names ({there}), got {unknown[0]!r}")
    return names
