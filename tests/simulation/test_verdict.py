"""`SimulationResult.verdict`: runs that failed, and runs that only look like it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance._common.arrays import Array
from rbimpedance.control.imperfect import ImperfectController
from rbimpedance.control.telemetry import CHANNELS
from rbimpedance.trajectories import cosine, hold

from .. import laws

T = np.linspace(0.0, 8.0, 801)
LIMITS = {
    "lower": [-1.0, None],
    "upper": [1.0, None],
    "velocity": [2.0, None],
    "effort": [10.0, None],
    "q_index": [0, 1],
    "unit": ["rad", "m"],
}


def run(diverged: Any = None, noise: float = 0.0, **channels: Array) -> rbi.SimulationResult:
    """Two joints, the first with limits; a channel is given for the first and zero for the second."""
    given = {c.name: c.empty(len(T), 2, 2) for c in CHANNELS if c.source != "derived"}
    for name, values in channels.items():
        given[name][:, 0] = values
    given["t"] = T
    provenance = {"plant": {"joint_names": ["hip", "slide"]}, "limits": LIMITS}
    provenance["controller"] = {"velocity_noise": noise}
    if diverged is not None:
        provenance["diverged"] = diverged
    return rbi.SimulationResult(**given, provenance=provenance)


SWING = 0.8 * np.cos(2.0 * np.pi * T / 4.0)
SHAKING = (-1.0) ** np.arange(801)
SLOW = np.sin(T)
FAILED = {
    "error grows": ({"e1": 1e-3 * np.exp(T)}, "error", "'hip' is 2.98 rad from its reference, and that does not fall"),
    "error stays": ({"e1": np.full(801, 0.3)}, "error", "'hip' is 0.3 rad from its reference, and that does not fall"),
    "error swings": ({"e1": 0.3 * np.sin(20.0 * T)}, "error", "from its reference"),
    "error is NaN": ({"e1": np.where(T > 7.0, np.nan, 0.0)}, "error", "from its reference"),
    "joint leaves": ({"q": 0.3 * T}, "position", "'hip' was 1.4 rad beyond its position limit, from 3.37 s"),
    "leaves and comes back": ({"q": 1.05 * np.sin(T)}, "position", "0.05 rad beyond its position limit"),
    "torque": (
        {"tau": np.where(T == 4.0, -17.0, 1.0)},
        "effort",
        "the torque of joint 'hip' passed its limit 10 N·m by 7, from 4 s",
    ),
    "far off, and back": (
        {"e1": 1.15 * np.exp(-4.0 * (T - 4.0) ** 2)},
        "deviation",
        "'hip' was 1.15 rad (66 deg) from its reference at 4 s",
    ),
    "farther than it began": (
        {"e1": np.exp(-T) + 1.2 * np.exp(-4.0 * (T - 3.0) ** 2) * (T > 0.5) + 0.6 * np.exp(-4.0 * (T - 3.0) ** 2)},
        "deviation",
        "from its reference at",
    ),
    "half of the time at its torque limit": (
        {"saturated": np.sin(7.0 * T) > 0.2},
        "saturation",
        "'hip' was at its torque limit in 44% of the ticks, from 0.03 s",
    ),
    "torque shakes": (
        {"tau": SLOW + 0.05 * SHAKING},
        "chatter",
        "the torque of joint 'hip' chatters: it varies by 10 N·m/s, where its motion needs 0.617",
    ),
    "torque shakes far beyond the noise": ({"tau": 2.0 * SHAKING, "noise": 1e-3}, "chatter", "chatters"),
    "torque oscillates": ({"tau": SLOW + np.sin(2.0 * np.pi * 20.0 * T)}, "chatter", "chatters"),
    "diverged": (
        {"diverged": {"time": 8.0, "joint": "hip"}},
        "divergence",
        "joint 'hip' left every sensible range after 8 s",
    ),
}  # fmt: skip
KEPT = {
    "nothing happens": {},
    "error falls": {"e1": np.exp(-T / 4.0)},
    "error is small": {"e1": np.full(801, 0.04)},
    "a quarter of a large swing": {"e1": np.full(801, 0.2), "q": SWING, "v": np.gradient(SWING, T)},
    "a kick that is over": {"e1": 0.09 * np.exp(-((T - 4.0) ** 2))},
    "a deviation of a part of the motion": {
        "e1": 0.4 * np.exp(-4.0 * (T - 4.0) ** 2),
        "q": SWING,
        "v": np.gradient(SWING, T),
    },
    "a fast start that is caught": {"e1": T * np.exp(-2.0 * T), "e2": 1.0 * (T == 0.0)},
    "torque at its limit": {"tau": np.full(801, 10.0)},
    "torque at its limit on the way from afar": {"e1": np.exp(-T), "saturated": T < 2.0},
    "torque at its limit for a moment": {"saturated": (T > 4.0) & (T < 4.5)},
    "dust on the torque": {"tau": 1e-3 * SHAKING},
    "noisy sensors": {"tau": 0.5 * SHAKING, "noise": 1e-3},
    "torque that follows a shaking contact": {"tau": SHAKING, "tau_ext": -SHAKING},
    "steps of the torque": {"tau": np.sign(np.sin(4.0 * T))},
    "joint on its stop": {"q": np.full(801, 1.005)},
    "joint that begins outside and comes in": {"q": 1.2 - 0.05 * T},
    "faster than its limit": {"v": 3.0 * np.sin(T)},
}


@pytest.mark.parametrize(("channels", "kind", "words"), FAILED.values(), ids=FAILED)
def test_failed_run_is_said_to_have_failed(channels: dict[str, Any], kind: str, words: str) -> None:
    verdict = run(**channels).verdict()
    assert verdict.failed
    assert [finding.kind for finding in verdict.findings] == [kind]
    assert verdict.findings[0].joint == "hip"
    assert str(verdict).startswith("failed: ")
    assert words in str(verdict)


@pytest.mark.parametrize("channels", KEPT.values(), ids=KEPT)
def test_run_that_only_looks_like_it_has_not_failed(channels: dict[str, Any]) -> None:
    verdict = run(**channels).verdict()
    assert not verdict.failed, str(verdict)
    assert str(verdict).startswith("within its limits")


LIFT = """<robot name="lift"><link name="base"/>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="tray"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="1" effort="200" velocity="1"/></joint>
  <link name="tray"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link></robot>"""


def test_all_reasons_are_in_one_sentence() -> None:
    verdict = run(e1=np.full(801, 0.3), tau=np.full(801, 11.0), q=np.full(801, 0.0)).verdict()
    assert str(verdict) == (
        "failed: joint 'hip' is 0.3 rad from its reference, and that does not fall and the torque of joint 'hip' "
        "passed its limit 10 N·m by 1, from 0 s"
    )


def test_violations_are_counted_with_their_size() -> None:
    q = np.where((T >= 2.0) & (T < 3.0), 1.25, 0.0)
    figures = run(q=q, v=np.where(T < 0.5, 3.0, 0.0), tau=np.where(T > 7.0, 12.0, 0.0)).metrics()
    assert figures["position_violations"].tolist() == [100.0, 0.0]
    assert figures["position_excess"].tolist() == [0.25, 0.0]
    assert figures["velocity_violations"].tolist() == [50.0, 0.0]
    assert figures["velocity_excess"].tolist() == [1.0, 0.0]
    assert figures["effort_violations"].tolist() == [100.0, 0.0]
    assert figures["effort_excess"].tolist() == [2.0, 0.0]
    when = T[run(q=q).excess().position[:, 0] > 0.0]
    assert (when[0], when[-1]) == pytest.approx((2.0, 2.99))


def test_growth_is_that_of_the_last_quarter() -> None:
    e1 = np.repeat([1.0, 1.0, 0.5, 2.0], [201, 200, 200, 200])
    assert run(e1=e1).metrics()["e1_growth"].tolist() == [4.0, 1.0]


def controller(arm: rbi.ArmModel, k1: float, k2: float) -> rbi.ImpedanceController:
    return laws.controller(arm, k1, k2)


@pytest.fixture(scope="module")
def panda() -> rbi.ArmModel:
    fingers = ("panda_finger_joint1", "panda_finger_joint2")
    return rbi.load_robot("panda", lock=fingers, armature=0.1)


def test_run_inside_its_bounds_is_kept(panda: rbi.ArmModel) -> None:
    result = rbi.simulate(
        controller(panda, 50.0, 500.0), panda.with_payload(1.0), cosine(panda), duration=2.0
    )
    assert not result.verdict().failed, str(result.verdict())


@pytest.mark.slow
def test_run_of_an_arm_that_gains_cannot_hold_has_failed(panda: rbi.ArmModel) -> None:
    """Thirty kilograms of which nobody told the controller."""
    weak = controller(panda, 1.0, 1.0)
    plant = panda.with_payload(30.0)
    try:
        result = rbi.simulate(weak, plant, hold(panda), duration=2.0, joint_stops=True)
    except rbi.DivergenceError as error:
        result = error.result
    assert result.verdict().failed


def test_law_that_chatters_fails_and_the_matched_one_does_not(panda: rbi.ArmModel) -> None:
    """The same gains: the explicit scheme's torque jumps at every tick."""
    plant, verdicts = panda.with_payload(1.0), {}
    for scheme in ("explicit", "matched"):
        law = rbi.ImpedanceController(
            panda, reaching=rbi.SuperTwisting(50.0, 500.0, scheme), dt=1e-3
        )
        verdicts[scheme] = rbi.simulate(law, plant, cosine(panda), duration=1.0).verdict()
    assert [finding.kind for finding in verdicts["explicit"].findings] == ["chatter"]
    assert not verdicts["matched"].failed


