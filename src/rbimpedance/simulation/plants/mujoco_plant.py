"""Rigid links by MuJoCo: an engine that shares no code with the controller's dynamics, with contact of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..._common.arrays import Array, positive_number
from ..._common.brief import brief_repr
from ..._common.frozen import set_fields
from ...exceptions import ModelError, ParameterError
from ...interaction import Interaction
from ...robot.arm_model import ArmModel
from .mujoco_model import MujocoModel, mujoco_library, mujoco_model
from .protocol import Motion

AGREEMENT = 1e-9
"""Largest relative difference from Pinocchio with which a plant is built."""

_STATES = 3  # random ones, at which it is compared


class MujocoState(NamedTuple):
    """All that MuJoCo's next step depends on.

    Attributes:
        position: Angle or displacement of every joint from its zero, shape (nv,) [rad or m].
        velocity: Its rate, shape (nv,) [rad/s or m/s].
        warm_start: Acceleration at which the solver of the constraints begins, in MuJoCo's order, shape (nv,).
        contact: Joint torque of the contacts in the step that led here, shape (nv,) [N·m or N]; zero at the start.
    """

    position: Array
    velocity: Array
    warm_start: Array
    contact: Array


@brief_repr()
@dataclass(frozen=True, eq=False)
class MujocoPlant:
    """Rigid links, moved by MuJoCo (optional extra "mujoco"), which reads the arm's URDF with a reader of its own.

    A step is one of `mj_step` without its resets: semi-implicit Euler with viscous friction at the end of the step,
    MuJoCo's default, which is what ABA does where friction is stiff. Coulomb friction is MuJoCo's `frictionloss`, a
    constraint, where `ArmModel` smooths it by tanh. Position limits are soft constraints, effort limits clip the
    motors' torque. Velocity limits have no counterpart. Links do not touch each other; the only contact is between a
    sphere around the tool frame's origin and the geoms of a scene.

    At construction it is compared with Pinocchio at random states; M, bias or tool Jacobian that differ by more than
    `AGREEMENT` are refused. Two threads must not share one plant.

    Attributes:
        arm: The links.
        limits: Whether position and effort limits act.
        scene: MJCF text with geoms that are fixed in the world: <mujoco> with <compiler>, <default>, <asset>,
            <worldbody>. Options are the engine's.
        tool_radius: Radius of the sphere [m]; given with a scene, and only then.
        version: MuJoCo's; part of a run's provenance.

    Raises:
        MissingExtraError: MuJoCo is not installed.
        UnsupportedJointError: A joint of the arm follows another one.
        ModelError: The arm has no URDF, MuJoCo does not read it or the scene, or it reads another arm; names the joint.
        ParameterError: A scene without a radius, a radius without a scene, or one that is not positive.
    """

    arm: ArmModel
    limits: bool = field(default=True, kw_only=True)
    scene: str | None = field(default=None, kw_only=True)
    tool_radius: float | None = field(default=None, kw_only=True)
    version: str = field(init=False, repr=False)
    _built: MujocoModel = field(init=False, repr=False)
    _data: Any = field(init=False, repr=False)
    _zero: Array = field(init=False, repr=False)
    _contact_kinds: tuple[int, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        _check_scene(self.scene, self.tool_radius)
        arm, mj = self.arm.copy(), mujoco_library()
        built = mujoco_model(arm, self.limits, self.scene, self.tool_radius)
        kinds = ("FRICTIONLESS", "PYRAMIDAL", "ELLIPTIC")
        set_fields(
            self,
            arm=arm,
            version=str(mj.__version__),
            _built=built,
            _data=mj.MjData(built.model),
            _zero=arm.zero,
            _contact_kinds=tuple(
                int(getattr(mj.mjtConstraint, f"mjCNSTR_CONTACT_{kind}")) for kind in kinds
            ),
        )
        _compare(self)

    def __reduce__(self) -> tuple[Callable[..., MujocoPlant], tuple[ArmModel]]:
        again = partial(
            MujocoPlant, limits=self.limits, scene=self.scene, tool_radius=self.tool_radius
        )
        return again, (self.arm,)

    @property
    def replaced(self) -> tuple[str, ...]:
        """Joints whose body or placement is the arm's, since MuJoCo read another; none for a sound arm as loaded."""
        return self._built.replaced

    # --- a plant ------------------------------------------------------------------------------------------------

    def begin(self, q: Array, v: Array, h: float) -> MujocoState:
        """Return the state at the start of a run; see `Plant.begin`."""
        del h
        rest = np.zeros(self.arm.nv)
        return MujocoState(self.arm.raw_dynamics.difference(self._zero, q), np.array(v), rest, rest)

    def motion(self, state: MujocoState) -> Motion:
        """Return how the links move; see `Plant.motion`."""
        return Motion(self.arm.raw_dynamics.integrate(self._zero, state.position), state.velocity)

    def measured(self, state: MujocoState) -> Motion:
        """Return how the links move: the encoders are on them."""
        return self.motion(state)

    def external_torque(self, state: MujocoState, environment: Interaction, t: float) -> Array:
        """Return what the environment does, and MuJoCo's contacts did in the step before; see `Plant.external_torque`.

        The force of a rigid contact depends on the torque of the motors, so that there is none at an instant: it is
        that of the last physics step, which a force sensor would have read. Limits and friction are no part of it.
        """
        torque: Array = environment.torque(self.arm, t, *self.motion(state)) + state.contact
        return torque

    def acceleration(self, state: MujocoState, tau: Array, tau_ext: Array) -> Array:
        """Return MuJoCo's acceleration under `tau_ext`, which has the contacts in it; see `Plant.acceleration`."""
        option = self._built.model.opt
        flags = option.disableflags
        option.disableflags = flags | int(mujoco_library().mjtDisableBit.mjDSBL_CONTACT)
        self._forward(state, tau, tau_ext)
        option.disableflags = flags
        return self._of_arm(self._data.qacc)

    def step(
        self, state: MujocoState, tau: Array, environment: Interaction, t: float, h: float
    ) -> MujocoState:
        """Return the state after one step of MuJoCo; see `Plant.step`."""
        model, data, mj = self._built.model, self._data, mujoco_library()
        model.opt.timestep = h
        self._forward(state, tau, environment.torque(self.arm, t, *self.motion(state)))
        contact = self._contact_torque()
        mj.mj_Euler(model, data)
        return MujocoState(
            self._of_arm(data.qpos),
            self._of_arm(data.qvel),
            np.array(data.qacc_warmstart),
            contact,
        )

    # --- its dynamics -------------------------------------------------------------------------------------------

    def mass_matrix(self, q: Array) -> Array:
        """Return MuJoCo's M(q), armature included, shape (nv, nv) [kg·m² and alike].

        Args:
            q: Configuration, shape (nq,).
        """
        model, dofs = self._built.model, self._built.dofs
        self._forward(self.begin(q, np.zeros(self.arm.nv), 0.0))
        columns = np.eye(model.nv)
        for column in columns:
            mujoco_library().mj_mulM(model, self._data, column, column.copy())
        M: Array = columns[np.ix_(dofs, dofs)]
        return M

    def bias(self, q: Array, v: Array) -> Array:
        """Return MuJoCo's C(q, v) v + g(q) + viscous friction, shape (nv,) [N·m or N].

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,) [rad/s or m/s].
        """
        self._forward(self.begin(q, v, 0.0))
        return self._of_arm(self._data.qfrc_bias - self._data.qfrc_passive)

    def jacobian(self, q: Array) -> Array:
        """Return MuJoCo's Jacobian of the tool frame in world axes, linear rows first, shape (6, nv).

        Args:
            q: Configuration, shape (nq,).
        """
        model, data, body = self._built.model, self._data, self._built.tool_body
        self._forward(self.begin(q, np.zeros(self.arm.nv), 0.0))
        point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ self._built.tool_point
        linear, angular = np.zeros((2, 3, model.nv))
        mujoco_library().mj_jac(model, data, linear, angular, point, body)
        J: Array = np.concatenate([linear, angular])[:, self._built.dofs]
        return J

    # --- MuJoCo's vectors ---------------------------------------------------------------------------------------

    def _forward(
        self, state: MujocoState, tau: Array | float = 0.0, tau_ext: Array | float = 0.0
    ) -> None:
        """Let MuJoCo find the accelerations of a state."""
        data, dofs = self._data, self._built.dofs
        data.qpos[dofs], data.qvel[dofs] = state.position, state.velocity
        data.qacc_warmstart[:] = state.warm_start
        data.ctrl[:] = tau  # one motor a joint, in the order of the arm
        data.qfrc_applied[dofs] = tau_ext
        mujoco_library().mj_forward(self._built.model, data)

    def _contact_torque(self) -> Array:
        """Joint torque of the contact constraints alone, shape (nv,)."""
        data = self._data
        if not data.ncon:
            return np.zeros(self.arm.nv)
        is_contact = np.isin(data.efc_type, self._contact_kinds)
        torque = np.zeros(self._built.model.nv)
        force = np.where(is_contact, data.efc_force, 0.0)
        mujoco_library().mj_mulJacTVec(self._built.model, data, torque, force)
        return self._of_arm(torque)

    def _of_arm(self, vector: Any) -> Array:
        """A copy of a vector of MuJoCo's in the order of the arm's joints."""
        copy: Array = vector[self._built.dofs]
        return copy


