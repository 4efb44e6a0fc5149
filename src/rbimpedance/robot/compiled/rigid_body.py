"""Inverse and forward dynamics as recursions over the joints, each one pass per loop.

Sources: R. Featherstone, Rigid Body Dynamics Algorithms, 2008: Table 5.1 (recursive Newton-Euler), Table 6.2 (composite
rigid bodies), Table 7.1 (articulated bodies). Gravity enters as an acceleration of the base. Friction is the caller's.

Inverse dynamics works in the joints' own axes: every vector is turned from joint to joint, but inertias are constant.
Forward dynamics and the mass matrix work in world axes at the joints' own origins: inertias are turned once, from joint
to joint everything is only shifted. (At the origin of the world not even that, but light wrists far from it lose three
digits.)
"""

from __future__ import annotations

import math

from ..._common.arrays import Array
from ..._numba.compile import fused, routine
from ..._numba.lanes import any_of
from ..pinocchio_dynamics import COULOMB_SMOOTHING
from .spatial import (
    Inertia,
    Matrix,
    SpatialMotion,
    Vector,
    add,
    add_cross_z,
    add_inertia,
    add_pair,
    add_z,
    apply,
    congruence,
    cosines_and_sines,
    cross,
    cross_force,
    dot,
    get_inertia,
    get_matrix,
    get_pair,
    get_symmetric,
    get_vector,
    power,
    product,
    put_inertia,
    put_matrix,
    put_pair,
    put_vector,
    rigid_inertia,
    rigid_momentum,
    rotate,
    scale,
    scale_pair,
    shift_force,
    shift_inertia,
    shift_motion,
    transform,
    turn_about_z,
    unrotate,
    without_direction,
    z_axis,
)
from .tables import (
    ARMATURE,
    CONTINUOUS,
    COULOMB,
    INERTIA,
    KIND,
    MASS,
    MOMENT,
    PARENT,
    PRISMATIC,
    Q_INDEX,
    ROTATION,
    TRANSLATION,
    VISCOUS,
    ArmTables,
    Workspace,
)

# Columns of `Workspace.rows`, which every routine here overwrites.
_PLACEMENT, _ORIGIN = (
    0,
    9,
)  # axes and origin of the joint from its parent, in its axes or the world's
_OMEGA, _OMEGA_RATE, _ACCELERATION = 12, 15, 18  # 3 each: inverse dynamics
_VARIATION, _FORCE, _MOMENT = 21, 30, 33  # 9, 3, 3

_SUBSPACE, _VELOCITY, _BIAS = 12, 18, 24  # 6 each: forward dynamics
_INERTIA, _BIAS_FORCE, _U = 30, 51, 57  # 21, 6, 6
_D_INVERSE, _RESIDUAL, _RATE = 63, 64, 65  # 1, 1, 6


@routine
def place_joints(arm: ArmTables, space: Workspace, q: Array) -> None:
    """Write position, cosine and sine of every joint.

    Args:
        arm: The arm.
        space: Where they go.
        q: Configuration, shape (nq,).
    """
    topology = arm.topology
    position, cos, sin = space.position, space.cos, space.sin
    for j in range(len(topology)):
        position[j] = q[topology[j, Q_INDEX]]
    cosines_and_sines(position, cos, sin)
    for j in range(len(topology)):
        if topology[j, KIND] == CONTINUOUS:
            i = topology[j, Q_INDEX]
            cos[j], sin[j] = q[i], q[i + 1]


