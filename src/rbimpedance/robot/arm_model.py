"""`ArmModel`: the rigid-body dynamics of a fixed-base arm, M(q) a + bias(q, v) = tau + tau_ext.

It is what users hold: immutable, with every input checked at the border, and with copies that differ in payload,
inertia, friction, armature or gravity. What it computes comes from `PinocchioDynamics`, which checks nothing.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .._common.arrays import Array, gain, per_joint, positive_number, real, vector
from .._common.deprecation import renamed_attribute
from .._common.suggestions import suggest
from ..exceptions import DimensionError, ModelError, ParameterError, UnsupportedJointError
from .description import Description
from .digest import model_digest
from .mimic_dynamics import pinocchio_dynamics
from .pinocchio_dynamics import PinocchioDynamics
from .postures import ready_configuration
from .rigid_bodies import RigidBodies, movable_joints, rigid_bodies


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
        ready: A posture well inside the position limits, shape (nq,): a reference configuration that the description
            comes with (SRDF, example-robot-data, `pinocchio.Model.referenceConfigurations`), else the middle of each
            range and 0 where there are no limits; at least a tenth of its range away from each limit.
        lower: Lower position limits, shape (nq,); -inf where there is none (continuous joints).
        upper: Upper position limits, shape (nq,); +inf where there is none.
        effort_limit: Largest torque, shape (nv,) [N·m or N]; +inf where the description gives none (or 0).
        velocity_limit: Largest speed, shape (nv,) [rad/s or m/s]; +inf where the description gives none (or 0).
        viscous: Viscous friction, shape (nv,) [N·m·s/rad or N·s/m].
        coulomb: Coulomb friction, shape (nv,) [N·m or N], smoothed by tanh(v / `COULOMB_SMOOTHING`).
        armature: Reflected rotor inertia, shape (nv,) [kg·m² or kg].
        notes: What the loader found worth saying.
        description: The URDF behind it, for pictures; None where there is none.
        raw_dynamics: The same dynamics without input checks, for hot loops.

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
    ready: Array
    lower: Array
    upper: Array
    effort_limit: Array
    velocity_limit: Array
    viscous: Array
    coulomb: Array
    armature: Array
    notes: tuple[str, ...]
    description: Description | None
    raw_dynamics: PinocchioDynamics

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
            "ready": ready_configuration(model),
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
            "joint_names": tuple(model.names[j] for j in movable_joints(model)),
            "tool_frame": tool_frame,
            "notes": tuple(notes),
            "description": description,
            "raw_dynamics": pinocchio_dynamics(model),
        }
        for key, value in (fields | arrays).items():
            object.__setattr__(self, key, value)
        self._frame_id(None)

    def __repr__(self) -> str:
        return (
            f"ArmModel({self.name!r}, nq={self.nq}, nv={self.nv}, tool_frame={self.tool_frame!r})"
        )

    def __reduce__(self) -> tuple[object, ...]:
        return functools.partial(ArmModel, **self._labels()), (self.raw_dynamics.model,)

    # --- what the model knows -----------------------------------------------------------------------------------

    @property
    def model(self) -> pin.Model:
        """A copy of the Pinocchio model; changing it does not change this arm."""
        return pin.Model(self.raw_dynamics.model)

    @property
    def zero(self) -> Array:
        """The configuration in which every joint is at 0, limits or not, shape (nq,).

        `integrate(arm.zero, angles)` turns joint positions, shape (nv,), into a configuration, and
        `difference(arm.zero, q)` turns it back.
        """
        return np.array(pin.neutral(self.raw_dynamics.model))

    @property
    def position_units(self) -> tuple[str, ...]:
        """Unit of each joint's position: "rad" where it turns, "m" where it slides."""
        model = self.raw_dynamics.model
        kinds = (model.joints[j].shortname() for j in movable_joints(model))
        return tuple("m" if kind.startswith("JointModelP") else "rad" for kind in kinds)

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Names of all frames, in Pinocchio's order."""
        return tuple(frame.name for frame in self.raw_dynamics.model.frames)

    @functools.cached_property
    def digest(self) -> str:
        """SHA-256 over everything that enters dynamics and kinematics: equal models have equal digests."""
        vectors = (self.lower, self.upper, self.effort_limit, self.velocity_limit)
        friction = (self.viscous, self.coulomb, self.armature)
        return model_digest(self.raw_dynamics.model, self.tool_frame, (*vectors, *friction))

    def rigid_bodies(self) -> RigidBodies:
        """Return the numbers behind the dynamics as plain arrays.

        Raises:
            UnsupportedJointError: A joint that neither turns about nor slides along one axis of its own (mimic, screw).
        """
        return rigid_bodies(self.raw_dynamics.model)

    # --- dynamics -----------------------------------------------------------------------------------------------

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Return M(q), armature included, shape (nv, nv) [kg·m² and alike], by CRBA.

        Args:
            q: Configuration, shape (nq,).

        Raises:
            DimensionError: Wrong shape or kind, or the (cos, sin) pair of a continuous joint is not of unit length.
            NonFiniteError: q holds NaN or infinity.
        """
        return self.raw_dynamics.mass_matrix(self.check_configuration("q", q))

    def bias(self, q: ArrayLike, v: ArrayLike) -> Array:
        """Return C(q, v) v + g(q) + friction(v), shape (nv,) [N·m or N].

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,) [rad/s or m/s].

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
        """
        return self.raw_dynamics.bias(self.check_configuration("q", q), vector("v", v, self.nv))

    def drift(self, q: ArrayLike, v: ArrayLike) -> Array:
        """Return f(q, v) = -M⁻¹ bias (paper, eq. 1), shape (nv,) [rad/s² or m/s²].

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
        return self.raw_dynamics.inverse_dynamics(
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
        return self.raw_dynamics.forward_dynamics(
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
        return self.raw_dynamics.jacobian(self.check_configuration("q", q), self._frame_id(frame))

    def frame_placement(self, q: ArrayLike, frame: str | None = None) -> tuple[Array, Array]:
        """Return rotation (3, 3) and origin (3,) [m] of a frame in the world.

        Args:
            q: Configuration, shape (nq,).
            frame: Name of the frame; the tool frame by default. Errors are those of `jacobian`.
        """
        return self.raw_dynamics.frame_placement(
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
            ParameterError: `expressed_in` is neither "world" nor "local".
        """
        q = self.check_configuration("q", q)
        wrench = vector("wrench", wrench, 6, "force, moment")
        frame_id = self._frame_id(frame)
        if expressed_in == "local":
            rotation, _ = self.raw_dynamics.frame_placement(q, frame_id)
            wrench = np.concatenate([rotation @ wrench[:3], rotation @ wrench[3:]])
        elif expressed_in != "world":
            raise ParameterError("expressed_in", expressed_in, '"world" or "local"')
        torque: Array = self.raw_dynamics.jacobian(q, frame_id).T @ wrench
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
        return self.raw_dynamics.difference(
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
        return self.raw_dynamics.integrate(
            self.check_configuration("q", q), vector("step", step, self.nv)
        )

    def joint_limits(self) -> tuple[Array, Array]:
        """Return the lower and upper position limit of every joint, each of shape (nv,) [rad or m].

        Unlike `lower` and `upper`, which bound the entries of q, there is one number per joint; a continuous joint
        has none and gets -inf and +inf.
        """
        model = self.raw_dynamics.model
        joints = [model.joints[j] for j in movable_joints(model)]
        lower = [self.lower[j.idx_q] if j.nq == 1 else -np.inf for j in joints]
        upper = [self.upper[j.idx_q] if j.nq == 1 else np.inf for j in joints]
        return np.array(lower), np.array(upper)

    def random_configuration(self, rng: np.random.Generator) -> Array:
        """Draw a configuration uniformly within the limits, shape (nq,).

        Where a limit is missing, π rad (or 1 m) beyond `neutral` takes its place.

        Args:
            rng: Source of randomness.
        """
        model = self.raw_dynamics.model
        q = np.array(self.neutral)
        for j in movable_joints(model):
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
        return self._with_model(self.raw_dynamics.model)

    def with_payload(
        self,
        mass: float,
        com: ArrayLike = (0.0, 0.0, 0.0),
        inertia: ArrayLike | None = None,
        frame: str | None = None,
    ) -> ArmModel:
        """Return a copy with a rigid payload.

        Args:
            mass: Mass [kg], at least 0.
            com: Centre of mass in the frame's axes, shape (3,) [m].
            inertia: Rotational inertia about the centre of mass in the frame's axes, shape (3, 3) [kg·m²]; a point
                mass by default.
            frame: Frame that the payload is fixed to; the tool frame by default.

        Raises:
            ParameterError: Negative mass, or an inertia that is not symmetric positive semi-definite.
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
            ParameterError: Not a positive number.
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
            ParameterError: A negative or non-finite coefficient.
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
            ParameterError: A negative or non-finite entry.
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
            if self.nq != self.nv and np.shape(q) == (self.nv,):
                hint += "; arm.integrate(arm.zero, q) makes one of joint positions"
            raise DimensionError(name, f"{error.expected}; {hint}", error.actual) from None
        if self.nq != self.nv and not pin.isNormalized(self.raw_dynamics.model, q, 1e-6):
            words = "a configuration whose continuous joints are (cos, sin) pairs of unit length"
            raise DimensionError(name, words, f"{q}")
        return q

    def _per_joint(self, name: str, value: ArrayLike) -> Array:
        given = gain(name, value, "non-negative", lambda x: x >= 0.0)
        return np.array(per_joint(name, given, self.nv))

    def _with_model(self, model: pin.Model) -> ArmModel:
        return ArmModel(model, **self._labels())

    def _labels(self) -> dict[str, Any]:
        names = ("name", "tool_frame", "notes", "description")
        return {name: getattr(self, name) for name in names}

    def _frame_id(self, frame: str | None) -> int:
        frame = self.tool_frame if frame is None else frame
        frame_id = self.raw_dynamics.frame_ids.get(frame)
        if frame_id is None:
            raise ModelError(
                f"'{self.name}' has no frame '{frame}'"
                f"{suggest(frame, _likely_first(self.raw_dynamics.model))}"
            )
        return frame_id

    unchecked = renamed_attribute("unchecked", "raw_dynamics")


def _check_joints(model: pin.Model) -> None:
    movable = movable_joints(model)
    if not movable:
        raise ModelError(f"'{model.name}' has no movable joint: nothing to control")
    wide = [model.names[j] for j in movable if model.nvs[j] != 1]
    if wide:
        raise UnsupportedJointError(
            wide,
            "only joints with one degree of freedom can be controlled; weld it with lock=(...)",
        )


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
        raise ParameterError("mass", mass, "a single number")
    return float(array)


def _rotational_inertia(inertia: ArrayLike) -> Array:
    matrix = real("inertia", inertia, "a matrix of shape (3, 3)")
    if matrix.shape != (3, 3):
        raise DimensionError("inertia", "a matrix of shape (3, 3)", f"shape {matrix.shape}")
    if not np.isfinite(matrix).all() or not np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-12):
        raise ParameterError("inertia", inertia, "finite and symmetric")
    if np.linalg.eigvalsh(matrix)[0] < -1e-12:
        raise ParameterError("inertia", inertia, "positive semi-definite")
    return matrix


def _likely_first(model: pin.Model) -> list[str]:
    """Names of the frames, those at the tip first and joints last."""
    from_tip = reversed(list(model.frames))
    return [f.name for f in sorted(from_tip, key=lambda f: f.type == pin.FrameType.JOINT)]
