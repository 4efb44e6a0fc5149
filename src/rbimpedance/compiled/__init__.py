"""The same tick and the same dynamics as Numba kernels.

The NumPy form of the controller stays the specification, Pinocchio the judge. Numba is loaded when a controller asks
for compiled code, not when the package is imported; where it does not work, that is said once and NumPy does the work.
"""

from __future__ import annotations

import functools
import logging


@functools.cache
def is_available(backend: str = "pinocchio") -> bool:
    """Whether a backend can be compiled here; where it cannot, the logger "rbimpedance" says why, once.

    What it needs is compiled at the first call, or loaded from the disk.

    Args:
        backend: "pinocchio" or "compiled".
    """
    try:
        from .probe import check_borrowing  # noqa: PLC0415 (Numba is loaded when needed)
        from .warmth import compile_backend  # noqa: PLC0415

        check_borrowing()
        compile_backend(backend)
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        say_once(f"compiled code is not available ({reason}): NumPy computes the same, more slowly")
        return False
    return True


def warm_up() -> bool:
    """Compile both backends ahead of the first controller, or load them from the disk.

    The first call on a machine takes up to a minute, later ones a second. To have only the default backend compiled,
    make a controller.

    Returns:
        Whether compiled code works here.
    """
    return is_available("pinocchio") and is_available("compiled")


@functools.cache
def say_once(sentence: str) -> None:
    """Log a warning, unless the same has been logged before."""
    logging.getLogger("rbimpedance").warning(sentence)
