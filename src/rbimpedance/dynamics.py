"""`ArmModel`: the rigid-body dynamics of a fixed-base arm, M(q) a + bias(q, v) = tau + tau_ext.

Two layers. `PinocchioDynamics` evaluates Pinocchio's algorithms and checks nothing: it is what the controller and
the simulator call once their inputs have been checked. `ArmModel` is what users hold: immutable, with every input
checked at the border, and with copies that differ in payload, inertia, friction, armature or gravity.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from ._arrays import Array, gain, per_joint, positive_number, real, vector
from ._description import Description
from ._suggestions import suggest
from .exceptions import DimensionError, GainError, ModelError, UnsupportedJointError

COULOMB_SMOOTHING = 0.05
"""Speed v_c at which smoothed Coulomb friction tau_c·tanh(v / v_c) reaches 76 % of tau_c [rad/s or m/s]."""

_WORLD_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class RigidBodies(NamedTuple):
    """What enters the dynamics, joint by joint in the order of v, for code that does not know Pinocchio.

    Each joint carries one body. Friction and armature are attributes of the arm.

    Attributes:
        parent: Index of the joint before it, -1 for the base, shape (nv,).
        q_index: Where the joint's entries of q begin, shape (nv,).
        q_size: How many they are: 1, or 2 for the (cos, sin) of a continuous joint, shape (nv,).
        rotation: Axes of the joint in those of its parent where q is neutral, shape (nv, 3, 3).
        translation: Origin of the joint in its parent, shape (nv, 3) [m].
        axis: Axis that the joint turns about or slides along, in its own axes, a unit vector, shape (nv, 3).
        slides: True for a prismatic joint, shape (nv,).
        mass: Mass of the body, shape (nv,) [kg].
        com: Its centre of mass in the joint's axes, shape (nv, 3) [m].
        inertia: Its rotational inertia about the centre of mass, in the joint's axes, shape (nv, 3, 3) [kg·m²].
        gravity: Acceleration of free fall in world axes, shape (3,) [m/s²].
    """

    parent: NDArray[np.int64]
    q_index: NDArray[np.int64]
    q_size: NDArray[np.int64]
    rotation: Array
    translation: Array
    axis: Array
    slides: NDArray[np.bool_]
    mass: Array
    com: Array
    inertia: Array
    gravity: Array


class PinocchioDynamics:
    """Pinocchio's RNEA, CRBA and ABA with joint friction added; inputs are not checked.

    Friction, which `pin.rnea` and `pin.aba` leave out, is

        tau_f(v) = d·v + tau_c·tanh(v / v_c)

    with d the viscous and tau_c the Coulomb coefficient of the model.

    Each instance owns its `pin.Data` and returns copies; two threads must not share one.

    Attributes:
        model: The Pinocchio model.
        frame_ids: Index of every frame by name; where a link shares its name with a joint, that of the link.
        rnea: Pinocchio's own RNEA of (q, v, a): without friction, its result valid until the next call.
    """

    def __init__(self, model: pin.Model) -> None:
        self.model = model
        frames = sorted(enumerate(model.frames), key=lambda item: item[1].type == pin.BODY)
        self.frame_ids = {frame.name: i for i, frame in frames}
        self._data = model.createData()
        self.rnea = partial(pin.rnea, model, self._data)
        self._viscous = np.array(model.damping)
        self._coulomb = np.array(model.upperDryFrictionLimit)
        self._has_friction = bool(self._viscous.any() or self._coulomb.any())

    def friction(self, v: Array) -> Array:
        """Friction torque that opposes v, shape (nv,), [N·m or N]."""
        torque: Array = self._viscous * v + self._coulomb * np.tanh(v / COULOMB_SMOOTHING)
        return torque

    def mass_matrix(self, q: Array) -> Array:
        """M(q) with the armature on its diagonal, shape (nv, nv)."""
        return np.array(pin.crba(self.model, self._data, q))

    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> Array:
        """M a + bias by one RNEA, shape (nv,)."""
        tau = np.array(pin.rnea(self.model, self._data, q, v, a))
        return tau + self.friction(v) if self._has_friction else tau

    def bias(self, q: Array, v: Array) -> Array:
        """C v + g + friction, shape (nv,)."""
        tau = np.array(pin.nonLinearEffects(self.model, self._data, q, v))
        return tau + self.friction(v) if self._has_friction else tau

    def forward_dynamics(self, q: Array, v: Array, torque: Array) -> Array:
        """Acceleration under the sum of all joint torques, by ABA, shape (nv,)."""
        if self._has_friction:
            torque = torque - self.friction(v)
        return np.array(pin.aba(self.model, self._data, q, v, torque))

    def damped_forward_dynamics(self, q: Array, v: Array, torque: Array, h: float) -> Array:
        """The same with friction taken at the end of a step h, shape (nv,).

        With D(v)·v = tau_f(v), friction at v + h·a is close to tau_f(v) + h·D·a, so that h·D joins the armature:
        (M + h·D) a = torque - bias. The step takes energy out however stiff the friction is.
        """
        armature = self.model.armature.copy()
        self.model.armature = armature + h * self._friction_slope(v)
        a = self.forward_dynamics(q, v, torque)
        self.model.armature = armature
        return a

    def friction_rate(self, q: Array) -> float:
        """The fastest rate at which friction brings a joint to rest, max of (M⁻¹)ᵢᵢ·(d + tau_c/v_c) [1/s]."""
        slope = self._friction_slope(np.zeros(self.model.nv))
        return float((np.diag(np.linalg.inv(self.mass_matrix(q))) * slope).max())

    def _friction_slope(self, v: Array) -> Array:
        """D(v) = tau_f(v)/v, shape (nv,)."""
        x = v / COULOMB_SMOOTHING
        secant = np.divide(np.tanh(x), x, out=np.ones_like(x), where=np.abs(x) > 1e-8)
        slope: Array = self._viscous + self._coulomb / COULOMB_SMOOTHING * secant
        return slope

    def jacobian(self, q: Array, frame_id: int) -> Array:
        """Frame Jacobian in world axes at the frame's origin, linear rows first, shape (6, nv)."""
        J = np.array(pin.computeFrameJacobian(self.model, self._data, q, frame_id, _WORLD_AXES))
        return J.reshape(6, self.model.nv)  # pin returns a vector where nv = 1

    def frame_placement(self, q: Array, frame_id: int) -> tuple[Array, Array]:
        """Rotation (3, 3) and origin (3,) of a frame in the world."""
        pin.forwardKinematics(self.model, self._data, q)
        placement = pin.updateFramePlacement(self.model, self._data, frame_id)
        return np.array(placement.rotation), np.array(placement.translation)

    def difference(self, q0: Array, q1: Array) -> Array:
        """The tangent vector from q0 to q1, q1 (-) q0, shape (nv,)."""
        return np.array(pin.difference(self.model, q0, q1))

    def integrate(self, q: Array, step: Array) -> Array:
        """The configuration q (+) step, shape (nq,)."""
        return np.array(pin.integrate(self.model, q, step))


