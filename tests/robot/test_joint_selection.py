"""Which joints move: names only."""

from __future__ import annotations

import pytest

import rbimpedance as rbi
from rbimpedance.robot.loading.joint_selection import joints_to_lock
from rbimpedance.robot.loading.model_building import root_mimics
from rbimpedance.robot.loading.urdf_document import Mimic

MOVABLE = ("a", "b", "c", "d")
CHAIN = {"b": "a", "c": "b"}  # c follows b follows a; d is alone


@pytest.mark.parametrize(
    ("joints", "lock", "frozen"),
    [
        (None, (), ""),
        (None, ("d",), "d"),
        (None, ("a",), "abc"),
        (None, ("b",), "bc"),
        (None, ("c",), "c"),
        (("d",), (), "abc"),
        (("a",), (), "d"),
        (("a", "b"), (), "d"),
        (("a",), ("b",), "bcd"),
        (None, "d", "d"),
    ],
)
def test_followers_are_frozen_and_kept_with_what_they_follow(
    joints: tuple[str, ...] | None, lock: tuple[str, ...], frozen: str
) -> None:
    assert joints_to_lock(MOVABLE, CHAIN, (), joints, lock) == set(frozen)


def test_follower_alone_cannot_be_kept() -> None:
    with pytest.raises(rbi.ModelError, match=r"'c' follows 'b'; put that in joints= too"):
        joints_to_lock(MOVABLE, CHAIN, (), ("a", "c"), ())


def test_robot_that_has_only_fixed_joints_is_refused() -> None:
    with pytest.raises(rbi.ModelError, match="no movable joint remains"):
        joints_to_lock((), {}, ("f",), None, ())


def test_chain_of_mimics_is_composed() -> None:
    roots = root_mimics({"b": Mimic("a", 2.0, 0.5), "c": Mimic("b", -3.0, 0.1)})
    position_of_a = 0.7
    position_of_b = 2.0 * position_of_a + 0.5
    assert roots["b"] == Mimic("a", 2.0, 0.5)
    assert roots["c"].joint == "a"
    through = roots["c"].multiplier * position_of_a + roots["c"].offset
    assert through == pytest.approx(-3.0 * position_of_b + 0.1)


def test_circle_of_mimics_is_left_out() -> None:
    circle = {"a": Mimic("b", 1.0, 0.0), "b": Mimic("a", 1.0, 0.0), "c": Mimic("b", 1.0, 0.0)}
    assert root_mimics(circle) == {}
