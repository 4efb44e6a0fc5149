"""The forms of a `HardwareController`'s tick: compiled, where that can be, and by the readable one."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._common.arrays import Array
from .._common.pool import Pool
from .._numba import warn_once
from ..exceptions import UnsupportedJointError
from .backends import is_available
from .hardware_state import HardwareState
from .protocol import Measured
from .telemetry import ControllerOutput, flags

OUT_ROWS = 9
"""What a compiled tick puts out for every joint: tau, v_r, a_r, e1, e2, s, u, q_e, v_e."""


class PlainForm:
    """No compiled tick: whoever asks is sent to the readable one.

    Attributes:
        tables: None.
    """

    tables: Any = None

    def step(self, state: HardwareState, given: Measured) -> Any:
        """Return None: the readable tick is to be asked."""
        del state, given

    def memory(self, state: HardwareState) -> Any:
        """Return a state in the form that the tick of `in_place` takes."""
        return state

    def state(self, memory: Any) -> HardwareState:
        """Return the state that is in such a memory."""
        state: HardwareState = memory
        return state

    def in_place(self, tau: Array) -> tuple[Any, Any]:
        """Return the tick of a `RealtimeController`, and its own first argument."""
        del tau
        return lambda *_: None, None


def hardware_form(controller: Any) -> PlainForm:
    """Return the compiled form of a controller; a plain one where it has none, which is logged, once.

    Args:
        controller: A `HardwareController`.
    """
    if not is_available("compiled"):
        return PlainForm()
    from ..robot.compiled.dynamics import CompiledDynamics  # noqa: PLC0415 (Numba is loaded when needed)
    from .compiled.hardware_tables import hardware_tables  # noqa: PLC0415

    arm = controller.arm
    try:
        own, load = (CompiledDynamics(each).tables for each in (arm, controller.load))
        tables = hardware_tables(controller, own, load)
    except UnsupportedJointError as error:
        warn_once(f"the dynamics of '{arm.name}' are left to Pinocchio and NumPy: {error}")
        return PlainForm()
    if tables is None:
        warn_once(f"no compiled form of {type(controller.impedance).__name__} between joints")
        return PlainForm()
    return CompiledForm(tables, arm.nq, arm.nv)


class CompiledForm(PlainForm):
    """One kernel; threads may share it.

    Attributes:
        tables: The controller as tables.

    Args:
        tables: The same.
        nq: Entries of a configuration.
        nv: Joints.
    """

    def __init__(self, tables: Any, nq: int, nv: int) -> None:
        from .compiled.hardware_kernels import SENT, hardware_kernel  # noqa: PLC0415 (Numba is loaded when needed)

        self.tables, self._nq, self._nv, self._sent = tables, nq, nv, SENT
        self._kernel = hardware_kernel()
        self._free = Pool(self._words)

    def step(self, state: HardwareState, given: Measured) -> Any:
        """Return output and next state; None where the readable tick is to be asked."""
        ticks, *before = state
        after = np.empty(self._nq), np.empty_like(state.rows), np.empty_like(state.pending)
        out, q_r = np.empty((OUT_ROWS, self._nv)), np.empty(self._nq)
        words = self._free.take()
        try:
            ending = self._kernel(words, ticks, *given, *before, *after, out, q_r)
        finally:
            self._free.append(words)
        return (
            (_output(out, q_r), HardwareState(ticks + 1, *after)) if ending == self._sent else None
        )

    def memory(self, state: HardwareState) -> Any:
        """Return a state in the form that the tick of `in_place` takes."""
        return [state]

    def state(self, memory: Any) -> HardwareState:
        """Return the state that is in such a memory, or that the tick of `in_place` has made of it."""
        if len(memory) == 1:
            state: HardwareState = memory[0]
            return state
        ticks, places, i = memory
        return HardwareState(ticks, *(part.copy() for part in places[i]))

    def in_place(self, tau: Array) -> tuple[Any, Any]:
        """Return a tick that writes its torque to tau and goes back and forth between two places for the state."""
        from .compiled.hardware_kernels import realtime_kernel  # noqa: PLC0415 (Numba is loaded when needed)

        kernel, sent = realtime_kernel(), self._sent

        def tick(prepared: Any, memory: Any, q: Any, v: Any, reference: Any, tau_ext: Any) -> Any:
            if len(memory) == 1:
                prepared[:], memory[:] = self._places(memory[0], tau)
            ticks, _, i = memory
            if kernel(prepared[i], ticks, q, v, reference, tau_ext) != sent:
                return None
            memory[0], memory[2] = ticks + 1, 1 - i
            return True

        return tick, []

    def _places(self, state: HardwareState, tau: Array) -> tuple[list[Any], list[Any]]:
        """What the kernel is given at even and at odd ticks; ticks so far, the two places, and which has the state."""
        from .._numba.layouts.tables import hold  # noqa: PLC0415 (Numba is loaded when needed)
        from .compiled import hardware_kernels as at  # noqa: PLC0415
        from .compiled.hardware_tables import TickMemory, tick_output, tick_space  # noqa: PLC0415

        ticks, *parts = state
        one, other = (TickMemory(*(np.array(part) for part in parts)) for _ in range(2))
        space = tick_space(self._nq, self._nv)
        out = tick_output(self._nq, self._nv)
        words = [
            hold(at.RealtimeWords(self.tables, space, before, after, out, tau))
            for before, after in ((one, other), (other, one))
        ]
        return words, [ticks, (one, other), 0]

    def _words(self) -> Any:
        from .._numba.layouts.tables import hold  # noqa: PLC0415 (Numba is loaded when needed)
        from .compiled.hardware_kernels import HardwareWords  # noqa: PLC0415
        from .compiled.hardware_tables import tick_space  # noqa: PLC0415

        return hold(HardwareWords(self.tables, tick_space(self._nq, self._nv)))


def _output(out: Array, q_r: Array) -> ControllerOutput:
    tau, v_r, a_r, e1, e2, s, u, q_e, v_e = out
    nv = len(tau)
    return ControllerOutput(
        *(tau, q_r, v_r, a_r, e1, e2, s, u, q_e, v_e),
        premise_holds=np.zeros(nv, dtype=np.bool_),
        **flags(nv),
    )
