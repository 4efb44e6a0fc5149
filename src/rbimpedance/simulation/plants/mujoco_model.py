"""An `ArmModel` as a MuJoCo model: its URDF by MuJoCo's own reader, and what the arm has otherwise."""

from __future__ import annotations

from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from ..._common.arrays import Array
from ...exceptions import MissingExtraError, ModelError, UnsupportedJointError
from ...robot.arm_model import ArmModel
from ...robot.loading.plain_urdf import DROPPED, plain
from ...robot.loading.strict_xml import read_xml
from ...robot.loading.urdf_document import MOVABLE
from ...robot.rigid_bodies import RigidBodies

SAME = 1e-9
"""Relative difference up to which MuJoCo has read the same body as Pinocchio."""

SCENE = ("compiler", "default", "asset", "worldbody")
"""What a scene may hold; options are the engine's, and all else would move."""

_LEAST = 1e-14  # mass [kg] and inertia [kg·m²] of a body that has none, which MuJoCo would refuse to read
_FAR = 1e10  # a limit that is none, MuJoCo's largest number


class MujocoModel(NamedTuple):
    """A MuJoCo model, and where the arm is in it.

    Attributes:
        model: The `mujoco.MjModel`.
        dofs: Index of every joint of the arm in MuJoCo's vectors, shape (nv,).
        tool_body: Number of the body that the tool frame is fixed to.
        tool_point: Origin of the tool frame in that body, shape (3,) [m].
        replaced: Joints whose body or placement MuJoCo had read otherwise than the arm has it.
    """

    model: Any
    dofs: NDArray[np.int64]
    tool_body: int
    tool_point: Array
    replaced: tuple[str, ...]


def mujoco_library() -> Any:
    """Return the module `mujoco`, imported on first use.

    Raises:
        MissingExtraError: It is not installed.
    """
    try:
        return import_module("mujoco")
    except ImportError as error:
        raise MissingExtraError("MujocoPlant", "mujoco") from error


def mujoco_model(
    arm: ArmModel, limits: bool, scene: str | None, tool_radius: float | None
) -> MujocoModel:
    """Build the model of an arm; arguments and errors are those of `MujocoPlant`."""
    joint, tool_point = _tool(arm)
    model = _compiled(arm, scene, tool_radius, joint, tool_point)
    numbers = [model.joint(name).id for name in arm.joint_names]
    bodies = model.jnt_bodyid[numbers]
    _set_engine(model, arm)
    _set_joints(model, arm, numbers, limits)
    return MujocoModel(
        model=model,
        dofs=np.array(model.jnt_dofadr[numbers], dtype=np.int64),
        tool_body=0 if joint is None else int(model.jnt_bodyid[model.joint(joint).id]),
        tool_point=tool_point,
        replaced=_replace_bodies(model, arm, bodies, numbers),
    )


# --- what MuJoCo reads ------------------------------------------------------------------------------------------


def _compiled(
    arm: ArmModel,
    scene: str | None,
    tool_radius: float | None,
    joint: str | None,
    tool_point: Array,
) -> Any:
    """Let MuJoCo read the URDF and the scene; friction, meshes and collision shapes of the arm are left out."""
    mj, text = mujoco_library(), _urdf(arm)
    try:
        spec = mj.MjSpec.from_string(text)
        _set_compiler(mj, spec)
        for name in arm.joint_names:
            spec.add_actuator(name=name, target=name, trntype=mj.mjtTrn.mjTRN_JOINT)
        if tool_radius is not None:
            body = spec.worldbody if joint is None else _joint(spec, joint).parent
            body.add_geom(
                name="tool",
                type=mj.mjtGeom.mjGEOM_SPHERE,
                size=[tool_radius, 0.0, 0.0],
                pos=tool_point,
                priority=-1,  # friction and softness are the scene's
            )
        model = spec.compile() if scene is None else _with_scene(mj, spec, scene).compile()
    except (ValueError, mj.FatalError) as error:
        raise ModelError(f"MuJoCo does not read '{arm.name}': {error}") from error
    if model.nv != arm.nv or model.neq:
        raise ModelError("scene: it has moving bodies; MujocoPlant supports fixed geoms only")
    return model


def _urdf(arm: ArmModel) -> str:
    """The arm's URDF with the joints fixed that it does not have.

    Raises:
        ModelError: There is none.
        UnsupportedJointError: A joint of the arm follows another one.
    """
    model = arm.raw_dynamics.model
    if following := [model.names[j] for j in model.mimicking_joints]:
        raise UnsupportedJointError(
            following,
            "follows another joint, which MujocoPlant does not support; load with lock=(...)",
        )
    if arm.description is None:
        raise ModelError(
            f"'{arm.name}' has no URDF, which MuJoCo is to read: load it from a file, or simulate the ArmModel itself"
        )
    joints = read_xml(arm.description.xml, arm.name).iterfind("joint")
    movable = {str(joint.get("name")) for joint in joints if joint.get("type") in MOVABLE}
    fixed = movable.difference(arm.joint_names)
    return plain(arm.description.xml, fixed, (*DROPPED, "limit"))


def _set_compiler(mj: Any, spec: Any) -> None:
    """Merge fixed links with their parents, and accept every inertia: what differs is replaced."""
    compiler = spec.compiler
    compiler.fusestatic = True
    compiler.inertiafromgeom = mj.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    compiler.boundmass = compiler.boundinertia = _LEAST
    compiler.balanceinertia = True