class MimicDynamics(PinocchioDynamics):
    """The same for models with mimicking joints, on RNEA and forward kinematics alone.

    Pinocchio's ABA does not take such models. Its CRBA and frame Jacobian (pin 4.1.0) do, but are wrong on some trees,
    and CRBA from the second call on one `pin.Data` on every tree; RNEA and forward kinematics are right on all.
    """

    def __init__(self, model: pin.Model) -> None:
        super().__init__(model)
        self._weightless = pin.Model(model)
        self._weightless.gravity.linear = np.zeros(3)
        self._units = np.eye(model.nv)

    def mass_matrix(self, q: Array) -> Array:
        """M(q) from the torques of unit accelerations; see `PinocchioDynamics.mass_matrix`."""
        rest = np.zeros(self.model.nv)
        M: Array = np.empty((self.model.nv, self.model.nv))
        for i, unit in enumerate(self._units):
            M[:, i] = pin.rnea(self._weightless, self._data, q, rest, unit)
        return (M + M.T) / 2.0

    def forward_dynamics(self, q: Array, v: Array, torque: Array) -> Array:
        """M⁻¹ (torque - bias); see `PinocchioDynamics.forward_dynamics`."""
        a = np.linalg.solve(self.mass_matrix(q), torque - self.bias(q, v))
        return np.asarray(a, dtype=np.float64)

    def jacobian(self, q: Array, frame_id: int) -> Array:
        """The frame's velocities at unit joint velocities; see `PinocchioDynamics.jacobian`."""
        J = np.empty((6, self.model.nv))
        for i, unit in enumerate(self._units):
            pin.forwardKinematics(self.model, self._data, q, unit)
            J[:, i] = pin.getFrameVelocity(self.model, self._data, frame_id, _WORLD_AXES).vector
        return J


