"""Which compiled form of the tick a controller gets. Numba is loaded only when one is asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from ..dynamics import ArmModel
from ..exceptions import UnsupportedJointError
from ..impedance import TargetFilter
from ..limits import Limits
from ..super_twisting import SuperTwisting
from ..surfaces import Surface
from ..telemetry import ControllerOutput, ControllerState
from ..trajectories import Reference
from . import is_available, say_once

Answer: TypeAlias = tuple[ControllerOutput, ControllerState] | None
"""Output and next state; None where an input is not sound."""

Step: TypeAlias = Callable[[ControllerState, Any, Any, Reference, Any], Answer]
"""A tick: state, q, v, reference, tau_ext -> answer. `TypeError` where an input is not a plain vector of float64."""


def compiled_step(
    arm: ArmModel,
    impedance_filter: TargetFilter,
    surface: Surface,
    reaching: SuperTwisting,
    dt: float,
    *,
    knowledge: str,
    limits: Limits | None,
) -> Step | None:
    """Return the fastest compiled tick that there is for a controller, None where there is none.

    All of it is compiled where the tables carry the arm, all but RNEA where they do not, and nothing without a working
    Numba or for a surface or reaching law of the user's own. What is less than all is logged, once.

    Args:
        arm: The controller's arm.
        impedance_filter: Its filter; one that is not linear is called as it is.
        surface: Its surface.
        reaching: Its reaching law.
        dt: Its period [s].
        knowledge: "full" or "mass".
        limits: Torque limits, or None.

    Raises:
        ModelError: The compiled dynamics of the arm are not Pinocchio's.
    """
    if not is_available():
        return None
    from .controller import CompiledTick, FusedTick  # noqa: PLC0415 (Numba is loaded when needed)
    from .pack import can_pack, pack_law  # noqa: PLC0415

    if not can_pack(surface, reaching):
        names = f"{type(surface).__name__} with {type(reaching).__name__}"
        say_once(f"there is no compiled form of {names}: NumPy computes it, more slowly")
        return None
    law = pack_law(arm.nv, dt, impedance_filter, surface, reaching, limits, knowledge)
    try:
        return CompiledTick(arm, law, impedance_filter).step
    except UnsupportedJointError as error:
        say_once(
            f"the dynamics of '{arm.name}' are left to Pinocchio, the law is compiled: {error}"
        )
        return FusedTick(arm, law, impedance_filter).step