@routine
def inverse_dynamics(arm: ArmTables, space: Workspace, v: Array, a: Array, tau: Array) -> None:
    """Write M a + C v + g, armature included, by the recursive Newton-Euler algorithm (Featherstone, Table 5.1).

    Accelerations are those of the joints' origins, so that velocities of origins are not needed (Luh, Walker, Paul,
    1980). With B = [ω̇]× + [ω]×[ω]×, a point at r of a link accelerates by a + B·r.

    Args:
        arm: The arm.
        space: Work space after `place_joints`.
        v: Velocity, shape (nv,).
        a: Acceleration, shape (nv,).
        tau: Where the torque goes, shape (nv,).
    """
    _move_bodies(arm, space, v, a)
    joints, topology, work = arm.joints, arm.topology, space.rows
    for j in range(len(joints) - 1, -1, -1):
        parent, slides = topology[j, PARENT], topology[j, KIND] == PRISMATIC
        force, torque = get_vector(work, j, _FORCE), get_vector(work, j, _MOMENT)
        tau[j] = (force[2] if slides else torque[2]) + joints[j, ARMATURE] * a[j]
        if parent >= 0:  # f_parent += R·f,  n_parent += R·n + r × R·f
            R, r = get_matrix(work, j, _PLACEMENT), get_vector(work, j, _ORIGIN)
            force = rotate(R, force)
            torque = add(rotate(R, torque), cross(r, force))
            put_vector(work, parent, _FORCE, add(get_vector(work, parent, _FORCE), force))
            put_vector(work, parent, _MOMENT, add(get_vector(work, parent, _MOMENT), torque))


@fused
def _move_bodies(arm: ArmTables, space: Workspace, v: Array, a: Array) -> None:
    """Write how every body moves, and the force and moment that this takes."""
    joints, topology, work = arm.joints, arm.topology, space.rows
    for j in range(len(joints)):
        parent, slides = topology[j, PARENT], topology[j, KIND] == PRISMATIC
        R, r = _placement(joints, j, slides, space)
        if parent < 0:
            omega, omega_rate = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
            acceleration = (-arm.gravity[0], -arm.gravity[1], -arm.gravity[2])
        else:
            omega = unrotate(R, get_vector(work, parent, _OMEGA))
            omega_rate = unrotate(R, get_vector(work, parent, _OMEGA_RATE))
            at_r = rotate(get_matrix(work, parent, _VARIATION), r)
            acceleration = add(get_vector(work, parent, _ACCELERATION), at_r)
        acceleration = unrotate(R, acceleration)
        if slides:  # a += q̈·z + 2·ω × q̇·z
            acceleration = add_z(add_cross_z(acceleration, omega, 2.0 * v[j]), a[j])
        else:  # ω̇ += q̈·z + ω × q̇·z,  ω += q̇·z
            omega_rate = add_z(add_cross_z(omega_rate, omega, v[j]), a[j])
            omega = add_z(omega, v[j])
        B = _variation(omega, omega_rate)
        put_matrix(work, j, _PLACEMENT, R)
        put_vector(work, j, _ORIGIN, r)
        put_vector(work, j, _OMEGA, omega)
        put_vector(work, j, _OMEGA_RATE, omega_rate)
        put_vector(work, j, _ACCELERATION, acceleration)
        put_matrix(work, j, _VARIATION, B)
        # f = m·a + B·(m·c),  n = I·ω̇ + ω × I·ω + (m·c) × a
        moment, inertia = get_vector(joints, j, MOMENT), get_symmetric(joints, j, INERTIA)
        force = add(scale(joints[j, MASS], acceleration), rotate(B, moment))
        torque = add(transform(inertia, omega_rate), cross(omega, transform(inertia, omega)))
        put_vector(work, j, _FORCE, force)
        put_vector(work, j, _MOMENT, add(torque, cross(moment, acceleration)))


