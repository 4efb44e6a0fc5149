"""Snapshots of states: equal to the bit, and everything that is not a whole one for this controller is refused."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import rbimpedance as rbi
from rbimpedance.control.baselines import PDGravity
from rbimpedance.control.compiled.block import Packed
from rbimpedance.control.guards.energy_tank import EnergyTank
from rbimpedance.control.guards.fault_guard import FaultGuard
from rbimpedance.control.guards.reference_guard import ReferenceGuard
from rbimpedance.control.imperfect import ImperfectController
from rbimpedance.control.snapshot import (
    SnapshotError,
    dump,
    fingerprint,
    load_snapshot,
    restore,
    save_snapshot,
)
from rbimpedance.trajectories import cosine

from .. import laws

DT = 1e-3


def law(**changes: Any) -> rbi.ImpedanceController:
    arm = rbi.load_robot("two_link")
    changes["impedance"] = rbi.Impedance(1.0, changes.pop("damping", 10.0), 20.0)
    changes["limits"] = rbi.Limits(40.0, changes.pop("rate", 1000.0))
    return laws.controller(arm, 15.0, 40.0, **({"dt": DT} | changes))


CONTROLLERS: dict[str, Any] = {
    "law": law,
    "compiled law": lambda: law(backend="compiled"),
    "baseline": lambda: PDGravity(law().arm, law().impedance, DT),
    "reference guard": lambda: ReferenceGuard(law()),
    "energy tank": lambda: EnergyTank(law()),
    "fault guard": lambda: FaultGuard(law(), "hold"),
    "delayed measurements": lambda: ImperfectController(law(), delay=2, velocity_noise=1e-3),
    "all guards": lambda: FaultGuard(EnergyTank(law()), "stop"),
}


def after(controller: Any, ticks: int, state: Any = None, start: int = 0) -> tuple[Any, Any]:
    """Torques and state after some ticks of a made-up motion, in which q is lost once."""
    state = controller.init() if state is None else state
    trajectory, torques = cosine(controller.arm, amplitude=0.3, period=1.0), []
    for k in range(start, start + ticks):
        q, v, _ = trajectory(k * DT)
        is_lost = k == 20 and isinstance(controller, FaultGuard)
        output, state = controller.step(
            state, q * np.nan if is_lost else q, v, trajectory(k * DT), np.array([0.3, -0.0])
        )
        torques.append(output.tau)
    return np.array(torques), state


def bits(state: Any) -> Any:
    """A state as something that is equal exactly where all bits are."""
    if isinstance(state, tuple | Packed):
        return [bits(item) for item in state]
    if isinstance(state, np.ndarray | float):
        return np.asarray(state).tobytes()
    return state


@pytest.mark.parametrize("make", CONTROLLERS.values(), ids=CONTROLLERS)
def test_restored_state_is_equal_to_the_bit_and_so_is_what_follows(
    make: Any, tmp_path: Path
) -> None:
    controller = make()
    _, state = after(controller, 22)
    path = save_snapshot(tmp_path / "state.json", controller, state)
    restored = load_snapshot(path, make())
    assert bits(restored) == bits(state)
    plain = state.unpacked() if isinstance(state, Packed) else state
    assert type(restored) is type(plain)
    expected, _ = after(controller, 20, state, 22)
    found, _ = after(make(), 20, restored, 22)
    assert found.tobytes() == expected.tobytes()


def test_signs_of_zeros_and_smallest_numbers_are_kept() -> None:
    state = (np.array([-0.0, 5e-324, np.finfo(float).max]), -0.0, 0.1 + 0.2, 7, "held", None, ())
    assert bits(restore(dump(state, (), "x"), (), "x")) == bits(state)


def snapshot() -> bytes:
    controller = law()
    _, state = after(controller, 5)
    return dump(state, controller.init(), "mine")


WHOLE, TEMPLATE = snapshot(), law().init()


def taken(content: bytes) -> Any:
    return restore(content, TEMPLATE, "mine")


def test_every_truncation_is_refused() -> None:
    for size in range(len(WHOLE)):
        with pytest.raises(SnapshotError):
            taken(WHOLE[:size])


@given(st.integers(0, len(WHOLE) - 1), st.integers(1, 255))
def test_every_altered_byte_is_refused_or_without_effect(place: int, change: int) -> None:
    altered = bytearray(WHOLE)
    altered[place] ^= change
    try:
        state = taken(bytes(altered))
    except SnapshotError:
        return
    assert bits(state) == bits(taken(WHOLE))


@given(st.binary(max_size=300))
def test_foreign_bytes_are_refused(content: bytes) -> None:
    with pytest.raises(SnapshotError):
        taken(content)


def forged(body: Any, **header: Any) -> bytes:
    """A snapshot with any body, and the checksum that belongs to it."""
    import hashlib  # noqa: PLC0415

    text = json.dumps(body)
    whole = json.loads(WHOLE.partition(b"\n")[0])
    whole |= {"checksum": hashlib.sha256(text.encode()).hexdigest()} | header
    return f"{json.dumps(whole)}\n{text}\n".encode()


ARRAY = {"array": "f8", "shape": [2], "hex": "00" * 16}


@pytest.mark.parametrize(
    "body",
    [
        {"named": "Popen", "items": ["ls"]},
        {"named": "ControllerState", "items": []},
        {
            "named": "ControllerState",
            "items": [1, *[ARRAY | {"shape": [3], "hex": "00" * 24}] * 10],
        },
        {"named": "ControllerState", "items": [1, *[ARRAY | {"hex": "ff" * 16}] * 10]},
        {"named": "ControllerState", "items": [1, *[ARRAY | {"array": "O8"}] * 10]},
        {"named": "ControllerState", "items": [1, *[ARRAY | {"shape": [-1, 7]}] * 10]},
        ARRAY,
        None,
        [1, 2],
        json.loads("[" * 50 + "]" * 50),
    ],
    ids=["class", "short", "shape", "nan", "objects", "sizes", "array", "null", "list", "deep"],
)
def test_forged_bodies_are_refused(body: Any) -> None:
    with pytest.raises(SnapshotError):
        taken(forged(body))


def test_message_says_why_a_snapshot_is_refused() -> None:
    body = json.loads(WHOLE.partition(b"\n")[2])
    for content, words in (
        (forged(body, version=99), "has version 99"),
        (forged(body, checksum="0"), "is damaged"),
        (forged(body, identity="yours"), "belongs to another controller"),
        (forged(body, format="zip"), "not a snapshot of this library"),
        (WHOLE[:-1], "the end of the snapshot is missing"),
    ):
        with pytest.raises(SnapshotError, match=words):
            taken(content)


@pytest.mark.parametrize("change", [{"damping": 11.0}, {"dt": 2e-3}, {"rate": 900.0}])
def test_snapshot_of_a_controller_with_other_settings_is_refused(
    change: dict[str, Any], tmp_path: Path
) -> None:
    path = save_snapshot(tmp_path / "state", law(), law().init())
    with pytest.raises(SnapshotError, match="state' belongs to another controller"):
        load_snapshot(path, law(**change))


def test_snapshot_of_another_arm_is_refused(tmp_path: Path) -> None:
    controller = law()
    path = save_snapshot(tmp_path / "state", controller, controller.init())
    heavier = rbi.ImpedanceController(
        controller.arm.with_payload(1e-9),
        controller.impedance,
        controller.surface,
        controller.reaching,
        DT,
        limits=controller.limits,
    )
    with pytest.raises(SnapshotError, match="another controller"):
        load_snapshot(path, heavier)


@pytest.mark.slow
def test_fingerprint_is_that_of_an_equal_controller_in_another_process() -> None:
    """It has no addresses of objects in it: two equal controllers have one."""
    for make in CONTROLLERS.values():
        assert fingerprint(make()) == fingerprint(make())


def test_failed_write_leaves_the_old_snapshot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    controller = law()
    path = save_snapshot(tmp_path / "state", controller, controller.init())
    before = path.read_bytes()

    def full(descriptor: int) -> None:
        raise OSError(28, f"No space left on device: {descriptor}")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        save_snapshot(path, controller, after(controller, 3)[1])
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_states_that_cannot_be_kept_are_refused() -> None:
    for state in (object(), np.array(["a"]), np.array([np.nan]), [1.0], rbi.Reference(1, 2, 3)):  # type: ignore[arg-type]
        with pytest.raises(SnapshotError, match=r"cannot be (saved|part)|NaN"):
            dump(state, (), "x")


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SnapshotError, match="none' cannot be read"):
        load_snapshot(tmp_path / "none", law())
