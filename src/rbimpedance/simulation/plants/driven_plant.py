"""Links behind drives that lag, ripple and yield: torque dynamics, torque ripple, and two masses to a joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from ..._common.arrays import Array, BoolArray, choice, not_negative
from ..._common.brief import brief_repr
from ..._common.frozen import set_fields
from ...exceptions import ParameterError
from ...interaction import Interaction
from ...law.lag import lag_of, lagged
from ...robot.arm_model import ArmModel
from ...robot.hardware import EncoderSide as EncoderSide  # noqa: PLC0414 (part of this module's interface)
from ...robot.hardware import Hardware
from .compiled_drives import compiled_step
from .dry_friction import rub
from .elasticity import check_step, refuse_at, stiffness_of_joints, usual_damping, whole
from .protocol import Motion, Plant
from .rigid import RigidPlant
from .sticking import StickingPlant
from .torque_loop import LoopState, TorqueLoop


class GearFriction(NamedTuple):
    """Friction of the rotors of elastic joints; it sticks, see `StickingPlant`.

    Attributes:
        coulomb: Dry friction, shape (nv,) [N·m or N].
        viscous: Viscous friction, shape (nv,) [N·m·s/rad or N·s/m].
        stribeck: How much larger dry friction is at rest, relative.
    """

    coulomb: Array
    viscous: Array
    stribeck: float


class DrivenState(NamedTuple):
    """How links and rotors move, and what the motors give; arrays have shape (nv,).

    Attributes:
        links: State of the links.
        torque: Torque of the motors behind their lag [N·m or N].
        pending: Torques on their way to the motors, one for each step of the dead time, the oldest first.
        delta: How far the rotors are ahead of the links [rad or m].
        rotor_velocity: Of the rotors, on the joints' side of the gears [rad/s or m/s].
        loop: State of the inner torque loop, None where there is none.
    """

    links: Any
    torque: Array
    pending: Array
    delta: Array
    rotor_velocity: Array
    loop: LoopState | None


@brief_repr()
@dataclass(frozen=True, eq=False, init=False)
class DrivenPlant:
    """Links behind drives: motors whose torque lags and ripples, on rotors that turn the links through springs.

    Per joint, with everything reflected to the joint's side of the gear:

        T·d(tau_m)/dt = tau - tau_m,
        tau_a = tau_m·(1 + ripple·sin(n·θ)) + cogging·sin(n·θ),        B·θ̈ = tau_a - K·δ - D·δ̇,
        M a + bias = K·δ + D·δ̇ + tau_ext,        δ = θ (-) q,

    the flexible joint of Spong (1987): the rotors' kinetic energy is that of their own spin. The lag is stepped exactly
    for a held tau, the two masses by semi-implicit Euler, whose energy neither grows nor decays. With everything at
    its default a drive is perfect, and the plant is that of its links. The friction of the arm acts on the links, at
    the end of a step, and that of the gears on the rotors. A run begins with the drives holding the links against
    gravity. With a `TorqueLoop`, tau is what its feedback of the springs' torque starts from.

    Attributes:
        links: What is behind the drives: another plant; an `ArmModel` becomes a `RigidPlant`.
        time_constant: Of the torque, T, shape (nv,) [s].
        dead_time: From a torque that is sent to the motors' first answer, a whole number of steps [s].
        ripple: Amplitude of the torque's ripple relative to the torque, shape (nv,).
        cogging: Amplitude of the ripple that is there without torque, shape (nv,) [N·m or N].
        ripple_periods: Of both to a turn of the joint (to 2π m of a slide), whole numbers n, shape (nv,); 200, which
            is twice for every turn of a motor with a gear of 100:1, by default.
        stiffness: Of the spring in the joint, K, shape (nv,) [N·m/rad or N/m]; +inf where the joint is rigid.
        damping: Of that spring, D, shape (nv,) [N·m·s/rad or N·s/m]; by default 5 % of what is critical for the joint
            alone at `arm.neutral`.
        rotor_inertia: B, shape (nv,) [kg·m² or kg]; by default the arm's armature. Where a joint is elastic it is taken
            off the links, whose armature is 0 then; where it is rigid it stays on them.
        encoders: Whether they are on the rotor ("motor", as in most arms) or on the link. With a torque loop, whose
            sensor measures how far the springs are wound, those on the rotors give the links' position, too.
        gear_friction: Dry and viscous friction of the rotors of elastic joints, which sticks; None for none.
        torque_loop: Inner torque loop; None for none.

    Args:
        links: An arm, or a plant whose arm has armature 0 where a joint is elastic.
        time_constant: Scalar or (nv,), at least 0.
        dead_time: At least 0.
        ripple: Scalar or (nv,), at least 0.
        cogging: Scalar or (nv,), at least 0.
        ripple_periods: Scalar or (nv,).
        stiffness: Scalar or (nv,), positive.
        damping: Scalar or (nv,), at least 0.
        rotor_inertia: Scalar or (nv,), positive where a joint is elastic.
        encoders: "motor" or "link".
        gear_friction: A `GearFriction`, or None.
        torque_loop: A `TorqueLoop`, or None.

    Raises:
        ParameterError: A parameter outside of these sets; an elastic joint without a rotor, or with armature on a
            plant.
        DimensionError: One that is given for another number of joints.
    """

    links: Plant[Any]
    time_constant: Array
    dead_time: float
    ripple: Array
    cogging: Array
    ripple_periods: Array
    stiffness: Array
    damping: Array
    rotor_inertia: Array
    encoders: EncoderSide
    gear_friction: GearFriction | None
    torque_loop: TorqueLoop | None

    def __init__(
        self,
        links: ArmModel | Plant[Any],
        *,
        time_constant: ArrayLike = 0.0,
        dead_time: float = 0.0,
        ripple: ArrayLike = 0.0,
        cogging: ArrayLike = 0.0,
        ripple_periods: ArrayLike = 200,
        stiffness: ArrayLike = np.inf,
        damping: ArrayLike | None = None,
        rotor_inertia: ArrayLike | None = None,
        encoders: EncoderSide = "motor",
        gear_friction: GearFriction | None = None,
        torque_loop: TorqueLoop | None = None,
    ) -> None:
        if not isinstance(links, ArmModel | Plant):
            raise ParameterError("links", links, "an ArmModel or a Plant")
        arm = links if isinstance(links, ArmModel) else links.arm
        inertia = arm.armature if rotor_inertia is None else rotor_inertia
        set_fields(
            self,
            time_constant=not_negative("time_constant", time_constant, arm.nv),
            dead_time=float(not_negative("dead_time", dead_time, 1)[0]),
            ripple=not_negative("ripple", ripple, arm.nv),
            cogging=not_negative("cogging", cogging, arm.nv),
            ripple_periods=whole("ripple_periods", ripple_periods, arm.nv),
            stiffness=stiffness_of_joints(stiffness, arm.nv),
            rotor_inertia=not_negative("rotor_inertia", inertia, arm.nv),
            encoders=choice("encoders", encoders, get_args(EncoderSide)),
            gear_friction=gear_friction,
            torque_loop=torque_loop,
        )
        set_fields(self, links=self._behind_springs(links))
        usual = usual_damping(self.arm, self.stiffness, self.rotor_inertia)
        damping = usual if damping is None else damping
        set_fields(self, damping=not_negative("damping", damping, arm.nv))

    @classmethod
    def for_(cls, hardware: Hardware, arm: ArmModel | Plant[Any], dt: float = 1e-3) -> DrivenPlant:
        """Return the arm behind the drives of a description.

        Args:
            hardware: The description.
            arm: The links, with friction, which sticks, and the rotors as armature where the description has none. Or
                another engine with rigid joints, such as a `MujocoPlant`, whose rotors and friction are its own.
            dt: Control period, in which the delay is given [s].

        Raises:
            ParameterError: An elastic joint without a rotor; springs or other rotors for another engine.
            DimensionError: A number for another number of joints.
        """
        if not isinstance(arm, ArmModel):
            return cls(_rigid(arm, hardware), **_torques(hardware, dt))
        rotors, rubs = hardware.rotors(arm), bool(arm.coulomb.any() or arm.viscous.any())
        elastic = hardware.is_elastic
        free = arm.with_friction(0.0, 0.0) if elastic else arm
        links = free.with_armature(rotors)
        friction = GearFriction(arm.coulomb, arm.viscous, hardware.stribeck)
        senses = elastic and hardware.torque_sensor is not None
        return cls(
            StickingPlant(links, hardware.stribeck) if rubs and not elastic else links,
            **_torques(hardware, dt),
            stiffness=hardware.joint_stiffness,
            rotor_inertia=rotors,
            encoders=hardware.encoder_side,
            gear_friction=friction if rubs and elastic else None,
            torque_loop=TorqueLoop.for_(hardware, arm) if senses else None,
        )

    # --- a plant ------------------------------------------------------------------------------------------------

    @property
    def arm(self) -> ArmModel:
        """The links, without the rotors of elastic joints."""
        return self.links.arm

    @property
    def elastic(self) -> BoolArray:
        """Which joints have a spring, shape (nv,)."""
        return np.isfinite(self.stiffness)

    def begin(self, q: Array, v: Array, h: float) -> DrivenState:
        """Return the state at the start of a run: rotors and links as fast, springs and motors supporting the links.

        Raises:
            ParameterError: h is too long for the stiffest spring; names the joint, and how many times the substeps it
                needs. Or the dead time is no multiple of h.
        """
        check_step(self.arm, self.stiffness, self.damping, self.rotor_inertia, q, h)
        steps = round(self.dead_time / h)
        if abs(steps * h - self.dead_time) > 1e-9:
            raise ParameterError("dead_time", self.dead_time, f"a multiple of the step, {h:g} s")
        torque = self.arm.raw_dynamics.bias(q, np.zeros(self.arm.nv))
        links = self.links.begin(q, v, h)
        pending = np.tile(torque, (steps, 1))
        loop = None if self.torque_loop is None else self.torque_loop.init(torque)
        delta = torque / self.stiffness
        return DrivenState(links, torque, pending, delta, np.array(v), loop)

    def motion(self, state: DrivenState) -> Motion:
        """Return how the links move; see `Plant.motion`."""
        return self.links.motion(state.links)

    def measured(self, state: DrivenState) -> Motion:
        """Return how the rotors move, or the measurement of the links' plant if the encoders are on the links.

        With a torque loop the rotors' positions are given less what its sensor says that the springs are wound up.
        """
        if self.encoders == "link" or not self.elastic.any():
            return self.links.measured(state.links)
        q, _ = self.links.motion(state.links)
        ahead = state.delta
        if state.loop is not None:
            ahead = ahead - np.where(self.elastic, state.loop.measured / self.stiffness, 0.0)
        return Motion(self.arm.raw_dynamics.integrate(q, ahead), state.rotor_velocity)

    def external_torque(self, state: DrivenState, environment: Interaction, t: float) -> Array:
        """Return what the world does to the links; see `Plant.external_torque`."""
        return self.links.external_torque(state.links, environment, t)

    def acceleration(self, state: DrivenState, tau: Array, tau_ext: Array) -> Array:
        """Return the acceleration of the links under what drives and springs give now; see `Plant.acceleration`."""
        sent = state.pending[0] if len(state.pending) else tau
        now = np.where(self.time_constant > 0.0, state.torque, sent)
        transmitted = self._transmitted(state, self._rippled(state, now))
        return self.links.acceleration(state.links, transmitted, tau_ext)

    def step(
        self, state: DrivenState, tau: Array, environment: Interaction, t: float, h: float
    ) -> DrivenState:
        """Return the state after one step: forces of its beginning, then velocities, then positions."""
        compiled = compiled_step(self, h)
        if compiled is not None:
            now, tau_ext = state.links, self.external_torque(state, environment, t)
            q, v, torque, pending = compiled(
                tau, tau_ext, now.q, now.v, state.torque, state.pending
            )
            return DrivenState(Motion(q, v), torque, pending, state.delta, v, None)
        return self._plain_step(state, tau, environment, t, h)

    def _plain_step(
        self, state: DrivenState, tau: Array, environment: Interaction, t: float, h: float
    ) -> DrivenState:
        """The readable form of a step, which specifies the compiled one."""
        with np.errstate(over="ignore", invalid="ignore"):
            pending = np.concatenate([state.pending, tau[None]])
            wanted, loop = self._fed_back(state, pending[0], h)
            mean, torque = lagged(state.torque, wanted, *lag_of(self.time_constant, h))
            motor = self._rippled(state, mean)
            transmitted = self._transmitted(state, motor)
            links = self.links.step(state.links, transmitted, environment, t, h)
            q, _ = self.links.motion(state.links)
            q_next, v_next = self.links.motion(links)
            rotor_velocity = self._rotor_velocity(state, motor - transmitted, v_next, h)
            moved = self.arm.raw_dynamics.difference(q, q_next)
            delta = np.where(self.elastic, state.delta + h * rotor_velocity - moved, 0.0)
        return DrivenState(links, torque, pending[1:], delta, rotor_velocity, loop)

    # --- a drive ------------------------------------------------------------------------------------------------

    def _fed_back(self, state: DrivenState, tau: Array, h: float) -> tuple[Array, LoopState | None]:
        """What the motors are to give, behind the torque loop where there is one."""
        if self.torque_loop is None or state.loop is None:
            return tau, None
        behind = self._transmitted(state, state.torque)
        wanted, loop = self.torque_loop.step(state.loop, tau, behind, h)
        return np.where(self.elastic, wanted, tau), loop

    def _rotor_velocity(self, state: DrivenState, torque: Array, v_links: Array, h: float) -> Array:
        """Velocity of the rotors after a step; that of the links where a joint is rigid."""
        elastic, B = self.elastic, self.rotor_inertia
        rate = np.divide(torque, B, out=np.zeros_like(torque), where=elastic)
        w = np.where(elastic, state.rotor_velocity + h * rate, v_links)
        if self.gear_friction is not None and elastic.any():
            dry, viscous, stribeck = self.gear_friction
            A = np.diag(np.divide(1.0, B, out=np.ones_like(B), where=elastic))
            impulses = h * dry * elastic, h * viscous * elastic, np.empty_like(w)
            rub(w, A, *impulses, stribeck, 1)
        return w

    def _rippled(self, state: DrivenState, torque: Array) -> Array:
        """Torque on the rotors, with ripple and cogging."""
        if not (self.ripple.any() or self.cogging.any()):
            return torque
        q, _ = self.links.motion(state.links)
        angle = self.arm.raw_dynamics.difference(self.arm.neutral, q) + state.delta
        wave = np.sin(self.ripple_periods * angle)
        rippled: Array = torque + (torque * self.ripple + self.cogging) * wave
        return rippled

    def _transmitted(self, state: DrivenState, motor: Array) -> Array:
        """Torque on the links: K·δ + D·δ̇ of the springs, the motor's where the joint is rigid."""
        if not self.elastic.any():
            return motor
        _, v = self.links.motion(state.links)
        K = np.where(self.elastic, self.stiffness, 0.0)
        spring = K * state.delta + self.damping * (state.rotor_velocity - v)
        return np.where(self.elastic, spring, motor)

    def _behind_springs(self, links: ArmModel | Plant[Any]) -> Plant[Any]:
        """The links without the rotors of elastic joints; an error where rotors are missing or counted twice."""
        elastic, B = self.elastic, self.rotor_inertia
        arm = links if isinstance(links, ArmModel) else links.arm
        refuse_at(arm, elastic & (B <= 0.0), "rotor_inertia", B, "positive")
        if isinstance(links, ArmModel):
            has_friction = bool(arm.viscous.any() or arm.coulomb.any())
            return RigidPlant(
                arm.with_armature(np.where(elastic, 0.0, B)), friction_at_end=has_friction
            )
        refuse_at(arm, elastic & (arm.armature > 0.0), "armature of the links", arm.armature, "0")
        return links


def _torques(hardware: Hardware, dt: float) -> dict[str, Any]:
    """What a description says of the motors' torque."""
    return {
        "time_constant": hardware.torque_lag,
        "dead_time": hardware.delay * dt,
        "ripple": hardware.ripple,
        "ripple_periods": hardware.ripple_periods,
    }


def _rigid(plant: Plant[Any], hardware: Hardware) -> Plant[Any]:
    """Another engine, if it is one that a description fits.

    Raises:
        ParameterError: It has springs or other rotors.
    """
    if hardware.is_elastic:
        raise ParameterError("plant", plant, "an ArmModel where the hardware has springs")
    if not np.array_equal(hardware.rotors(plant.arm), plant.arm.armature):
        words = "the armature of the plant, or None"
        raise ParameterError("rotor_inertia", hardware.rotor_inertia, words)
    return plant