@routine
def forward_dynamics(arm: ArmTables, space: Workspace, v: Array, tau: Array, a: Array) -> None:
    """Write the acceleration under the joint torques, by the articulated-body algorithm (Featherstone, Table 7.1).

    Args:
        arm: The arm.
        space: Work space after `place_joints`.
        v: Velocity, shape (nv,).
        tau: Sum of all joint torques, shape (nv,).
        a: Where the acceleration goes, shape (nv,).
    """
    _start_velocities(arm, space, v)
    _gather_inertias(arm, space, tau)
    topology, work = arm.topology, space.rows
    for j in range(len(topology)):  # a' = a_parent + c,  q̈ = D⁻¹·(u - Uᵀ·a'),  a = a' + S·q̈
        parent = topology[j, PARENT]
        rate = ((0.0, 0.0, 0.0), (-arm.gravity[0], -arm.gravity[1], -arm.gravity[2]))
        if parent >= 0:
            rate = shift_motion(get_pair(work, parent, _RATE), get_vector(work, j, _ORIGIN))
            rate = add_pair(rate, get_pair(work, j, _BIAS))
        a[j] = work[j, _D_INVERSE] * (work[j, _RESIDUAL] - power(rate, get_pair(work, j, _U)))
        put_pair(work, j, _RATE, add_pair(rate, scale_pair(a[j], get_pair(work, j, _SUBSPACE))))


@fused
def _start_velocities(arm: ArmTables, space: Workspace, v: Array) -> None:
    """Write velocity, velocity-product acceleration and bias force of every body (the table's first pass)."""
    topology, work = arm.topology, space.rows
    for j in range(len(topology)):  # v = v_parent + S·q̇,  c = v × S·q̇,  p = v ×* I·v
        parent, slides = topology[j, PARENT], topology[j, KIND] == PRISMATIC
        S, inertia = _subspace_and_inertia(arm, space, j)
        none = (0.0, 0.0, 0.0)
        velocity, bias = scale_pair(v[j], S), (none, none)
        if parent >= 0:
            before = get_pair(work, parent, _VELOCITY)
            before = shift_motion(before, get_vector(work, j, _ORIGIN))
            if slides:
                step = scale(v[j], S[1])
                velocity, bias = (before[0], add(before[1], step)), (none, cross(before[0], step))
            else:
                step = scale(v[j], S[0])
                velocity = add(before[0], step), before[1]
                bias = cross(before[0], step), cross(before[1], step)
        put_pair(work, j, _VELOCITY, velocity)
        put_pair(work, j, _BIAS, bias)
        put_pair(work, j, _BIAS_FORCE, cross_force(velocity, rigid_momentum(inertia, velocity)))


@fused
def _gather_inertias(arm: ArmTables, space: Workspace, tau: Array) -> None:
    """Write articulated inertia and bias force of every body, from the tips to the base (the second pass)."""
    joints, topology, work = arm.joints, arm.topology, space.rows
    for j in range(len(joints) - 1, -1, -1):
        parent, S = topology[j, PARENT], get_pair(work, j, _SUBSPACE)
        inertia, p = get_inertia(work, j, _INERTIA), get_pair(work, j, _BIAS_FORCE)
        if topology[j, KIND] == PRISMATIC:  # U = Iᴬ·S,  D = Sᵀ·U,  u = τ - Sᵀ·pᴬ
            U = rotate(inertia[1], S[1]), transform(inertia[2], S[1])
            D, residual = dot(S[1], U[1]), tau[j] - dot(S[1], p[1])
        else:
            U = transform(inertia[0], S[0]), unrotate(inertia[1], S[0])
            D, residual = dot(S[0], U[0]), tau[j] - dot(S[0], p[0])
        d_inverse = 1.0 / (D + joints[j, ARMATURE])
        put_pair(work, j, _U, U)
        work[j, _D_INVERSE], work[j, _RESIDUAL] = d_inverse, residual
        if parent >= 0:  # Iᵃ = Iᴬ - U·D⁻¹·Uᵀ,  pᵃ = pᴬ + Iᵃ·c + U·D⁻¹·u
            inertia = without_direction(inertia, U, d_inverse)
            p = add_pair(p, apply(inertia, get_pair(work, j, _BIAS)))
            p = add_pair(p, scale_pair(d_inverse * residual, U))
            r = get_vector(work, j, _ORIGIN)
            inertia = add_inertia(get_inertia(work, parent, _INERTIA), shift_inertia(inertia, r))
            p = add_pair(get_pair(work, parent, _BIAS_FORCE), shift_force(p, r))
            put_inertia(work, parent, _INERTIA, inertia)
            put_pair(work, parent, _BIAS_FORCE, p)


