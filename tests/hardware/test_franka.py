"""The Franka adapter: what it passes to the maker's client, for which a stand-in serves."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.hardware import franka, ur

ARM = rbi.load_robot("panda", lock=("panda_finger_joint1", "panda_finger_joint2"), armature=0.1)


class Client:
    """Stands in for pylibfranka: remembers its calls."""

    class RealtimeConfig:
        kEnforce, kIgnore = "enforce", "ignore"  # noqa: N815 (the maker's names)

    def __init__(self, gravity: float) -> None:
        self.asked: list[str] = []
        self.written: list[Any] = []
        self.state = SimpleNamespace(
            q=list(ARM.ready),
            dq=[0.0] * 7,
            tau_J_d=[0.1] * 7,
            tau_ext_hat_filtered=[0.0] * 7,
            O_ddP_O=[0.0, 0.0, -gravity],
            time=SimpleNamespace(to_sec=lambda: 1.25),
        )

    def Robot(self, host: str, realtime: str) -> Any:  # noqa: N802
        if host == "nobody":
            raise RuntimeError("no route to host")
        self.asked += [host, realtime]
        return self

    def Torques(self, values: list[float]) -> Any:  # noqa: N802
        return SimpleNamespace(values=values, motion_finished=False)

    def load_model(self) -> Any:
        return SimpleNamespace(gravity=lambda state: [5.0] * len(state.q))

    def read_once(self) -> Any:
        return self.state

    def readOnce(self) -> Any:  # noqa: N802
        return self.state, None

    def writeOnce(self, command: Any) -> None:  # noqa: N802
        self.written.append(command)

    def __getattr__(self, name: str) -> Any:
        def ask(*_: Any) -> Any:
            self.asked.append(name)
            return self

        return ask


@pytest.fixture
def client(monkeypatch: pytest.MonkeyPatch) -> Client:
    made = Client(gravity=9.81)
    monkeypatch.setattr(franka, "client", lambda: made)
    return made


def test_command_ends_with_the_last_torque_marked_as_finished(client: Client) -> None:
    robot = franka.Franka("there", ARM)
    robot.start()
    robot.read()
    robot.write(np.full(7, 0.2))
    robot.stop()
    robot.stop()
    assert [each.motion_finished for each in client.written] == [False, True]
    assert client.written[0].values == [0.2] * 7
    assert client.asked[-2:] == ["automatic_error_recovery", "start_torque_control"]


def test_gravity_is_the_one_that_the_robot_reports_else_that_of_the_given_model(
    client: Client,
) -> None:
    robot = franka.Franka("there", ARM)
    q = robot.read().q
    np.testing.assert_array_equal(robot.gravity(q), 5.0)
    client.state.O_ddP_O = [0.0, 0.0, 0.0]
    np.testing.assert_allclose(robot.gravity(q), ARM.bias(q, np.zeros(7)))
    unknown = franka.Franka("there")
    unknown.read()
    with pytest.raises(rbi.RobotError, match="reports no gravity"):
        unknown.gravity(q)


def test_errors_of_the_client_say_which_robot(client: Client) -> None:
    with pytest.raises(rbi.RobotError, match="franka: no route to host"):
        franka.Franka("nobody")
    assert client.asked == []


@pytest.mark.parametrize(
    ("module", "make", "extra"),
    [
        ("pylibfranka", lambda: franka.Franka("there"), "franka"),
        ("rtde_control", lambda: ur.UniversalRobot("there", ARM), "ur"),
    ],
)
def test_missing_client_is_an_error_that_names_the_extra(
    monkeypatch: pytest.MonkeyPatch, module: str, make: Any, extra: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(rbi.MissingExtraError, match=rf"\[{extra}\]"):
        make()
