"""Frozen dataclasses: fields that normalise what they are given, and parts that are not pickled but made again."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, Generic, TypeAlias, TypeVar, overload

from numpy.typing import ArrayLike

from .arrays import Array

GivenT = TypeVar("GivenT")
KeptT = TypeVar("KeptT")

_REQUIRED: Any = object()


class Converted(Generic[GivenT, KeptT]):
    """A field of a dataclass that is checked and converted when it is set: a descriptor-typed field of `dataclasses`.

    Args:
        convert: Takes the field's name and what was given, and returns what is kept.
        default: What is given by default; without one the field is required.
    """

    def __init__(
        self, convert: Callable[[str, GivenT], KeptT], default: GivenT = _REQUIRED
    ) -> None:
        self._convert, self._default = convert, default

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type) -> Any: ...

    @overload
    def __get__(self, instance: object, owner: type) -> KeptT: ...

    def __get__(self, instance: object | None, owner: type) -> Any:
        if instance is not None:
            return instance.__dict__[self._name]
        if self._default is _REQUIRED:
            raise AttributeError(self._name)
        return self._default

    def __set__(self, instance: object, value: GivenT) -> None:
        instance.__dict__[self._name] = self._convert(self._name, value)


Gain: TypeAlias = Converted[ArrayLike, Array]
"""A field that is given as numbers of any kind and kept as an array."""

OptionalGain: TypeAlias = Converted[ArrayLike | None, Array | None]
"""The same, where None means that there is none."""


def unless_none(
    convert: Callable[[str, ArrayLike], Array],
) -> Callable[[str, ArrayLike | None], Array | None]:
    """Return the conversion that leaves None as it is."""
    return lambda name, value: None if value is None else convert(name, value)


def set_fields(instance: object, **values: object) -> None:
    """Set the fields of a frozen dataclass from within its `__init__`."""
    for name, value in values.items():
        object.__setattr__(instance, name, value)


class MadeAnew(ABC):
    """An object with parts that follow from its other fields: they are not pickled, but made again.

    `_made` names them, `_make` makes them.
    """

    _made: ClassVar[tuple[str, ...]]

    @abstractmethod
    def _make(self) -> None:
        """Set these parts."""

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in self._made}

    def __setstate__(self, state: dict[str, Any]) -> None:
        set_fields(self, **state)
        self._make()
