"""Old names work for one release: each warns, and is the new one."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance._common.moved import MOVED

NAMES = {
    "GainError": "ParameterError",
    "LeanController": "RealtimeController",
    "Spread": "MotionMargin",
    "observe": "estimate_disturbance",
    "sense": "replay_sensor",
}


@pytest.fixture(scope="module")
def controller() -> rbi.ImpedanceController:
    surface = rbi.FastTerminalSurface(2.0, 3.0, 0.6)
    arm, impedance = rbi.load_robot("two_link"), rbi.Impedance(1.0, 10.0, 20.0)
    return rbi.ImpedanceController(arm, impedance, surface, rbi.SuperTwisting(8.0, 10.0), 1e-3)


@pytest.mark.parametrize("old", sorted(NAMES))
def test_old_public_name_warns_and_is_the_new_one(old: str) -> None:
    with pytest.warns(DeprecationWarning, match=f"{old} is now .*{NAMES[old]}"):
        assert getattr(rbi, old) is getattr(rbi, NAMES[old])


@pytest.mark.parametrize("old", sorted(MOVED))
def test_old_module_warns_and_answers_with_the_new_one(old: str) -> None:
    new = import_module(MOVED[old])
    with pytest.warns(DeprecationWarning, match=f"{old} has moved to {MOVED[old]}"):
        module = import_module(old)
    assert module is new


def test_old_name_of_the_error_is_known_to_its_module() -> None:
    with pytest.warns(DeprecationWarning, match="ParameterError"):
        assert import_module("rbimpedance.exceptions").GainError is rbi.ParameterError


@pytest.mark.parametrize(
    ("old", "new"),
    [("knowledge", "model"), ("lean", "realtime")],
)
def test_old_attribute_of_the_controller_warns(
    controller: rbi.ImpedanceController, old: str, new: str
) -> None:
    with pytest.warns(DeprecationWarning, match=f"{old} is now .*{new}"):
        assert getattr(controller, old) == getattr(controller, new)


@pytest.mark.parametrize("backend", ["pinocchio", "compiled"])
@pytest.mark.parametrize(
    ("old", "new"), [("guaranteed", "premise_holds"), ("held", "reference_limited")]
)
def test_old_flag_of_the_output_warns(
    controller: rbi.ImpedanceController, backend: Any, old: str, new: str
) -> None:
    c = controller
    again = rbi.ImpedanceController(
        c.arm, c.impedance, c.surface, c.reaching, c.dt, backend=backend
    )
    rest = np.zeros(2)
    output, _ = again.step(again.init(), rest, rest, rbi.Reference(rest, rest, rest), rest)
    with pytest.warns(DeprecationWarning, match=f"{old} is now .*{new}"):
        assert (getattr(output, old) == getattr(output, new)).all()


def test_backend_of_a_run_is_now_that_of_its_controller(
    controller: rbi.ImpedanceController,
) -> None:
    given: Any = controller.arm, rbi.trajectories.hold(controller.arm)
    old: dict[str, Any] = {"duration": 0.01, "backend": "numpy"}
    expected = rbi.simulate(controller.with_backend("numpy"), *given, duration=0.01)
    with pytest.warns(DeprecationWarning, match="backend= of simulate is now backend= of Imp"):
        by_position = rbi.simulate(controller, *given, **old)
    with pytest.warns(DeprecationWarning, match="backend= of simulate is now backend= of Imp"):
        by_name = rbi.simulate(controller=controller, plant=given[0], trajectory=given[1], **old)
    for result in (by_position, by_name):
        assert result.provenance["controller"]["backend"] == "numpy"
        assert np.array_equal(result.tau, expected.tau)


def test_old_arguments_are_taken(controller: rbi.ImpedanceController) -> None:
    c: Any = controller
    with pytest.warns(DeprecationWarning, match="is now") as said:
        old = rbi.ImpedanceController(
            c.arm,
            c.impedance,
            c.surface,
            c.reaching,
            c.dt,
            knowledge="mass",  # type: ignore[call-arg]
        )
    assert [str(each.message).partition(";")[0] for each in said] == [
        "knowledge= is now model=",
        'model="mass" is now model="inertia"',
    ]
    assert old.model == "inertia"
    with pytest.warns(DeprecationWarning, match="error= is now max_error="):
        bounded = rbi.BoundedSurface(c.surface, error=0.4)  # type: ignore[call-arg]
    with pytest.warns(DeprecationWarning, match="error is now"):
        assert bounded.error == 0.4


def test_what_pushes_on_the_plant_is_now_the_environment(
    controller: rbi.ImpedanceController,
) -> None:
    arm, push = controller.arm, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    given: Any = controller, arm, rbi.trajectories.hold(arm)
    old: dict[str, Any] = {"wrench": push}
    with pytest.warns(DeprecationWarning, match="wrench= is now environment="):
        run = rbi.simulate(*given, duration=0.01, **old)
    assert np.array_equal(run.tau, rbi.simulate(*given, environment=push, duration=0.01).tau)
    with pytest.warns(DeprecationWarning, match="wrench= is now environment="):
        rbi.simulate_batch(*given, duration=0.01, **old)
    with (
        pytest.warns(DeprecationWarning, match="wrench= is now environment="),
        pytest.raises(rbi.ParameterError, match="fps"),
    ):
        run.animate(robot=arm, fps=0.0, **old)
    with pytest.warns(DeprecationWarning, match="wrench= is now environment="):
        experiment = rbi.study.Experiment(plant=arm, trajectory=given[2], **old)
    with pytest.warns(DeprecationWarning, match=r"wrench is now .*environment"):
        assert experiment.wrench is push
    scenario = rbi.scenarios.paper()
    with pytest.warns(DeprecationWarning, match=r"wrench is now .*environment"):
        assert scenario.wrench is scenario.environment