@routine
def mass_matrix(arm: ArmTables, space: Workspace, M: Array) -> None:
    """Write M(q), armature included, by the composite-rigid-body algorithm (Featherstone, Table 6.2).

    Args:
        arm: The arm.
        space: Work space after `place_joints`.
        M: Where it goes, shape (nv, nv).
    """
    joints, topology, work = arm.joints, arm.topology, space.rows
    n = len(joints)
    for j in range(n):
        _subspace_and_inertia(arm, space, j)
    M[:] = 0.0
    for j in range(n - 1, -1, -1):
        inertia = get_inertia(work, j, _INERTIA)
        F = apply(inertia, get_pair(work, j, _SUBSPACE))
        M[j, j] = power(get_pair(work, j, _SUBSPACE), F) + joints[j, ARMATURE]
        k, i = j, topology[j, PARENT]
        if i >= 0:
            moved = shift_inertia(inertia, get_vector(work, j, _ORIGIN))
            put_inertia(work, i, _INERTIA, add_inertia(get_inertia(work, i, _INERTIA), moved))
        while i >= 0:
            F = shift_force(F, get_vector(work, k, _ORIGIN))
            M[i, j] = power(get_pair(work, i, _SUBSPACE), F)
            M[j, i] = M[i, j]
            k, i = i, topology[i, PARENT]


@fused
def friction(joints: Array, j: int, v: float) -> float:
    """Friction torque of joint j; see `PinocchioDynamics`."""
    torque = joints[j, VISCOUS] * v
    if any_of(joints[j, COULOMB] != 0.0):
        torque += joints[j, COULOMB] * math.tanh(v / COULOMB_SMOOTHING)
    return torque  # type: ignore[no-any-return]


@fused
def _placement(joints: Array, j: int, slides: bool, space: Workspace) -> tuple[Matrix, Vector]:
    """Axes and origin of joint j in its parent."""
    R, r = get_matrix(joints, j, ROTATION), get_vector(joints, j, TRANSLATION)
    if slides:
        return R, add(r, scale(space.position[j], z_axis(R)))
    return turn_about_z(R, space.cos[j], space.sin[j]), r


@fused
def _variation(omega: Vector, rate: Vector) -> Matrix:
    """[ω̇]× + [ω]×[ω]×."""
    x, y, z = omega
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    return (
        -yy - zz, xy - rate[2], xz + rate[1],
        xy + rate[2], -xx - zz, yz - rate[0],
        xz - rate[1], yz + rate[0], -xx - yy,
    )  # fmt: skip


@fused
def _subspace_and_inertia(
    arm: ArmTables, space: Workspace, j: int
) -> tuple[SpatialMotion, Inertia]:
    """Write axes and origin of joint j, its motion subspace and its inertia, in world axes at its origin.

    The origin is given from the parent's. Subspace and inertia are also returned.
    """
    joints, work, parent = arm.joints, space.rows, arm.topology[j, PARENT]
    slides = arm.topology[j, KIND] == PRISMATIC
    R, r = _placement(joints, j, slides, space)
    if parent >= 0:
        R_parent = get_matrix(work, parent, _PLACEMENT)
        R, r = product(R_parent, R), rotate(R_parent, r)
    z, none = z_axis(R), (0.0, 0.0, 0.0)
    S = (none, z) if slides else (z, none)
    rotational = congruence(R, get_symmetric(joints, j, INERTIA))
    moment = rotate(R, get_vector(joints, j, MOMENT))
    inertia = rigid_inertia(joints[j, MASS], moment, rotational)
    put_matrix(work, j, _PLACEMENT, R)
    put_vector(work, j, _ORIGIN, r)
    put_pair(work, j, _SUBSPACE, S)
    put_inertia(work, j, _INERTIA, inertia)
    return S, inertia
