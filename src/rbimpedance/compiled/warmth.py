"""Which kernels a backend needs."""

from __future__ import annotations

from . import dynamics, entry


def compile_backend(backend: str) -> None:
    """Compile what every controller with a backend needs, or load it from the disk.

    Args:
        backend: "pinocchio" or "compiled"; "rollout" for a closed loop, but the loop itself.
    """
    if backend == "rollout":
        dynamics.kernels()
        return
    if backend == "compiled":
        dynamics.kernels()
        entry.whole_kernel()
        return
    entry.before_kernel()
    entry.after_kernel()
