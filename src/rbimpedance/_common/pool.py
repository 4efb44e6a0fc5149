"""Work spaces that calls of several threads at once do not share."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


class Pool(list[T]):
    """Free work spaces: take one, and append it again; in the end there is one for each thread that needed one at once.

    Args:
        make: Makes one.
    """

    def __init__(self, make: Callable[[], T]) -> None:
        super().__init__()
        self._make = make

    def take(self) -> T:
        """Return a free one, or a new one; two threads never get the same."""
        try:
            return self.pop()
        except IndexError:
            return self._make()
