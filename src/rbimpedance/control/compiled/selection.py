"""Which compiled form of the tick a controller gets. Numba is loaded only when one is asked for."""

from __future__ import annotations

from ..._numba.notices import say_once
from ...exceptions import UnsupportedJointError
from ...law.impedance import TargetFilter
from ...law.limits import Limits
from ...law.super_twisting import SuperTwisting
from ...law.surfaces import Surface
from ...robot.arm_model import ArmModel
from ..protocol import Tick
from .warm_up import is_available


def compiled_tick(
    arm: ArmModel,
    impedance_filter: TargetFilter,
    surface: Surface,
    reaching: SuperTwisting,
    dt: float,
    *,
    model: str,
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
        model: "full" or "inertia".
        limits: Limits of the torque, or None.
        backend: "pinocchio" or "compiled".

    Raises:
        ModelError: The compiled dynamics of the arm are not Pinocchio's.
    """
    if not is_available(backend):
        return None
    from .pack import can_pack, pack_law  # noqa: PLC0415
    from .ticks import CompiledTick, FusedTick  # noqa: PLC0415 (Numba is loaded when needed)

    if not can_pack(surface, reaching):
        names = f"{type(surface).__name__} with {type(reaching).__name__}"
        say_once(f"there is no compiled form of {names}: NumPy computes it, more slowly")
        return None
    law = pack_law(arm.nv, dt, impedance_filter, surface, reaching, limits, model)
    if backend == "compiled":
        try:
            return CompiledTick(arm, law, impedance_filter)
        except UnsupportedJointError as error:
            say_once(
                f"the dynamics of '{arm.name}' are left to Pinocchio, the law is compiled: {error}"
            )
    return FusedTick(arm, law, impedance_filter)
