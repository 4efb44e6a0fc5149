"""Who computes a tick: the form of each `backend`. Numba is loaded only when it is needed."""

from __future__ import annotations

import functools
from typing import get_args

from .._common.arrays import choice
from .._numba import warn_once
from ..exceptions import UnsupportedJointError
from .cartesian_base import ToolForm
from .cartesian_tick import CartesianLaw
from .protocol import Backend
from .tick import ControlLaw, NumpyTick, TickForm


def tick_form(backend: Backend, law: ControlLaw) -> TickForm:
    """Return the form of the tick that a backend stands for.

    "numpy" is the specification. With "pinocchio" all is compiled but Pinocchio's own algorithms; with "compiled" those
    too, where the tables can describe the arm. Without a working Numba, and for a surface or reaching law of the user's
    own, NumPy computes the tick. A lesser form than requested is logged, once.

    Args:
        backend: The backend.
        law: The controller's law; a filter that is not linear is called as it is.

    Raises:
        ParameterError: An unknown backend.
        ModelError: The compiled dynamics of the arm are not Pinocchio's.
    """
    choice("backend", backend, get_args(Backend))
    if backend == "numpy" or not is_available(backend):
        return NumpyTick(law)
    from .compiled.forms import CompiledTick, PinocchioTick  # noqa: PLC0415 (Numba is loaded when needed)
    from .compiled.pack import can_pack  # noqa: PLC0415

    if not can_pack(law.surface, law.reaching):
        names = f"{type(law.surface).__name__} with {type(law.reaching).__name__}"
        warn_once(f"there is no compiled form of {names}: NumPy computes it, more slowly")
        return NumpyTick(law)
    if backend == "compiled":
        try:
            return CompiledTick(law)
        except UnsupportedJointError as error:
            name = law.arm.name
            warn_once(
                f"the dynamics of '{name}' are left to Pinocchio, the law is compiled: {error}"
            )
    return PinocchioTick(law)


def tool_form(backend: Backend, law: CartesianLaw) -> ToolForm | None:
    """Return the form of the tick at the tool that a backend stands for; None for `cartesian_tick` itself.

    "pinocchio" leaves the RNEA to Pinocchio and compiles all else, the motion of the frame included. As for the joints,
    NumPy does what cannot be compiled.

    Args:
        backend: The backend.
        law: The controller's law.

    Raises:
        ParameterError: An unknown backend.
        ModelError: The compiled motion or dynamics of the arm are not Pinocchio's.
    """
    choice("backend", backend, get_args(Backend))
    if backend == "numpy" or not is_available(f"{backend} tool"):
        return None
    from .compiled.tool_forms import CompiledToolTick, PinocchioToolTick  # noqa: PLC0415 (Numba is loaded when needed)
    from .compiled.tool_tables import can_pack_tool  # noqa: PLC0415

    if not can_pack_tool(law):
        warn_once(
            "there is no compiled form of a part at the tool: NumPy computes the tick, more slowly"
        )
        return None
    try:
        return CompiledToolTick(law) if backend == "compiled" else PinocchioToolTick(law)
    except UnsupportedJointError as error:
        name = law.arm.name
        warn_once(
            f"there is no compiled motion of '{name}': NumPy computes the tick, more slowly: {error}"
        )
        return None


@functools.cache
def is_available(backend: str = "pinocchio") -> bool:
    """Whether a backend can be compiled here; where it cannot, the logger "rbimpedance" says why, once.

    What it needs is compiled at the first call, or loaded from the disk.

    Args:
        backend: "pinocchio" or "compiled"; "rollout" for what a compiled closed loop needs but the loop itself;
            "pinocchio tool" or "compiled tool" for the tick of a `CartesianController`.
    """
    try:
        _compile(backend)
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        warn_once(
            f"compiled code is not available ({reason}): NumPy computes the same, more slowly"
        )
        return False
    return True


def warm_up() -> bool:
    """Compile both compiled backends ahead of the first controller, or load them from the disk.

    The first call on a machine takes up to a minute, later ones a second. To have only the default backend compiled,
    make a controller.

    Returns:
        Whether compiled code works here.
    """
    return is_available("pinocchio") and is_available("compiled")


def _compile(backend: str) -> None:
    from .._numba.layouts.check import check_layouts  # noqa: PLC0415 (Numba is loaded when needed)
    from ..robot.compiled import dynamics  # noqa: PLC0415
    from .compiled import tick  # noqa: PLC0415

    check_layouts()
    if backend.endswith(" tool"):
        from .compiled import tool_forms  # noqa: PLC0415

        tool_forms.compile_tick(whole=backend == "compiled tool")
        return
    if backend == "pinocchio":
        tick.before_kernel()
        tick.after_kernel()
        return
    dynamics.kernels()
    if backend == "compiled":
        tick.whole_kernel()