def test_arm_that_sags_by_more_than_its_motion_and_recovers_fails() -> None:
    arm = rbi.load_robot("two_link")
    result = rbi.simulate(
        controller(arm, 8.0, 10.0), arm.with_payload(2.0), cosine(arm), duration=4.0
    )
    assert np.abs(result.e1[-1]).max() < 1e-3
    assert [finding.kind for finding in result.verdict().findings] == ["deviation"]


def test_arm_whose_motors_are_too_weak_for_a_while_fails(panda: rbi.ArmModel) -> None:
    """The motors hold the arm and one kilogram, but not a push downwards for a second."""
    weak = rbi.ImpedanceController(panda, limits=0.35 * panda.effort_limit)
    result = rbi.simulate(
        weak, panda.with_payload(1.0), hold(panda), duration=3.0,
        environment=lambda t: np.array([0.0, 0.0, -80.0 * (1.0 < t < 2.0), 0.0, 0.0, 0.0]),
    )  # fmt: skip
    assert result.saturated.any()
    assert "saturation" in {finding.kind for finding in result.verdict().findings}


@pytest.mark.parametrize("far", [0.3, 0.8])
def test_start_far_away_is_no_failure(panda: rbi.ArmModel, far: float) -> None:
    law = rbi.ImpedanceController(panda, limits=panda.effort_limit)
    start = panda.integrate(panda.ready, np.full(panda.nv, -far) * (np.arange(panda.nv) != 5))
    result = rbi.simulate(law, panda, hold(panda), q0=start, duration=4.0)
    assert not result.verdict().failed, str(result.verdict())


