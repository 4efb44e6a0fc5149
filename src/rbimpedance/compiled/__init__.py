"""The same tick and the same dynamics as Numba kernels.

The NumPy form of the controller stays the specification, Pinocchio the judge. Numba is loaded when a controller asks
for compiled code, not when the package is imported; where it does not work, that is said once and NumPy does the work.
"""

from __future__ import annotations

import functools
import logging


@functools.cache
def is_available() -> bool:
    """Whether compiled code works here; where it does not, the logger "rbimpedance" says why, once."""
    try:
        from .controller import kernels as _tick  # noqa: PLC0415 (Numba is loaded when needed)
        from .dynamics import kernels as _dynamics  # noqa: PLC0415
        from .probe import check_borrowing  # noqa: PLC0415

        check_borrowing()
        _tick()
        _dynamics()
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        say_once(f"compiled code is not available ({reason}): NumPy computes the same, more slowly")
        return False
    return True


def warm_up() -> bool:
    """Compile everything ahead of the first tick, or load it from the disk, where the first run has left it.

    The first call on a machine takes tens of seconds, later ones a fraction of one.

    Returns:
        Whether compiled code works here.
    """
    return is_available()


@functools.cache
def say_once(sentence: str) -> None:
    """Log a warning, unless the same has been logged before."""
    logging.getLogger("rbimpedance").warning(sentence)