@dataclass(frozen=True, eq=False, init=False, repr=False)
class ArmModel:
    """An immutable model of a fixed-base arm.

    Convention: M(q) a + bias(q, v) = tau + tau_ext, with tau_ext what the environment does to the robot. q lives in
    R^nq (a continuous joint takes two entries, cos and sin), everything else in R^nv. SI units: rad, N·m on turning
    joints; m, N on sliding ones.

    Build one with `load_robot`; the constructor takes a `pin.Model` whose joints have one degree of freedom each.

    Attributes:
        name: Name of the robot.
        nq: Size of a configuration.
        nv: Number of degrees of freedom.
        joint_names: Names of the nv joints, in the order of v.
        tool_frame: Frame that `jacobian` and wrenches refer to by default.
        neutral: Pinocchio's neutral configuration, moved into the position limits, shape (nq,).
        lower: Lower position limits, shape (nq,); -inf where there is none (continuous joints).
        upper: Upper position limits, shape (nq,); +inf where there is none.
        effort_limit: Largest torque, shape (nv,) [N·m or N]; +inf where the description gives none (or 0).
        velocity_limit: Largest speed, shape (nv,) [rad/s or m/s]; +inf where the description gives none (or 0).
        viscous: Viscous friction, shape (nv,) [N·m·s/rad or N·s/m].
        coulomb: Coulomb friction, shape (nv,) [N·m or N], smoothed by tanh(v / `COULOMB_SMOOTHING`).
        armature: Reflected rotor inertia, shape (nv,) [kg·m² or kg].
        notes: What the loader found worth saying.
        description: The URDF behind it, for pictures; None where there is none.
        unchecked: The same dynamics without input checks, for hot loops.

    Raises:
        UnsupportedJointError: A joint has more than one degree of freedom.
        ModelError: No movable joint, or the tool frame does not exist.
    """

    name: str
    nq: int
    nv: int
    joint_names: tuple[str, ...]
    tool_frame: str
    neutral: Array
    lower: Array
    upper: Array
    effort_limit: Array
    velocity_limit: Array
    viscous: Array
    coulomb: Array
    armature: Array
    notes: tuple[str, ...]
    description: Description | None
    unchecked: PinocchioDynamics

    def __init__(
        self,
        model: pin.Model,
        *,
        name: str,
        tool_frame: str,
        notes: tuple[str, ...] = (),
        description: Description | None = None,
    ) -> None:
        model = pin.Model(model)
        _check_joints(model)
        is_plain = _is_plain_coordinate(model)
        lower = np.where(is_plain, _unbounded(model.lowerPositionLimit), -np.inf)
        upper = np.where(is_plain, _unbounded(model.upperPositionLimit), np.inf)
        arrays = {
            "neutral": np.clip(pin.neutral(model), lower, upper),
            "lower": lower,
            "upper": upper,
            "effort_limit": _limit_or_none_given(model.upperEffortLimit),
            "velocity_limit": _limit_or_none_given(model.upperVelocityLimit),
            "viscous": np.array(model.damping),
            "coulomb": np.array(model.upperDryFrictionLimit),
            "armature": np.array(model.armature),
        }
        for array in arrays.values():
            array.setflags(write=False)
        fields = {
            "name": name,
            "nq": model.nq,
            "nv": model.nv,
            "joint_names": tuple(model.names[j] for j in _movable(model)),
            "tool_frame": tool_frame,
            "notes": tuple(notes),
            "description": description,
            "unchecked": _dynamics(model),
        }
        for key, value in (fields | arrays).items():
            object.__setattr__(self, key, value)
        self._frame_id(None)

    def __repr__(self) -> str:
        return (
            f"ArmModel({self.name!r}, nq={self.nq}, nv={self.nv}, tool_frame={self.tool_frame!r})"
        )

    def __reduce__(self) -> tuple[object, ...]:
        model = self.unchecked.model
        return _rebuild, (model, self.name, self.tool_frame, self.notes, self.description)

    # --- what the model knows -----------------------------------------------------------------------------------

    @property
    def model(self) -> pin.Model:
        """A copy of the Pinocchio model; changing it does not change this arm."""
        return pin.Model(self.unchecked.model)

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Names of all frames, in Pinocchio's order."""
        return tuple(frame.name for frame in self.unchecked.model.frames)

    @property
    def digest(self) -> str:
        """SHA-256 over everything that enters dynamics and kinematics: equal models have equal digests."""
        model = self.unchecked.model
        parts = [repr((list(model.names), list(model.parents), self.tool_frame))]
        parts += [f"{joint.shortname()} {joint.idx_q} {joint.idx_v}" for joint in model.joints]
        parts += [f"{frame.name} {frame.type} {frame.parentJoint}" for frame in model.frames]
        numbers = [np.array(model.gravity.linear), self.lower, self.upper]
        numbers += [self.effort_limit, self.velocity_limit]
        numbers += [self.viscous, self.coulomb, self.armature]
        placements = [*model.jointPlacements, *_sample_placements(model)]
        placements += [frame.placement for frame in model.frames]
        numbers += [np.array(placement.homogeneous) for placement in placements]
        numbers += [np.array(inertia.matrix()) for inertia in model.inertias]
        content = "\n".join(parts).encode() + b"".join(
            np.ascontiguousarray(x).tobytes() for x in numbers
        )
        return hashlib.sha256(content).hexdigest()

    def rigid_bodies(self) -> RigidBodies:
        """Return the numbers behind the dynamics as plain arrays.

        Raises:
            UnsupportedJointError: A joint that neither turns about nor slides along one axis of its own (mimic, screw).
        """
        model = self.unchecked.model
        joints, axes = _movable(model), _motion_axes(model)
        slides = np.array([not axis[3:].any() for axis in axes])
        return RigidBodies(
            parent=np.array([model.parents[j] - 1 for j in joints]),
            q_index=np.array([model.joints[j].idx_q for j in joints]),
            q_size=np.array([model.joints[j].nq for j in joints]),
            rotation=np.array([model.jointPlacements[j].rotation for j in joints]),
            translation=np.array([model.jointPlacements[j].translation for j in joints]),
            axis=np.array([axis[:3] + axis[3:] for axis in axes]),
            slides=slides,
            mass=np.array([model.inertias[j].mass for j in joints]),
            com=np.array([model.inertias[j].lever for j in joints]),
            inertia=np.array([model.inertias[j].inertia for j in joints]),
            gravity=np.array(model.gravity.linear),
        )

    # --- dynamics -----------------------------------------------------------------------------------------------

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Return M(q), armature included, shape (nv, nv) [kg·m² and alike], by CRBA.

        Args:
            q: Configuration, shape (nq,).

        Raises:
            DimensionError: Wrong shape or kind, or the (cos, sin) pair of a continuous joint is not of unit length.
            NonFiniteError: q holds NaN or infinity.
        """
        return self.unchecked.mass_matrix(self.check_configuration("q", q))

    def bias(self, q: ArrayLike, v: ArrayLike) -> Array:
        """Return C(q, v) v + g(q) + friction(v), shape (nv,) [N·m or N].

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,) [rad/s or m/s].

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
        """
        return self.unchecked.bias(self.check_configuration("q", q), vector("v", v, self.nv))

    def drift(self, q: ArrayLike, v: ArrayLike) -> Array:
        """Return f(q, v) = -M⁻¹ bias of the paper's eq. (1), shape (nv,) [rad/s² or m/s²].

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
        """
        return self.forward_dynamics(q, v, np.zeros(self.nv))

    def inverse_dynamics(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Return the total joint torque M a + bias, shape (nv,), by one RNEA (plus friction).

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).
            a: Acceleration, shape (nv,) [rad/s² or m/s²].

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
        """
        return self.unchecked.inverse_dynamics(
            self.check_configuration("q", q), vector("v", v, self.nv), vector("a", a, self.nv)
        )

    def forward_dynamics(
        self, q: ArrayLike, v: ArrayLike, tau: ArrayLike, tau_ext: ArrayLike | None = None
    ) -> Array:
        """Return the acceleration M⁻¹ (tau + tau_ext - bias), shape (nv,), by ABA.

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).
            tau: Motor torque, shape (nv,) [N·m or N].
            tau_ext: Torque that the environment exerts on the robot, shape (nv,); none by default.

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
        """
        torque = vector("tau", tau, self.nv)
        if tau_ext is not None:
            torque = torque + vector("tau_ext", tau_ext, self.nv)
        return self.unchecked.forward_dynamics(
            self.check_configuration("q", q), vector("v", v, self.nv), torque
        )

    # --- kinematics ---------------------------------------------------------------------------------------------

    def jacobian(self, q: ArrayLike, frame: str | None = None) -> Array:
        """Return the Jacobian of a frame's origin in world axes, linear rows first, shape (6, nv).

        Args:
            q: Configuration, shape (nq,).
            frame: Name of the frame; the tool frame by default.

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: q holds NaN or infinity.
            ModelError: No such frame.
        """
        return self.unchecked.jacobian(self.check_configuration("q", q), self._frame_id(frame))

    def frame_placement(self, q: ArrayLike, frame: str | None = None) -> tuple[Array, Array]:
        """Return rotation (3, 3) and origin (3,) [m] of a frame in the world.

        Args:
            q: Configuration, shape (nq,).
            frame: Name of the frame; the tool frame by default.

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: q holds NaN or infinity.
            ModelError: No such frame.
        """
        return self.unchecked.frame_placement(
            self.check_configuration("q", q), self._frame_id(frame)
        )

    def external_torque(
        self,
        q: ArrayLike,
        wrench: ArrayLike,
        frame: str | None = None,
        expressed_in: str = "world",
    ) -> Array:
        """Return the joint torque Jᵀ w that a wrench on a frame exerts, shape (nv,).

        Args:
            q: Configuration, shape (nq,).
            wrench: Force [N] and moment [N·m] that act at the frame's origin, shape (6,).
            frame: Name of the frame; the tool frame by default.
            expressed_in: Axes of the wrench: "world", or "local" for the frame's own axes.

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
            ModelError: No such frame.
            GainError: `expressed_in` is neither "world" nor "local".
        """
        q = self.check_configuration("q", q)
        wrench = vector("wrench", wrench, 6, "force, moment")
        frame_id = self._frame_id(frame)
        if expressed_in == "local":
            rotation, _ = self.unchecked.frame_placement(q, frame_id)
            wrench = np.concatenate([rotation @ wrench[:3], rotation @ wrench[3:]])
        elif expressed_in != "world":
            raise GainError("expressed_in", expressed_in, '"world" or "local"')
        torque: Array = self.unchecked.jacobian(q, frame_id).T @ wrench
        return torque

    def difference(self, q0: ArrayLike, q1: ArrayLike) -> Array:
        """Return the tangent vector from q0 to q1, q1 (-) q0, shape (nv,) [rad or m].

        On a continuous joint it is the short way round, in (-π, π].

        Args:
            q0: Configuration to start from, shape (nq,).
            q1: Configuration to arrive at, shape (nq,).

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
        """
        return self.unchecked.difference(
            self.check_configuration("q0", q0), self.check_configuration("q1", q1)
        )

    def integrate(self, q: ArrayLike, step: ArrayLike) -> Array:
        """Return the configuration q (+) step, shape (nq,).

        Args:
            q: Configuration, shape (nq,).
            step: Tangent vector, shape (nv,) [rad or m].

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
        """
        return self.unchecked.integrate(
            self.check_configuration("q", q), vector("step", step, self.nv)
        )

    def joint_limits(self) -> tuple[Array, Array]:
        """Return the lower and upper position limit of every joint, each of shape (nv,) [rad or m].

        Unlike `lower` and `upper`, which bound the entries of q, there is one number per joint; a continuous joint
        has none and gets -inf and +inf.
        """
        joints = [self.unchecked.model.joints[j] for j in _movable(self.unchecked.model)]
        lower = [self.lower[j.idx_q] if j.nq == 1 else -np.inf for j in joints]
        upper = [self.upper[j.idx_q] if j.nq == 1 else np.inf for j in joints]
        return np.array(lower), np.array(upper)

    def random_configuration(self, rng: np.random.Generator) -> Array:
        """Draw a configuration uniformly within the limits, shape (nq,).

        Where a limit is missing, π rad (or 1 m) beyond `neutral` takes its place.

        Args:
            rng: Source of randomness.
        """
        model = self.unchecked.model
        q = np.array(self.neutral)
        for j in _movable(model):
            i, joint = model.joints[j].idx_q, model.joints[j]
            if joint.nq == 2:
                angle = rng.uniform(-np.pi, np.pi)
                q[i : i + 2] = np.cos(angle), np.sin(angle)
            else:
                span = 1.0 if joint.shortname().startswith("JointModelP") else np.pi
                lower = self.lower[i] if np.isfinite(self.lower[i]) else self.neutral[i] - span
                upper = self.upper[i] if np.isfinite(self.upper[i]) else self.neutral[i] + span
                q[i] = rng.uniform(lower, upper)
        return q

    # --- copies with changes ------------------------------------------------------------------------------------

    def copy(self) -> ArmModel:
        """Return an equal arm that shares nothing with this one."""
        return self._with_model(self.unchecked.model)

    def with_payload(
        self,
        mass: float,
        com: ArrayLike = (0.0, 0.0, 0.0),
        inertia: ArrayLike | None = None,
        frame: str | None = None,
    ) -> ArmModel:
        """Return a copy that carries a rigid payload.

        Args:
            mass: Mass [kg], at least 0.
            com: Centre of mass in the frame's axes, shape (3,) [m].
            inertia: Rotational inertia about the centre of mass in the frame's axes, shape (3, 3) [kg·m²]; a point
                mass by default.
            frame: Frame that the payload is fixed to; the tool frame by default.

        Raises:
            GainError: Negative mass, or an inertia that is not symmetric positive semi-definite.
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
            ModelError: No such frame.
        """
        mass = _payload_mass(mass)
        rotational = np.zeros((3, 3)) if inertia is None else _rotational_inertia(inertia)
        frame_id = self._frame_id(frame)
        body = pin.Inertia(mass, vector("com", com, 3, "x, y, z"), rotational)
        model = self.model
        model.appendBodyToJoint(
            model.frames[frame_id].parentJoint, body, model.frames[frame_id].placement
        )
        return self._with_model(model)

    def with_scaled_inertia(self, factor: float) -> ArmModel:
        """Return a copy whose links' masses and rotational inertias are multiplied by a factor.

        Args:
            factor: Positive factor.

        Raises:
            GainError: Not a positive number.
        """
        scale = positive_number("factor", factor, "factor")
        model = self.model
        for j, link in enumerate(model.inertias):
            scaled = pin.Inertia(link)  # whose constructor would refuse what some real files hold
            scaled.mass, scaled.inertia = scale * link.mass, scale * link.inertia
            model.inertias[j] = scaled
        return self._with_model(model)

    def with_friction(
        self, viscous: ArrayLike | None = None, coulomb: ArrayLike | None = None
    ) -> ArmModel:
        """Return a copy with other joint friction; what is not given stays as it is.

        Args:
            viscous: Viscous coefficients, scalar or (nv,) [N·m·s/rad or N·s/m].
            coulomb: Coulomb torques, scalar or (nv,) [N·m or N], smoothed by tanh(v / `COULOMB_SMOOTHING`).

        Raises:
            GainError: A negative or non-finite coefficient.
            DimensionError: Neither a scalar nor one number per joint.
        """
        model = self.model
        if viscous is not None:
            model.damping = self._per_joint("viscous", viscous)
        if coulomb is not None:
            dry = self._per_joint("coulomb", coulomb)
            model.upperDryFrictionLimit, model.lowerDryFrictionLimit = dry, -dry
        return self._with_model(model)

    def with_armature(self, armature: ArrayLike) -> ArmModel:
        """Return a copy with another reflected rotor inertia on the diagonal of M.

        Args:
            armature: Scalar or (nv,), non-negative [kg·m² or kg].

        Raises:
            GainError: A negative or non-finite entry.
            DimensionError: Neither a scalar nor one number per joint.
        """
        model = self.model
        model.armature = self._per_joint("armature", armature)
        return self._with_model(model)

    def with_gravity(self, gravity: ArrayLike) -> ArmModel:
        """Return a copy in another gravity field.

        Args:
            gravity: Acceleration of free fall in world axes, shape (3,) [m/s²].

        Raises:
            DimensionError: Not a vector of three numbers.
            NonFiniteError: Holds NaN or infinity.
        """
        model = self.model
        model.gravity.linear = vector("gravity", gravity, 3, "x, y, z")
        return self._with_model(model)

    # --- checks -------------------------------------------------------------------------------------------------

    def check_configuration(self, name: str, q: ArrayLike) -> Array:
        """Return q as a finite float64 vector of shape (nq,).

        Args:
            name: What the argument is called, for the error.
            q: Configuration.

        Raises:
            DimensionError: Wrong shape or kind, or the (cos, sin) pair of a continuous joint is not of unit length.
            NonFiniteError: q holds NaN or infinity.
        """
        try:
            q = vector(name, q, self.nq, "nq")
        except DimensionError as error:
            hint = f"a configuration of '{self.name}' has nq = {self.nq} (nv = {self.nv})"
            raise DimensionError(name, f"{error.expected}; {hint}", error.actual) from None
        if self.nq != self.nv and not pin.isNormalized(self.unchecked.model, q, 1e-6):
            raise DimensionError(
                name,
                "a configuration whose continuous joints are (cos, sin) pairs of unit length",
                f"{q}",
            )
        return q

    def _per_joint(self, name: str, value: ArrayLike) -> Array:
        return np.array(
            per_joint(name, gain(name, value, "non-negative", lambda x: x >= 0.0), self.nv)
        )

    def _with_model(self, model: pin.Model) -> ArmModel:
        return _rebuild(model, self.name, self.tool_frame, self.notes, self.description)

    def _frame_id(self, frame: str | None) -> int:
        frame = self.tool_frame if frame is None else frame
        frame_id = self.unchecked.frame_ids.get(frame)
        if frame_id is None:
            raise ModelError(
                f"'{self.name}' has no frame '{frame}'{suggest(frame, self.frame_names)}"
            )
        return frame_id


