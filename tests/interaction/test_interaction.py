"""What pushes on the arm, against Jᵀ w written out and virtual work."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.interaction import FrameWrench, Interaction, JointTorque, as_interaction

Array = NDArray[np.float64]
WRENCH = np.array([1.0, -2.0, 3.0, 0.4, 0.5, -0.6])


def work(arm: rbi.ArmModel, q: Array, frame: str, axes: pin.ReferenceFrame) -> Array:
    """Power of WRENCH at unit speed of each joint, by Pinocchio's frame velocities."""
    model = arm.model
    data = model.createData()
    powers = []
    for v in np.eye(arm.nv):
        pin.forwardKinematics(model, data, q, v)
        twist = pin.getFrameVelocity(model, data, model.getFrameId(frame), axes)
        powers.append(float(WRENCH @ twist.vector))
    return np.array(powers)


@pytest.mark.parametrize("frame", ["tool", "carriage"])
@pytest.mark.parametrize(
    ("expressed_in", "axes"),
    [("world", pin.ReferenceFrame.LOCAL_WORLD_ALIGNED), ("local", pin.ReferenceFrame.LOCAL)],
)
def test_frame_wrench_is_the_joint_torque_of_equal_work(
    arm: rbi.ArmModel, q: Array, frame: str, expressed_in: str, axes: pin.ReferenceFrame
) -> None:
    push = FrameWrench(WRENCH, frame, expressed_in)
    torque = push.torque(arm, 0.0, q, np.zeros(3))
    assert_allclose(torque, work(arm, q, frame, axes), rtol=0.0, atol=1e-13)


def test_wrench_may_depend_on_time(arm: rbi.ArmModel, q: Array) -> None:
    push = FrameWrench(lambda t: t * WRENCH)
    at_one, at_three = (push.torque(arm, t, q, np.zeros(3)) for t in (1.0, 3.0))
    assert_allclose(at_three, 3.0 * at_one, rtol=1e-13)
    assert np.abs(at_one).max() > 0.1


@pytest.mark.parametrize(
    "form",
    [WRENCH, WRENCH.tolist(), lambda t: WRENCH, lambda t: WRENCH.tolist(), FrameWrench(WRENCH)],  # noqa: ARG005
    ids=["array", "list", "function", "function of lists", "FrameWrench"],
)
def test_every_form_of_a_wrench_acts_at_the_tool_in_world_axes(
    arm: rbi.ArmModel, q: Array, form: Any
) -> None:
    torque = as_interaction(form).torque(arm, 0.5, q, np.zeros(3))
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    assert_allclose(torque, work(arm, q, "tool", axes), rtol=0.0, atol=1e-13)


def test_none_is_free_motion(arm: rbi.ArmModel, q: Array) -> None:
    assert_array_equal(as_interaction(None).torque(arm, 0.0, q, np.ones(3)), np.zeros(3))


def test_joint_torque_is_given_as_it_is(arm: rbi.ArmModel, q: Array) -> None:
    assert_array_equal(JointTorque([1, 2, 3]).torque(arm, 0.0, q, q), [1.0, 2.0, 3.0])
    ramp = JointTorque(lambda t: [t, 2.0 * t, 0.0])
    assert_array_equal(ramp.torque(arm, 0.5, q, q), [0.5, 1.0, 0.0])


def test_interaction_of_the_users_own_passes_through(arm: rbi.ArmModel, q: Array) -> None:
    class Spring:
        def torque(self, arm: rbi.ArmModel, t: float, q: Array, v: Array) -> Array:
            del t, v
            return 5.0 * arm.difference(q, arm.neutral)

    spring = Spring()
    assert isinstance(spring, Interaction)
    assert as_interaction(spring) is spring
    expected = 5.0 * arm.difference(q, arm.neutral)
    assert_array_equal(as_interaction(spring).torque(arm, 0.0, q, np.zeros(3)), expected)


@pytest.mark.parametrize("build", [FrameWrench, JointTorque])
def test_constant_is_kept_as_a_copy_and_given_as_one(
    arm: rbi.ArmModel, q: Array, build: Callable[[Array], Interaction]
) -> None:
    constant = np.ones(6 if build is FrameWrench else 3)
    push = build(constant)
    first = push.torque(arm, 0.0, q, np.zeros(3))
    kept = first.copy()
    constant[...] = first[...] = np.nan
    assert_array_equal(push.torque(arm, 0.0, q, np.zeros(3)), kept)


@pytest.mark.parametrize(
    ("build", "error", "words"),
    [
        (lambda: FrameWrench(np.ones(3)), rbi.DimensionError, r"^wrench must be .*= \(6,\), got"),
        (lambda: FrameWrench("push"), rbi.DimensionError, r"^wrench must be .*dtype"),
        (lambda: FrameWrench([np.nan] * 6), rbi.NonFiniteError, r"^wrench must be finite"),
        (lambda: FrameWrench(WRENCH, None, "tool"), rbi.ParameterError, r"^expressed_in must be"),
        (lambda: JointTorque(1.0), rbi.DimensionError, r"^torque must be a vector"),
        (lambda: JointTorque([[1.0], [1.0, 2.0]]), rbi.DimensionError, r"^torque must .*ragged"),
        (lambda: JointTorque("push"), rbi.DimensionError, r"^torque must be .*dtype"),
        (lambda: JointTorque([0.0, np.inf]), rbi.NonFiniteError, r"^torque must be finite"),
        (lambda: as_interaction(np.ones(5)), rbi.DimensionError, r"^wrench must be"),
    ],
)
def test_unusable_interaction_is_refused_when_it_is_made(
    build: Callable[[], object], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        build()


@pytest.mark.parametrize(
    ("push", "error", "words"),
    [
        (FrameWrench(lambda t: [t]), rbi.DimensionError, r"^wrench must be .*\(6,\)"),
        (FrameWrench(lambda t: [t / 0.5, 0, 0, 0, 0, np.nan]), rbi.NonFiniteError, r"entry 5"),
        (FrameWrench(WRENCH, "tol"), rbi.ModelError, r"no frame 'tol'; did you mean 'tool'"),
        (JointTorque([1.0, 2.0]), rbi.DimensionError, r"^torque must be .*\(nv,\) = \(3,\)"),
        (JointTorque(lambda t: [t, np.nan, t]), rbi.NonFiniteError, r"^torque must .*entry 1"),
    ],
)
def test_unusable_push_is_refused_when_it_acts(
    arm: rbi.ArmModel, push: Interaction, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        push.torque(arm, 0.0, arm.neutral, np.zeros(3))