def test_soft_arm_that_yields_to_a_push_is_no_failure(panda: rbi.ArmModel) -> None:
    """A spring of 20 N·m/rad gives way by far more than the allowed deviation."""
    law = rbi.ImpedanceController(panda, limits=panda.effort_limit)
    result = rbi.simulate(
        law, panda, hold(panda), duration=3.0,
        environment=lambda t: np.array([40.0 * (0.5 < t < 2.0), 0.0, 0.0, 0.0, 0.0, 0.0]),
    )  # fmt: skip
    assert np.abs(result.q - panda.ready).max() > 0.2
    assert not result.verdict().failed, str(result.verdict())


def test_noisy_sensors_are_no_failure(panda: rbi.ArmModel) -> None:
    noisy = ImperfectController(
        rbi.ImpedanceController(panda), position_noise=1e-4, velocity_noise=1e-2
    )
    result = rbi.simulate(noisy, panda, cosine(panda), duration=1.0)
    assert not result.verdict().failed, str(result.verdict())


def test_diverged_run_has_failed(panda: rbi.ArmModel) -> None:
    with pytest.raises(rbi.DivergenceError) as caught:
        rbi.simulate(
            controller(panda, 2000.0, 1e6), panda, cosine(panda), q0=panda.neutral,
            environment=lambda t: np.array([1e6 * t, 0.0, 0.0, 0.0, 0.0, 0.0]), duration=5.0,
        )  # fmt: skip
    verdict = caught.value.result.verdict()
    assert verdict.findings[0].kind == "divergence"
    assert verdict.findings[0].joint == caught.value.joint


def test_verdict_survives_the_file(panda: rbi.ArmModel, tmp_path: Any) -> None:
    result = rbi.simulate(
        controller(panda, 50.0, 500.0), panda, hold(panda, panda.ready + 0.3), q0=panda.ready,
        duration=0.1,
    )  # fmt: skip
    read = rbi.SimulationResult.load(result.save(tmp_path / "run"))
    assert str(read.verdict()) == str(result.verdict())


def test_spring_without_a_sensor_that_yields_as_it_should_has_not_failed() -> None:
    arm = rbi.load_robot("two_link")
    spring, hold = (
        rbi.CompliantController(arm, stiffness=20.0),
        rbi.trajectories.hold(arm, [0.4, 1.2]),
    )
    push = [10.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    pushed = rbi.simulate(spring, arm, hold, environment=push, duration=3.0)
    assert abs(pushed.e1[-1]).max() > 0.1  # it gives way, and stays there
    assert not pushed.verdict().failed
    sagging = rbi.simulate(spring, arm.with_payload(1.0), hold, duration=3.0)
    assert sagging.verdict().failed  # nothing pushed


def test_truth_of_a_verdict_is_that_the_run_did_not_fail() -> None:
    arm = rbi.load_robot("two_link")
    good = rbi.simulate(rbi.ImpedanceController(arm), arm, rbi.trajectories.hold(arm), duration=0.1)
    assert good.verdict()
    assert good.verdict().failed is False


def test_error_of_a_sliding_joint_is_large_from_a_centimetre_on() -> None:
    arm = rbi.load_robot(LIFT)
    weak = rbi.baselines.PDGravity(arm, rbi.Impedance(1.0, 40.0, 400.0), dt=1e-3)
    hold = rbi.trajectories.hold(arm)
    sags = rbi.simulate(weak, arm.with_payload(1.0), hold, duration=4.0).verdict()
    assert [finding.kind for finding in sags.findings] == ["error"]
    assert "0.0245 m from its reference" in str(sags)  # m·g/k, closed form
    assert rbi.simulate(weak, arm.with_payload(0.2), hold, duration=4.0).verdict()  # 5 mm