def _with_scene(mj: Any, spec: Any, scene: str) -> Any:
    """Attach a scene to the world.

    Raises:
        ModelError: It is not MJCF, or contains moving parts.
    """
    root = read_xml(scene, "scene")
    if root.tag != "mujoco":
        raise ModelError(f"scene: must be MJCF, with <mujoco> as its root, not <{root.tag}>")
    tags = [str(element.tag) for element in root]
    if others := [tag for tag in tags if tag not in SCENE]:
        raise ModelError(
            f"scene: <{others[0]}> is not supported, only {', '.join(f'<{t}>' for t in SCENE)}"
        )
    text = etree.tostring(root, encoding="unicode")
    frame = spec.worldbody.add_frame()
    spec.attach(mj.MjSpec.from_string(text), frame=frame, prefix="scene/")
    return spec


def _joint(spec: Any, name: str) -> Any:
    return next(joint for joint in spec.joints if joint.name == name)


def _tool(arm: ArmModel) -> tuple[str | None, Array]:
    """Joint that carries the tool frame (None: the base), and the frame's origin in its axes."""
    model = arm.raw_dynamics.model
    frame = model.frames[arm.raw_dynamics.frame_ids[arm.tool_frame]]
    joint = None if frame.parentJoint == 0 else str(model.names[frame.parentJoint])
    return joint, np.array(frame.placement.translation)


# --- what the arm has otherwise ---------------------------------------------------------------------------------


def _set_engine(model: Any, arm: ArmModel) -> None:
    """Gravity, and no reset of a diverging state: the run reports it."""
    model.opt.gravity = arm.rigid_bodies().gravity
    model.opt.disableflags |= int(mujoco_library().mjtDisableBit.mjDSBL_AUTORESET)


def _set_joints(model: Any, arm: ArmModel, numbers: list[int], limits: bool) -> None:
    """Friction, armature and limits; one motor a joint, in the order of the arm's joints."""
    dofs = model.jnt_dofadr[numbers]
    model.dof_armature[dofs] = arm.armature
    model.dof_damping[dofs] = arm.viscous
    model.dof_frictionloss[dofs] = arm.coulomb
    lower, upper = arm.joint_limits()
    model.jnt_actfrclimited[numbers] = False
    model.jnt_limited[numbers] = limits & (np.isfinite(lower) | np.isfinite(upper))
    model.jnt_range[numbers] = np.clip(np.column_stack([lower, upper]), -_FAR, _FAR)
    effort = np.clip(arm.effort_limit, 0.0, _FAR)
    model.actuator_forcelimited[:] = limits & np.isfinite(arm.effort_limit)
    model.actuator_forcerange[:] = np.column_stack([-effort, effort])


def _replace_bodies(
    model: Any, arm: ArmModel, numbers: NDArray[np.int64], joints: list[int]
) -> tuple[str, ...]:
    """Give the arm's bodies and placements to the joints where MuJoCo read others; return their names."""
    mj, bodies = mujoco_library(), arm.rigid_bodies()
    read = _read(model, numbers, joints)
    replaced = [i for i in range(arm.nv) if not _is_same(read, bodies, i)]
    for i in replaced:
        moments, axes = np.linalg.eigh(bodies.inertia[i])
        axes[:, 0] *= np.linalg.det(axes)
        body = numbers[i]
        model.body_mass[body], model.body_inertia[body] = bodies.mass[i], moments
        model.body_ipos[body], model.body_pos[body] = bodies.com[i], bodies.translation[i]
        mj.mju_mat2Quat(model.body_iquat[body], axes.ravel())
        mj.mju_mat2Quat(model.body_quat[body], bodies.rotation[i].ravel())
        model.jnt_axis[joints[i]] = bodies.axis[i]
        model.body_sameframe[body] = mj.mjtSameFrame.mjSAMEFRAME_NONE
        model.body_simple[body] = 0
    if replaced:  # shortcuts of the engine that held for what it had read
        model.geom_sameframe[:] = mj.mjtSameFrame.mjSAMEFRAME_NONE
        model.dof_simplenum[:] = 0
    mj.mj_setConst(model, mj.MjData(model))  # what follows from inertia and armature
    return tuple(arm.joint_names[i] for i in replaced)


def _read(model: Any, numbers: NDArray[np.int64], joints: list[int]) -> RigidBodies:
    """What MuJoCo made of the URDF, in the form of the arm's own tables."""
    none = np.zeros(0, dtype=np.int64)
    axes = _matrices(model.body_iquat[numbers])
    moments = model.body_inertia[numbers][:, :, None] * np.eye(3)
    return RigidBodies(
        parent=none,
        q_index=none,
        q_size=none,
        rotation=_matrices(model.body_quat[numbers]),
        translation=model.body_pos[numbers],
        axis=model.jnt_axis[joints],
        slides=none.astype(np.bool_),
        mass=model.body_mass[numbers],
        com=model.body_ipos[numbers],
        inertia=axes @ moments @ axes.transpose(0, 2, 1),
        gravity=model.opt.gravity,
    )


def _matrices(quaternions: Array) -> Array:
    rotations = np.empty((len(quaternions), 9))
    for rotation, quaternion in zip(rotations, quaternions, strict=True):
        mujoco_library().mju_quat2Mat(rotation, quaternion)
    return rotations.reshape(-1, 3, 3)


def _is_same(read: RigidBodies, bodies: RigidBodies, i: int) -> bool:
    """Whether MuJoCo has read the body and the placement of a joint as the arm has them."""
    length = np.abs(bodies.translation).max() + np.abs(bodies.com).max()
    scales = {
        "rotation": 1.0,
        "axis": 1.0,
        "translation": length,
        "com": length,
        "mass": bodies.mass[i],
        "inertia": np.abs(bodies.inertia[i]).max(),
    }
    return all(
        np.abs(getattr(read, name)[i] - getattr(bodies, name)[i]).max() <= SAME * scale + _LEAST
        for name, scale in scales.items()
    )
