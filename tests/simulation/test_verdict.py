"""`SimulationResult.verdict`: runs that lost the arm, and runs that only look like it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance._common.arrays import Array
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


def run(diverged: Any = None, **channels: Array) -> rbi.SimulationResult:
    """Two joints, the first with limits; a channel is given for the first and zero for the second."""
    given = {c.name: c.empty(len(T), 2, 2) for c in CHANNELS if c.source != "derived"}
    for name, values in channels.items():
        given[name][:, 0] = values
    given["t"] = T
    provenance = {"plant": {"joint_names": ["hip", "slide"]}, "limits": LIMITS}
    if diverged is not None:
        provenance["diverged"] = diverged
    return rbi.SimulationResult(**given, provenance=provenance)


SWING = 0.8 * np.cos(2.0 * np.pi * T / 4.0)
LOST = {
    "error grows": ({"e1": 1e-3 * np.exp(T)}, "error", "'hip' is 2.98 rad from its reference, and that grows"),
    "error stays": ({"e1": np.full(801, 0.3)}, "error", "'hip' is 0.3 rad from its reference, and that stays"),
    "error swings": ({"e1": 0.3 * np.sin(20.0 * T)}, "error", "from its reference"),
    "error is NaN": ({"e1": np.where(T > 7.0, np.nan, 0.0)}, "error", "from its reference"),
    "joint leaves": ({"q": 0.3 * T}, "position", "'hip' was 1.4 rad beyond its position limit, from 3.37 s"),
    "leaves and comes back": ({"q": 1.05 * np.sin(T)}, "position", "0.05 rad beyond its position limit"),
    "torque": (
        {"tau": np.where(T == 4.0, -17.0, 1.0)},
        "effort",
        "the torque of joint 'hip' passed its limit 10 N·m by 7, from 4 s",
    ),
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
    "a kick that is over": {"e1": 2.0 * np.exp(-((T - 4.0) ** 2))},
    "torque at its limit": {"tau": np.full(801, 10.0)},
    "joint on its stop": {"q": np.full(801, 1.005)},
    "joint that begins outside and comes in": {"q": 1.2 - 0.05 * T},
    "faster than its limit": {"v": 3.0 * np.sin(T)},
}


@pytest.mark.parametrize(("channels", "kind", "words"), LOST.values(), ids=LOST)
def test_lost_arm_is_said_to_be_lost(channels: dict[str, Any], kind: str, words: str) -> None:
    verdict = run(**channels).verdict()
    assert verdict.lost
    assert [finding.kind for finding in verdict.findings] == [kind]
    assert verdict.findings[0].joint == "hip"
    assert str(verdict).startswith("lost: ")
    assert words in str(verdict)


@pytest.mark.parametrize("channels", KEPT.values(), ids=KEPT)
def test_arm_that_is_kept_is_not_said_to_be_lost(channels: dict[str, Any]) -> None:
    verdict = run(**channels).verdict()
    assert not verdict.lost, str(verdict)
    assert str(verdict).startswith("within its limits")


def test_all_reasons_are_in_one_sentence() -> None:
    verdict = run(e1=np.full(801, 0.3), tau=np.full(801, 11.0), q=np.full(801, 0.0)).verdict()
    assert str(verdict) == (
        "lost: joint 'hip' is 0.3 rad from its reference, and that stays and the torque of joint 'hip' passed its "
        "limit 10 N·m by 1, from 0 s"
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
    assert not result.verdict().lost, str(result.verdict())


@pytest.mark.slow
def test_arm_that_gains_cannot_hold_is_lost(panda: rbi.ArmModel) -> None:
    """Thirty kilograms of which nobody told the controller."""
    weak = controller(panda, 1.0, 1.0)
    plant = panda.with_payload(30.0)
    try:
        result = rbi.simulate(weak, plant, hold(panda), duration=2.0, joint_stops=True)
    except rbi.DivergenceError as error:
        result = error.result
    assert result.verdict().lost


def test_diverged_run_is_lost(panda: rbi.ArmModel) -> None:
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