def _rebuild(
    model: pin.Model,
    name: str,
    tool_frame: str,
    notes: tuple[str, ...],
    description: Description | None,
) -> ArmModel:
    return ArmModel(model, name=name, tool_frame=tool_frame, notes=notes, description=description)


def _dynamics(model: pin.Model) -> PinocchioDynamics:
    return MimicDynamics(model) if len(model.mimicking_joints) else PinocchioDynamics(model)


def _movable(model: pin.Model) -> list[int]:
    """Indices of the joints that own a degree of freedom, in the order of v."""
    return [j for j in range(1, model.njoints) if model.nvs[j] > 0]


def _check_joints(model: pin.Model) -> None:
    movable = _movable(model)
    if not movable:
        raise ModelError(f"'{model.name}' has no movable joint: nothing to control")
    wide = [model.names[j] for j in movable if model.nvs[j] != 1]
    if wide:
        raise UnsupportedJointError(
            wide,
            "only joints with one degree of freedom can be controlled; weld it with lock=(...)",
        )


def _sample_placements(model: pin.Model) -> list[pin.SE3]:
    """Placements of all joints at two configurations: they tell joint axes and mimic rules apart."""
    data, q = model.createData(), pin.neutral(model)
    placements = []
    for configuration in (q, pin.integrate(model, q, np.ones(model.nv))):
        pin.forwardKinematics(model, data, configuration)
        placements += [pin.SE3(placement) for placement in data.oMi]
    return placements


