"""An energy tank: it keeps the impedance port passive while gains change, or while tau_ext is wrong.

The environment meets the arm at the port (tau_ext, v_e), v_e being how the impedance filter moves the reference. With
constant gains and the true torque the filter is passive: V = ½ v_eᵀM_d v_e + ½ q_eᵀK_d q_e grows by no more than the
work tau_extᵀv_e. A spring that is stiffened while it is stretched adds energy to V from no physical source, and so
does a wrongly measured torque.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..._common.arrays import Array, number, positive_number, vector
from ..._common.brief import brief_repr
from ..._common.frozen import set_fields
from ...exceptions import ParameterError
from ...interaction import Sensor
from ...law.cartesian_impedance import CartesianImpedance
from ...law.impedance import Impedance, ImpedanceMatrices, TargetFilter
from ...law.poses import check_cartesian_reference
from ..cartesian import CartesianController
from ..controller import ControllerOutput, ImpedanceController
from ..protocol import Measured
from ..tool_view import in_joints
from ..wrapper import ControllerWrapper, of_joints


class TankState(NamedTuple):
    """What an `EnergyTank` remembers.

    Attributes:
        inner: State of the controller.
        observer: State of the observer; None without one.
        energy: What is in the tank [J]; negative for a while only where the filter was moved from outside.
        q_e: Position of the impedance filter when the tick was done, shape (nv,) [rad or m], or (6,) at the tool.
        v_e: Its velocity, of the same shape [rad/s or m/s].
        matrices: M_d, D_d and K_d that are in use, each of shape (nv, nv), or (6, 6).
        tau: Motor torque of the tick before, shape (nv,) [N·m or N].
        port: Work of the environment at the port so far, as far as it was observed [J].
        share: Share of the measured tau_ext that was replaced by the observed one in the tick before, from 0 to 1.
    """

    inner: Any
    observer: Any
    energy: float
    q_e: Array
    v_e: Array
    matrices: ImpedanceMatrices
    tau: Array
    port: float
    share: float


@brief_repr("capacity", "start", "refill", "observer", "controller")
@dataclass(frozen=True, eq=False, init=False)
class EnergyTank(ControllerWrapper[TankState, ControllerOutput]):
    """A controller whose impedance gives out no more energy than it was given, plus what is in a tank.

    The tank T starts with `start` and never holds more than `capacity`. In every period

        T⁺ = T + (tau_obs - tau)ᵀΔq_e + η·D - ΔV,

    with tau_obs the observed torque of the environment, tau the one that the filter is given, Δq_e its step, D ≥ 0
    what its damper takes in (all exact for the discrete filter, and counted for late ticks,
    too), η the share of it that refills the tank, and ΔV what
    a change of the gains adds to V. Two valves keep T ≥ 0:

    - a change of gains goes only so far as T pays for ΔV, along the straight line from the gains in use to the wanted
      ones; the rest follows as the damper fills the tank;
    - the filter's input is (1 - α)·measured + α·observed, with the least α in [0, 1] that T pays for. At α = 1 nothing
      is to be paid: a sensor of the wrong sign, or with a bias, is replaced by the observer once it has emptied the
      tank.

    So V + T never grows by more than tau_obsᵀΔq_e, and whatever happens to the gains and to tau_ext, the port gives out
    at most V + T of the start. Without an observer the measured torque is assumed true and only gains are limited. An
    observer that knows the motors' torque, such as `MomentumObserver`, does not know what the model lacks from contact:
    the port is passive for both together.

    To change the gains, use `with_impedance`, as with the controller itself.

    Around a `CartesianController` the port is that of the tool: q_e and v_e are its displacement ξ and rate, of six
    numbers, and the torques are wrenches, pulled back as its target does. tau_ext stays a torque of the joints.

    Attributes:
        controller: An `ImpedanceController` with a linear target, or a `CartesianController`.
        observer: Observes tau_ext from motion and motor torque; None: the measured tau_ext is assumed true.
        capacity: Most that the tank holds [J].
        start: What it holds at first [J].
        refill: η, from 0 to 1.

    Raises:
        ParameterError: A target that is not an `Impedance`, or a number outside its range.

    References:
        F. Ferraguti, C. Secchi, C. Fantuzzi, A tank-based approach to impedance control with variable stiffness,
        ICRA 2013. B. Hannaford, J.-H. Ryu, Time-domain passivity control of haptic interfaces, IEEE Transactions on
        Robotics and Automation 18, 2002.
    """

    controller: Any
    observer: Sensor[Any] | None
    capacity: float
    start: float
    refill: float
    _port: _Port

    def __init__(
        self,
        controller: ImpedanceController | CartesianController,
        *,
        observer: Sensor[Any] | None = None,
        capacity: float = 1.0,
        start: float | None = None,
        refill: float = 0.9,
    ) -> None:
        is_at_tool = isinstance(controller, CartesianController)
        if not is_at_tool and not isinstance(of_joints(controller).impedance, Impedance):
            raise ParameterError("controller.impedance", controller.impedance, "an Impedance")
        capacity = positive_number("capacity", capacity, "energy in J")
        start = capacity / 2.0 if start is None else number("start", start, *_up_to(capacity))
        refill = number("refill", refill, *_up_to(1.0))
        set_fields(
            self,
            controller=in_joints(controller),
            observer=observer,
            capacity=capacity,
            start=start,
            refill=refill,
            _port=_ToolPort(controller) if is_at_tool else _Port(controller),
        )

    def with_impedance(self, impedance: Impedance | CartesianImpedance) -> EnergyTank:
        """Return the same tank with another wanted target; a run continues with its present state.

        Args:
            impedance: The target to go to.

        Raises:
            ParameterError: It is not an `Impedance`, or at the tool a `CartesianImpedance` with the same axes.
            DimensionError: It is for another number of joints.
        """
        axes = getattr(self.impedance, "axes", None)
        if not np.array_equal(getattr(impedance, "axes", None), axes):  # type: ignore[arg-type]
            raise ParameterError("impedance", impedance, "a target of the same kind and axes")
        return EnergyTank(
            self._port.controller.with_impedance(impedance),
            observer=self.observer,
            capacity=self.capacity,
            start=self.start,
            refill=self.refill,
        )

    def init(self) -> TankState:
        """Return the state before the first tick."""
        rest = np.zeros(len(self._port.wanted.M_d))
        return TankState(
            inner=self.controller.init(),
            observer=None if self.observer is None else self.observer.init(),
            energy=self.start,
            q_e=rest,
            v_e=rest,
            matrices=self._port.wanted,
            tau=np.zeros(self.arm.nv),
            port=0.0,
            share=0.0,
        )

    def _step(self, state: TankState, given: Measured) -> tuple[ControllerOutput, TankState]:
        q, v = self.arm.check_configuration("q", given.q), vector("v", given.v, self.arm.nv)
        told = vector("tau_ext", given.tau_ext, self.arm.nv)
        observed, observer = told, None
        if self.observer is not None:
            observed, observer = self.observer.step(state.observer, q, v, state.tau, told)
        state = self._with_paid_gains(state)
        controller, target = self._port.with_gains(state.matrices)
        forces = [self._port.force(state.inner, q, x, given.reference) for x in (told, observed)]
        share = self._share(target, state, *forces)
        filtered = told + share * (observed - told)
        output, inner = controller.step(state.inner, q, v, given.reference, filtered)
        following = state._replace(inner=inner, observer=observer, tau=output.tau, share=share)
        force = forces[0] + share * (forces[1] - forces[0])
        return output, self._balanced(state, following, force, forces[1])

    def _elapsed(self, state: TankState, period: float) -> TankState:
        controller, _ = self._port.with_gains(state.matrices)
        return state._replace(inner=controller.elapsed(state.inner, period))

    def _share(self, target: TargetFilter, state: TankState, told: Array, observed: Array) -> float:
        """The least α with T + (1 - α)·(p + α·g) ≥ 0.

        p = dᵀΔq_e is the work of the difference d = observed - measured, and g = dᵀ(∂Δq_e/∂tau)d.
        """
        d = observed - told
        if not d.any():
            return 0.0
        q_e, v_e = self._port.filtered(state.inner)
        at_told, _ = target.advance(q_e, v_e, told)
        at_observed, _ = target.advance(q_e, v_e, observed)
        p, g = float(d @ (at_told - state.q_e)), float(d @ (at_observed - at_told))
        missing = state.energy + p
        if missing >= 0.0:
            return 0.0
        b = g - p
        root = float(np.sqrt(max(b**2 + 4.0 * g * missing, 0.0)))
        return min(-2.0 * missing / (b + root), 1.0) if b + root > 0.0 else 1.0

    def _with_paid_gains(self, state: TankState) -> TankState:
        """Go from the gains in use to the wanted ones as far as the tank pays for it."""
        wanted = self._port.wanted
        if all(map(np.array_equal, state.matrices, wanted)):
            return state
        price = _stored(state._replace(matrices=wanted)) - _stored(state)
        if price > state.energy:
            way = max(state.energy, 0.0) / price
            pairs = zip(state.matrices, wanted, strict=True)
            wanted = ImpedanceMatrices(*(a + way * (b - a) for a, b in pairs))
            price = _stored(state._replace(matrices=wanted)) - _stored(state)
        return state._replace(matrices=wanted, energy=min(state.energy - price, self.capacity))

    def _balanced(
        self, before: TankState, state: TankState, given: Array, observed: Array
    ) -> TankState:
        """The state after a tick, with its energies counted."""
        q_e, v_e = self._port.filtered(state.inner)
        state = state._replace(q_e=np.array(q_e), v_e=np.array(v_e))
        moved = state.q_e - before.q_e
        lost = float(given @ moved) - (_stored(state) - _stored(before))
        kept = self.refill * lost if lost > 0.0 else lost
        energy = before.energy + float((observed - given) @ moved) + kept
        port = before.port + float(observed @ moved)
        return state._replace(energy=min(energy, self.capacity), port=port)


class _Port:
    """The target of the joints, with the gains in use; the last ones are remembered.

    Attributes:
        controller: The controller as it was given.
        wanted: Its M_d, D_d and K_d.
    """

    def __init__(self, controller: Any) -> None:
        self.controller = controller
        self.wanted = self._matrices()
        self._first = self._parts(controller)
        self._last: tuple[ImpedanceMatrices, tuple[Any, TargetFilter]] | None = None

    def with_gains(self, matrices: ImpedanceMatrices) -> tuple[Any, TargetFilter]:
        """Return controller and filter for some gains."""
        if all(map(np.array_equal, matrices, self.wanted)):
            return self._first
        if self._last is None or not all(map(np.array_equal, matrices, self._last[0])):
            changed = self.controller.with_impedance(self._impedance(matrices))
            self._last = matrices, self._parts(changed)
        return self._last[1]

    def filtered(self, inner: Any) -> tuple[Array, Array]:
        """Return position and velocity of the filter."""
        return inner.q_e, inner.v_e

    def force(self, inner: Any, q: Array, torque: Array, reference: Any) -> Array:
        """Return what the filter is given for a torque of the environment."""
        del inner, q, reference
        return torque

    def _matrices(self) -> ImpedanceMatrices:
        matrices: ImpedanceMatrices = self.controller.impedance.matrices(self.controller.arm.nv)
        return matrices

    def _impedance(self, matrices: ImpedanceMatrices) -> Any:
        return Impedance(*matrices)

    def _parts(self, controller: Any) -> tuple[Any, TargetFilter]:
        return controller, controller.impedance.filter(controller.arm.nv, controller.dt)


class _ToolPort(_Port):
    """The target at a frame, in its compliance axes."""

    def __init__(self, controller: Any) -> None:
        super().__init__(controller)
        self._target = controller.impedance.filter(controller.dt)

    def filtered(self, inner: Any) -> tuple[Array, Array]:
        xi, rate = inner.displacement
        return xi, rate

    def force(self, inner: Any, q: Array, torque: Array, reference: Any) -> Array:
        wrench = self.controller.wrench_from_torque(q, torque)
        desired = check_cartesian_reference(reference)
        pulled: Array = self._target.pulled_back(inner.displacement, desired, wrench)
        return pulled

    def _matrices(self) -> ImpedanceMatrices:
        matrices: ImpedanceMatrices = self.controller.impedance.linear.matrices(6)
        return matrices

    def _impedance(self, matrices: ImpedanceMatrices) -> Any:
        mass, damping, stiffness = matrices
        return CartesianImpedance(mass, stiffness, damping, axes=self.controller.impedance.axes)

    def _parts(self, controller: Any) -> tuple[Any, TargetFilter]:
        return in_joints(controller), controller.impedance.linear.filter(6, controller.dt)


def _stored(state: TankState) -> float:
    """V = ½ v_eᵀM_d v_e + ½ q_eᵀK_d q_e [J]."""
    (M_d, _, K_d), q_e, v_e = state.matrices, state.q_e, state.v_e
    return float(v_e @ M_d @ v_e + q_e @ K_d @ q_e) / 2.0


def _up_to(largest: float) -> tuple[str, Callable[[Array], Any]]:
    """What `number` asks of a number from 0 on."""
    return f"from 0 to {largest:g}", lambda x: (x >= 0.0) & (x <= largest)
