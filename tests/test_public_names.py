"""What `import rbimpedance as rbi` shows: the public names and nothing else, each with a short representation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi

MOVED = {
    name: f"{room}.{name}"
    for room, names in {
        "interaction": ("Push", "Sum", "SuperTwistingMomentumObserver"),
        "simulation.plants": ("engine_agreement",),
        "study": ("Experiment", "Task", "summarize"),
    }.items()
    for name in names
}


def test_dir_holds_public_names_and_no_machinery() -> None:
    names = set(dir(rbi))
    assert {"view", "Viewer", "figures", "Loop", "FaultError", "load_gains", "save_gains"} <= names
    assert {"Surface", "Sensor", "interaction", "study", "trajectories", "__version__"} <= names
    assert not names & {
        "annotations",
        "TYPE_CHECKING",
        "cli",
        "control",
        "exceptions",
        "law",
        *MOVED,
    }
    assert [name for name in names if name.startswith("_")] == ["__version__"]
    assert all(getattr(rbi, name) is not None for name in names)


@pytest.mark.parametrize("old", sorted(MOVED))
def test_name_that_moved_into_its_room_warns_and_is_the_same(old: str) -> None:
    owner: Any = rbi
    for part in MOVED[old].split("."):
        owner = getattr(owner, part)
    with pytest.warns(DeprecationWarning, match=f"{old} is now rbimpedance.{MOVED[old]}"):
        assert getattr(rbi, old) is owner


@pytest.fixture(scope="module")
def objects() -> dict[str, Any]:
    arm = rbi.load_robot("panda", lock=("panda_finger_joint1", "panda_finger_joint2"), armature=0.1)
    surface, reaching = rbi.FastTerminalSurface(2.0, 3.0, 0.6), rbi.SuperTwisting(8.0, 10.0)
    impedance = rbi.Impedance(1.0, 10.0, np.arange(1.0, 8.0))
    controller = rbi.ImpedanceController(
        arm, impedance, surface, reaching, 1e-3, limits=arm.effort_limit
    )
    still = rbi.trajectories.hold(arm)
    output, state = controller.step(
        controller.init(), arm.ready, np.zeros(7), still(0.0), np.zeros(7)
    )
    many = [arm.ready, arm.ready + 0.1]
    tool, there = rbi.CartesianController(arm), rbi.trajectories.cartesian.hold(arm)
    at_tool, tool_state = tool.step(tool.init(), arm.ready, np.zeros(7), there(0.0), np.zeros(6))
    return {
        "arm": arm,
        "impedance": impedance,
        "matrix": rbi.Impedance(np.eye(7), np.eye(7), np.diag(np.arange(1.0, 8.0))),
        "surface": surface,
        "bounded": rbi.BoundedSurface(surface, 0.4),
        "reaching": reaching,
        "controller": controller,
        "realtime": controller.realtime(),
        "limits": rbi.Limits([50.0, 60.0]),
        "state": state,
        "output": output,
        "guard": rbi.FaultGuard(controller),
        "reference guard": rbi.ReferenceGuard(controller),
        "encoders": rbi.QuantizedEncoders(controller, resolution=1e-4),
        "hold": still,
        "cosine": rbi.trajectories.cosine(arm),
        "waypoints": rbi.trajectories.waypoints(arm, many, [0.0, 1.0]),
        "samples": rbi.trajectories.samples(arm, [0.0, 1.0], many),
        "reference": still(0.0),
        "result": rbi.simulate(controller, arm, still, duration=0.01),
        "batch": rbi.simulate_batch(controller, arm, still, duration=0.01, channels=("q",)),
        "wall": rbi.Wall([0, 0, 0], [0, 0, 1], 100.0),
        "wrench": rbi.FrameWrench(lambda t: np.full(6, t)),
        "sum": rbi.interaction.Sum(rbi.FrameWrench(np.ones(6)), rbi.JointTorque(np.ones(7))),
        "observer": rbi.MomentumObserver(arm, 100.0, 1e-3),
        "uncertainty": rbi.Uncertainty(payload=2.0),
        "certificate": rbi.certify(8.0, 10.0, 5.0, s0=0.5, disturbance0=0.0),
        "drives": rbi.DrivenPlant(arm, time_constant=1e-3),
        "margin": rbi.MotionMargin(),
        "tool": tool,
        "target at the tool": rbi.CartesianImpedance((3.0, 0.1), np.eye(6), axes=np.eye(3)),
        "output at the tool": at_tool,
        "state at the tool": tool_state,
        "reference at the tool": there(0.0),
        "circle": rbi.trajectories.cartesian.circle(there(0.0).pose, 0.1, 4.0),
        "hold at the tool": there,
        "PID at the tool": rbi.baselines.CartesianPID(arm, tool.impedance, 40.0),
        "baseline": rbi.baselines.PDPlus(arm, impedance, 1e-3),
    }


def test_representations_take_two_lines_at_most(objects: dict[str, Any]) -> None:
    for name, value in objects.items():
        lines = repr(value).splitlines()
        assert len(lines) <= 2, name
        assert max(map(len, lines)) <= 124, name
        assert " object at 0x" not in repr(value), name
        assert "array(" not in repr(value), name


def test_representation_says_what_an_object_was_made_with(objects: dict[str, Any]) -> None:
    assert repr(objects["reaching"]) == "SuperTwisting(k1=8, k2=10, scheme='matched')"
    assert repr(objects["uncertainty"]) == "Uncertainty(payload=[0, 2])"
    assert repr(objects["impedance"]) == (
        "Impedance(mass=1, damping=10, stiffness=[1, 2, 3, 4, 5, 6, 7])"
    )
    assert repr(objects["cosine"]) == "cosine('panda', amplitude=0.2, period=6 s)"
    assert "11 samples of 7 joints, t = 0 to 0.01 s" in repr(objects["result"])
    assert "within its limits" in repr(objects["result"])
    assert repr(objects["batch"]) == "BatchResult(1 worlds, 11 samples of q; 0 diverged)"