def _motion_axes(model: pin.Model) -> list[Array]:
    """Motion subspace of every joint in its own axes, (linear, angular), each of shape (6,).

    Raises:
        UnsupportedJointError: A joint that neither turns about nor slides along one axis of its own.
    """
    names = [model.names[j] for j in model.mimicking_joints]
    data, q, axes = model.createData(), pin.neutral(model), []
    for j in range(1, model.njoints):
        if model.nvs[j] != 1:
            continue
        columns = np.array(pin.computeJointJacobian(model, data, q, j)).reshape(6, model.nv)
        axis = columns[:, model.joints[j].idx_v]
        if axis[:3].any() and axis[3:].any():
            names.append(model.names[j])
        axes.append(axis)
    if names:
        raise UnsupportedJointError(
            names, "neither turns about nor slides along an axis of its own"
        )
    return axes


def _is_plain_coordinate(model: pin.Model) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """True on the entries of q that are an angle or a length, False on (cos, sin) pairs."""
    plain = np.ones(model.nq, dtype=np.bool_)
    for joint in model.joints[1:]:
        if joint.nq == 2:
            plain[joint.idx_q : joint.idx_q + 2] = False
    return plain


def _unbounded(limit: Array) -> Array:
    """Read Pinocchio's default limit, the largest double, as infinity."""
    return np.where(np.abs(limit) < np.finfo(np.float64).max, limit, np.copysign(np.inf, limit))


def _limit_or_none_given(limit: Array) -> Array:
    """Read a limit of 0 as "not given": no limit."""
    return np.where(np.array(limit) > 0.0, _unbounded(limit), np.inf)


def _payload_mass(mass: float) -> float:
    array = gain("mass", mass, "non-negative", lambda x: x >= 0.0)
    if array.ndim:
        raise GainError("mass", mass, "a single number")
    return float(array)


def _rotational_inertia(inertia: ArrayLike) -> Array:
    matrix = real("inertia", inertia, "a matrix of shape (3, 3)")
    if matrix.shape != (3, 3):
        raise DimensionError("inertia", "a matrix of shape (3, 3)", f"shape {matrix.shape}")
    if not np.isfinite(matrix).all() or not np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-12):
        raise GainError("inertia", inertia, "finite and symmetric")
    if np.linalg.eigvalsh(matrix)[0] < -1e-12:
        raise GainError("inertia", inertia, "positive semi-definite")
    return matrix
