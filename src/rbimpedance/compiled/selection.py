"""Which compiled form of the tick a controller gets. Numba is loaded only when one is asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeAlias

from .._arrays import Array
from ..dynamics import ArmModel
from ..exceptions import UnsupportedJointError
from ..impedance import TargetFilter
from ..limits import Limits
from ..super_twisting import SuperTwisting
from ..surfaces import Surface
from ..telemetry import ControllerState
from ..trajectories import Reference
from . import is_available, say_once

Step: TypeAlias = Callable[[Any, Any, Any, Any, Reference, Any], Any]
"""A tick: what it carries along, state, q, v, reference, tau_ext -> output and next state, None where an input is not
sound. `TypeError` where one is not a plain vector of float64, or the state of a tick."""


class Tick(Protocol):
    """A compiled tick.

    Attributes:
        step: The tick, and what it carries along.
    """

    step: tuple[Step, Any]

    def init(self) -> ControllerState:
        """Return the state before the first tick."""

    def pack(self, state: ControllerState) -> ControllerState:
        """Return a state in the form that `step` takes."""

    def block(self, state: ControllerState) -> Array:
        """Return a state in the form that a `ticker` takes, and writes to."""

    def state(self, block: Array) -> ControllerState:
        """Return the state that is in such a block."""

    def ticker(self, tau: Array) -> tuple[Step, Any]:
        """Return the tick that writes to tau, and the next state over the one before, and answers True."""


def compiled_tick(
    arm: ArmModel,
    impedance_filter: TargetFilter,
    surface: Surface,
    reaching: SuperTwisting,
    dt: float,
    *,
    knowledge: str,
    limits: Limits | None,
    backend: str,
) -> Tick | None:
    """Return the compiled tick of a controller, None where there is none.

    With "pinocchio" all is compiled but Pinocchio's own algorithms; with "compiled" those too, where the tables carry
    the arm. Nothing is without a working Numba, or for a surface or reaching law of the user's own. What is less than
    was asked for is logged, once.

    Args:
        arm: The controller's arm.
        impedance_filter: Its filter; one that is not linear is called as it is.
        surface: Its surface.
        reaching: Its reaching law.
        dt: Its period [s].
        knowledge: "full" or "mass".
        limits: Limits of the torque, or None.
        backend: "pinocchio" or "compiled".

    Raises:
        ModelError: The compiled dynamics of the arm are not Pinocchio's.
    """
    if not is_available(backend):
        return None
    from .controller import CompiledTick, FusedTick  # noqa: PLC0415 (Numba is loaded when needed)
    from .pack import can_pack, pack_law  # noqa: PLC0415

    if not can_pack(surface, reaching):
        names = f"{type(surface).__name__} with {type(reaching).__name__}"
        say_once(f"there is no compiled form of {names}: NumPy computes it, more slowly")
        return None
    law = pack_law(arm.nv, dt, impedance_filter, surface, reaching, limits, knowledge)
    if backend == "compiled":
        try:
            return CompiledTick(arm, law, impedance_filter)
        except UnsupportedJointError as error:
            say_once(
                f"the dynamics of '{arm.name}' are left to Pinocchio, the law is compiled: {error}"
            )
    return FusedTick(arm, law, impedance_filter)