def differences(
    plant: MujocoPlant, rng: np.random.Generator
) -> tuple[tuple[str, Array], tuple[str, Array], tuple[str, Array]]:
    """Return by how much MuJoCo's M, bias and tool Jacobian differ from Pinocchio's at a random state, joint by joint.

    Each is relative: a row of M to its largest entry, bias and Jacobian to theirs. Coulomb friction is left out.

    Args:
        plant: The plant.
        rng: Source of randomness.

    Returns:
        Each one's name with its differences, shape (nv,).
    """
    arm = plant.arm.with_friction(coulomb=0.0)
    q, v = arm.random_configuration(rng), rng.standard_normal(arm.nv)
    M, bias, J = arm.mass_matrix(q), arm.bias(q, v), arm.jacobian(q)
    return (
        ("mass matrix", np.abs(plant.mass_matrix(q) - M).max(axis=1) / np.abs(M).max(axis=1)),
        ("bias", _relative(plant.bias(q, v) - bias, bias)),
        ("tool Jacobian", _relative(plant.jacobian(q) - J, J).max(axis=0)),
    )


def _relative(difference: Array, whole: Array) -> Array:
    share: Array = np.abs(difference) / max(np.abs(whole).max(), np.finfo(np.float64).tiny)
    return share


def _compare(plant: MujocoPlant) -> None:
    """Refuse a plant that is not the arm.

    Raises:
        ModelError: M, bias or tool Jacobian differ; names the joint.
    """
    rng = np.random.default_rng(0)
    for name, share in (pair for _ in range(_STATES) for pair in differences(plant, rng)):
        if not (share <= AGREEMENT).all():
            joint = plant.arm.joint_names[int(np.argmax(share))]
            raise ModelError(
                f"MuJoCo and Pinocchio read '{plant.arm.name}' differently: their {name} differs by {share.max():.1e}, "
                f"most at joint '{joint}'; tolerance {AGREEMENT:g}"
            )


def _check_scene(scene: str | None, tool_radius: float | None) -> None:
    if (scene is None) != (tool_radius is None):
        raise ParameterError("tool_radius", tool_radius, "given only together with scene=")
    if tool_radius is not None:
        positive_number("tool_radius", tool_radius, "radius in metres")
