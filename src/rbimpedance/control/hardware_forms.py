"""The compiled form of a `HardwareController`'s tick, where there is one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from .._common.arrays import Array
from .._numba import warn_once
from ..exceptions import UnsupportedJointError
from .backends import is_available
from .hardware_state import HardwareState
from .protocol import Measured
from .telemetry import ControllerOutput, flags


class HardwareForm(Protocol):
    """A form of the tick that may answer None.

    Attributes:
        tables: The controller as tables.
    """

    tables: Any

    def step(
        self, state: HardwareState, given: Measured
    ) -> tuple[ControllerOutput, HardwareState] | None:
        """Return output and next state; None where the readable form is to be asked."""


def hardware_form(controller: Any) -> HardwareForm | None:
    """Return the compiled form of a controller; None where it has none, which is logged, once.

    Args:
        controller: A `HardwareController`.
    """
    if not is_available("compiled"):
        return None
    from ..robot.compiled.dynamics import CompiledDynamics  # noqa: PLC0415 (Numba is loaded when needed)
    from .compiled.hardware_tick import hardware_tables  # noqa: PLC0415

    arm = controller.arm
    try:
        tables = hardware_tables(controller, CompiledDynamics(arm).tables)
    except UnsupportedJointError as error:
        warn_once(f"the dynamics of '{arm.name}' are left to Pinocchio and NumPy: {error}")
        return None
    if tables is None:
        warn_once(f"no compiled form of {type(controller.impedance).__name__} between joints")
        return None
    return _CompiledForm(tables, arm.nq, arm.nv)


class _CompiledForm:
    """One kernel; threads may share it."""

    def __init__(self, tables: Any, nq: int, nv: int) -> None:
        from .compiled.hardware_tick import hardware_kernel  # noqa: PLC0415 (Numba is loaded when needed)

        self.tables, self._sizes = tables, (nq, nv)
        self._kernel: Callable[..., int] = hardware_kernel()
        self._free: list[Any] = []

    def step(
        self, state: HardwareState, given: Measured
    ) -> tuple[ControllerOutput, HardwareState] | None:
        """See `HardwareForm.step`."""
        from .compiled.hardware_tick import SENT  # noqa: PLC0415

        ticks, q_hat, rows, pending = state
        own = q_hat.copy(), rows.copy(), pending.copy()
        nq, nv = self._sizes
        out, q_r = np.empty((9, nv)), np.empty(nq)
        words = self._words()
        try:
            ending = self._kernel(words, ticks, *given, *own, out, q_r)
        finally:
            self._free.append(words)
        if ending != SENT:
            return None
        return _output(out, q_r), HardwareState(ticks + 1, *own)

    def _words(self) -> Any:
        try:
            return self._free.pop()
        except IndexError:
            from .._numba.layouts.tables import hold  # noqa: PLC0415
            from .compiled.hardware_tick import HardwareWords, tick_space  # noqa: PLC0415

            return hold(HardwareWords(self.tables, tick_space(*self._sizes)))


def _output(out: Array, q_r: Array) -> ControllerOutput:
    tau, v_r, a_r, e1, e2, s, u, q_e, v_e = out
    nv = len(tau)
    return ControllerOutput(
        *(tau, q_r, v_r, a_r, e1, e2, s, u, q_e, v_e),
        premise_holds=np.zeros(nv, dtype=np.bool_),
        **flags(nv),
    )
