"""Compile ahead: whether compiled code works here, and which kernels a backend needs."""

from __future__ import annotations

import functools

from ..._numba.notices import say_once


@functools.cache
def is_available(backend: str = "pinocchio") -> bool:
    """Whether a backend can be compiled here; where it cannot, the logger "rbimpedance" says why, once.

    What it needs is compiled at the first call, or loaded from the disk.

    Args:
        backend: "pinocchio" or "compiled"; "rollout" for a closed loop, but the loop itself.
    """
    try:
        _compile(backend)
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


def _compile(backend: str) -> None:
    from ..._numba.self_check import check_borrowing  # noqa: PLC0415 (Numba is loaded when needed)
    from ...robot.compiled import dynamics  # noqa: PLC0415
    from . import entry  # noqa: PLC0415

    check_borrowing()
    if backend == "pinocchio":
        entry.before_kernel()
        entry.after_kernel()
        return
    dynamics.kernels()
    if backend == "compiled":
        entry.whole_kernel()
