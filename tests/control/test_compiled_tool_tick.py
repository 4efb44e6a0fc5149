"""The compiled ticks of `CartesianController` are those of its NumPy form, along runs and in every branch."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.control.cartesian import CartesianOutput, CartesianState
from rbimpedance.control.cartesian_defaults import tool_surface

from .test_cartesian import (
    ANGLES,
    AXES,
    DT,
    MASS,
    STIFFNESS,
    gantry,
    motion,
    panda,
    ur5,
    with_panda_links,
    wrench_at,
)
from .test_cartesian import ARMS as ARMS_OF_SIX_AND_SEVEN
from .test_cartesian import seven_with_continuous_joints as continuous

Array = NDArray[np.float64]
COMPILED = ("pinocchio", "compiled")


def on_a_rail() -> rbi.ArmModel:
    """Eight joints: a panda on a rail, with a null space of two dimensions."""
    rail = pin.Model()
    rail.addJoint(0, pin.JointModelPY(), pin.SE3.Identity(), "rail")
    rail.appendBodyToJoint(1, pin.Inertia.Random(), pin.SE3.Identity())
    return with_panda_links(rail, [pin.JointModelRZ() for _ in range(7)], "rail")


ARMS = {**ARMS_OF_SIX_AND_SEVEN, "rail": on_a_rail, "gantry": gantry}
START = {**ANGLES, "rail": [0.1, *ANGLES["panda"]], "gantry": [0.3, -0.2, 0.1]}


def differences(
    arm: rbi.ArmModel, backend: rbi.control.protocol.Backend, start: Any, **parts: Any
) -> tuple[float, list[CartesianOutput]]:
    """Largest difference of any output from NumPy's along a run of 60 ticks, and the outputs of the run.

    It begins `away` from the motion: a last digit of an e1 that is zero is 1e-7 in the slope of a power surface.
    """
    away = parts.pop("away", 0.0)
    target = rbi.CartesianImpedance(MASS, STIFFNESS, axes=parts.pop("axes", "world"))
    slow = rbi.CartesianController(arm, target, dt=DT, backend="numpy", **parts)
    fast = rbi.CartesianController(arm, target, dt=DT, backend=backend, **parts)
    plant, q = arm.with_payload(1.0), arm.integrate(arm.zero, start)
    first, v, state, apart, outputs = q, np.zeros(arm.nv), fast.init(), 0.0, []
    q = arm.integrate(q, np.full(arm.nv, away))
    for k in range(60):
        given = q, v, motion(arm, first, k * DT), 3.0 * wrench_at(k * DT)
        truth, _ = slow.step(CartesianState(*state), *given)
        output, state = fast.step(state, *given)
        for mine, known in zip(flat(output), flat(truth), strict=True):
            scale = max(1.0, float(np.abs(known).max(initial=0.0)))
            apart = max(apart, float(np.abs(mine - known).max(initial=0.0)) / scale)
        outputs.append(output)
        tau_ext = output.jacobian.T @ given[3]
        v = v + DT * plant.forward_dynamics(q, v, output.tau, tau_ext)
        q = arm.integrate(q, DT * v)
    return apart, outputs


def flat(output: CartesianOutput) -> list[Array]:
    """All numbers of an output, truth values as 0 and 1."""
    values = list(output)
    (R, p), reference = output.pose, output.reference
    values[1:3] = [R, p, *reference.pose, reference.v, reference.a]
    return [np.asarray(value, dtype=np.float64) for value in values]


@pytest.mark.parametrize("backend", COMPILED)
@pytest.mark.parametrize("name", ARMS)
def test_compiled_ticks_are_those_of_numpy(name: str, backend: Any) -> None:
    apart, outputs = differences(ARMS[name](), backend, START[name])
    assert apart < 1e-9
    assert type(outputs[-1]) is not CartesianOutput


@pytest.mark.parametrize("axes", ["reference", "turned"])
def test_compiled_ticks_turn_their_axes_as_numpy(axes: str) -> None:
    apart, _ = differences(ur5(), "compiled", START["ur5"], axes=AXES[axes])
    assert apart < 1e-9


@pytest.mark.parametrize(
    ("name", "start"),
    [
        ("ur5", [0.0, -1.2, 1.6, -1.9, -0.03, 0.3]),
        ("panda", [0.0, 0.5, 1.5, -0.1, 1.5, 0.05, 0.0]),
        ("rail", [0.0, 1.57, 0.0, 1.57, -0.1, 0.0, 1.57, 0.0]),
    ],
)
def test_compiled_ticks_are_damped_as_numpy(name: str, start: Any) -> None:
    apart, outputs = differences(ARMS[name](), "compiled", start, joint_limits=False)
    assert max(float(output.lost.max()) for output in outputs) > 0.1
    assert apart < 1e-9


@pytest.mark.parametrize("backend", COMPILED)
def test_compiled_ticks_keep_limits_as_numpy(backend: Any) -> None:
    arm, limits = panda(), rbi.Limits(effort=[40.0, 30, 40, 20, 12, 12, 12], rate=4e3)
    start = [0.0, -0.5, 0.1, -2.0, 0.05, 1.6, 2.89]  # the last joint is at its stop
    apart, outputs = differences(arm, backend, start, limits=limits)
    for flag in ("saturated", "rate_limited", "joint_limited"):
        assert any(getattr(output, flag).any() for output in outputs)
    assert apart < 1e-9


@pytest.mark.parametrize("scheme", ["explicit", "implicit"])
def test_compiled_ticks_know_other_surfaces_and_schemes(scheme: Any) -> None:
    gains = np.repeat([18.0, 35.0], 3), np.repeat([60.0, 200.0], 3)
    parts = rbi.PowerSurface(6.0, 1.4), rbi.SuperTwisting(*gains, scheme)
    null = rbi.Posture(
        None, rbi.FastTerminalSurface(2.0, 1.0), rbi.SuperTwisting(15.0, 40.0, scheme)
    )
    apart, _ = differences(
        panda(),
        "compiled",
        START["panda"],
        **dict(zip(("surface", "reaching"), parts, strict=True)),
        posture=null,
        limits=30.0,
        away=0.02,
    )
    assert apart < 1e-9


@pytest.mark.parametrize("backend", COMPILED)
def test_state_of_a_compiled_tick_is_that_of_numpy(backend: Any) -> None:
    arm = continuous()
    slow, fast = (rbi.CartesianController(arm, dt=DT, backend=b) for b in ("numpy", backend))
    q, v, states = arm.integrate(arm.zero, START["continuous"]), np.full(7, 0.1), []
    for controller in (slow, fast):
        state = controller.init()
        for k in range(3):
            given = q, v, motion(arm, q, k * DT), wrench_at(k * DT + 0.2)
            _, state = controller.step(state, *given)
        states.append(state)
    truth, packed = states
    restored = pickle.loads(pickle.dumps(packed))
    assert type(restored) is CartesianState
    assert restored.ticks == packed.ticks == 3
    for mine, known in zip(leaves(packed), leaves(truth), strict=True):
        assert_allclose(mine, known, atol=1e-9)
    late = fast.elapsed(packed, 2.0 * DT)
    assert_allclose(late.tool.z, slow.elapsed(truth, 2.0 * DT).tool.z, atol=1e-12)
    output, _ = fast.step(late, *given)
    again, _ = fast.step(packed, *given, period=2.0 * DT)
    assert output.tau.tobytes() == again.tau.tobytes()


def leaves(state: Any) -> list[Array]:
    """All arrays of a state."""
    return [
        np.asarray(leaf, dtype=np.float64)
        for part in state
        for leaf in (part if isinstance(part, tuple) and hasattr(part, "_fields") else [part])
    ]


def test_arrays_in_any_order_and_kind_give_the_same_tick() -> None:
    arm = ur5()
    controller = rbi.CartesianController(arm, dt=DT)
    q, v, f = arm.integrate(arm.zero, START["ur5"]), np.full(6, 0.1), wrench_at(0.2)
    there = motion(arm, q, 0.1)
    usual, _ = controller.step(controller.init(), q, v, there, f)
    turned = there._replace(pose=rbi.Pose(np.asfortranarray(there.pose.rotation), there.pose[1]))
    other, state = controller.step(controller.init(), q.tolist(), v[::1], turned, f.tolist())
    assert other.tau.tobytes() == usual.tau.tobytes()
    assert state.ticks == 1


def test_null_space_that_jumps_is_left_to_numpy() -> None:
    """A state of another configuration: the compiled tick leaves it to NumPy's."""
    arm = panda()
    slow, fast = (rbi.CartesianController(arm, dt=DT, backend=b) for b in ("numpy", "pinocchio"))
    q, v, f = arm.integrate(arm.zero, START["panda"]), np.zeros(7), np.zeros(6)
    there = motion(arm, q, 0.0)
    _, state = fast.step(fast.init(), q, v, there, f)
    basis = np.roll(state.basis, 2, axis=0)
    moved = state._replace(basis=basis)
    mine, known = (each.step(moved, q, v, there, f)[0].tau for each in (fast, slow))
    assert_allclose(mine, known, atol=1e-9)


def test_unknown_backend_is_refused() -> None:
    wrong: Any = "fortran"
    with pytest.raises(rbi.ParameterError, match="backend"):
        rbi.CartesianController(ur5(), backend=wrong)


def test_surface_of_ones_own_is_computed_by_numpy() -> None:
    class Own(rbi.FastTerminalSurface):
        def value(self, e1: Array, e2: Array) -> Array:
            return 2.0 * super().value(e1, e2)

    arm = ur5()
    own = Own(5.0, 3.0)
    assert tool_surface(own).gamma.shape == (6,)
    reaching = rbi.SuperTwisting(20.0, 60.0)
    ticks = []
    for backend in ("numpy", "compiled"):
        controller = rbi.CartesianController(arm, None, own, reaching, DT, backend=backend)
        q = arm.integrate(arm.zero, START["ur5"])
        output, _ = controller.step(
            controller.init(), q, np.zeros(6), motion(arm, q, 0.0), wrench_at(0.2)
        )
        ticks.append(output.tau)
    assert ticks[0].tobytes() == ticks[1].tobytes()
