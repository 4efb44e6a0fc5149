"""A run that is killed and goes on gives the same bytes as one that is left alone."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.control.guards.fault_guard import FaultGuard
from rbimpedance.control.snapshot import SnapshotError
from rbimpedance.interaction.estimators import MomentumObserver
from rbimpedance.simulation.checkpoint import Checkpoint

from .. import laws
from ..arms import spinner
from ..command_line import call

TICKS, SUBSTEPS = 300, 64  # compiled forms go by blocks of 4096 physics steps: five of them

FORMS: dict[str, dict[str, Any]] = {
    "readable": {"guarded": True},
    "fused": {},
    "compiled": {"backend": "compiled"},
}
"""Forms of a run: with a guard and an observer, which only the readable one takes, and as fast as it goes."""


class Killed(BaseException):
    """What ends a run in the middle."""


def simulated(
    checkpoint: Checkpoint | None = None,
    kill_at: int | None = None,
    seen: list[int] | None = None,
    *,
    guarded: bool = False,
    **more: Any,
) -> rbi.SimulationResult:
    """A run of an arm with a continuous joint, an implicit scheme, limits and a payload."""
    arm = spinner()
    controller = laws.controller(
        arm,
        reaching=rbi.SuperTwisting(8.0, [10.0, 11.0, 12.0], more.pop("scheme", "implicit")),
        dt=2e-3,
        limits=rbi.Limits(60.0, 2000.0),
        backend=more.pop("backend", "pinocchio"),
    )

    def on_tick(done: int, total: int) -> None:
        assert total == TICKS
        if seen is not None:
            seen.append(done)
        if kill_at is not None and done >= kill_at:
            raise Killed

    return rbi.simulate(
        FaultGuard(controller) if guarded else controller,
        arm.with_payload(0.4),
        rbi.trajectories.cosine(arm, amplitude=0.2, period=2.0),
        environment=np.array([3.0, -1.0, 2.0, 0.1, 0.0, 0.2]),
        sensor=MomentumObserver(arm, 100.0, 2e-3) if guarded else None,
        duration=TICKS * 2e-3,
        on_tick=on_tick,
        checkpoint=checkpoint,
        **{"substeps": 2 if guarded else SUBSTEPS} | more,
    )


def clock(step: float) -> Callable[[], float]:
    """A clock that goes on by a step whenever it is asked."""
    now = [0.0]

    def read() -> float:
        now[0] += step
        return now[0]

    return read


def killed(folder: Path, tick: int, *, every: float = 7.0, **more: Any) -> Path:
    """Leave the checkpoint of a run that kept its state every few ticks and was killed."""
    path = folder / "run.checkpoint"
    with pytest.raises(Killed):
        simulated(Checkpoint(path, "a", every=every, clock=clock(1.0)), kill_at=tick, **more)
    return path


@pytest.fixture(scope="module", params=FORMS)
def form(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def whole(form: str, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp(form)
    return simulated(**FORMS[form]).save(folder / "result").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("tick", [1, 180, TICKS])
def test_resumed_run_has_the_bytes_of_one_that_was_left_alone(
    tick: int, form: str, whole: bytes, tmp_path: Path
) -> None:
    path = killed(tmp_path, tick, every=1.0, **FORMS[form])
    result = simulated(Checkpoint(path, "a", resume=True), **FORMS[form])
    assert result.save(tmp_path / "result").read_bytes() == whole


@pytest.mark.slow
def test_run_can_be_killed_again_and_again(form: str, whole: bytes, tmp_path: Path) -> None:
    path = killed(tmp_path, 70, every=1.0, **FORMS[form])
    for tick in (140, 200, 290):
        checkpoint = Checkpoint(path, "a", resume=True, every=1.0, clock=clock(1.0))
        with pytest.raises(Killed):
            simulated(checkpoint, kill_at=tick, **FORMS[form])
    result = simulated(Checkpoint(path, "a", resume=True), **FORMS[form])
    assert result.save(tmp_path / "result").read_bytes() == whole


@pytest.mark.slow
def test_resumed_run_does_not_repeat_what_is_kept(form: str, tmp_path: Path) -> None:
    """No more than the block, or the ticks, since the last checkpoint."""
    ticks: list[int] = []
    path = killed(tmp_path, 200, every=1.0, **FORMS[form])
    simulated(Checkpoint(path, "a", resume=True), seen=ticks, **FORMS[form])
    again = [k for k in ticks if k > 0]  # a compiled run also tells that it begins
    assert again[0] >= 200 - SUBSTEPS
    assert again[-1] == TICKS


@pytest.mark.slow
def test_checkpoint_changes_nothing_in_a_run(form: str, whole: bytes, tmp_path: Path) -> None:
    result = simulated(Checkpoint(tmp_path / "c", every=1e-9), **FORMS[form])
    assert result.save(tmp_path / "result").read_bytes() == whole


@pytest.mark.slow
def test_run_begins_anew_unless_it_is_told_to_go_on(
    form: str, whole: bytes, tmp_path: Path
) -> None:
    path = killed(tmp_path, 200, every=1.0, **FORMS[form])
    result = simulated(Checkpoint(path, "another"), **FORMS[form])
    assert result.save(tmp_path / "result").read_bytes() == whole
    assert not path.exists()


@pytest.mark.parametrize(
    ("label", "more"), [("b", {}), ("a", {"scheme": "matched"}), ("a", {"substeps": 5})]
)
def test_checkpoint_of_another_run_is_refused(
    label: str, more: dict[str, Any], tmp_path: Path
) -> None:
    path = killed(tmp_path, 40, guarded=True)
    with pytest.raises(SnapshotError, match="belongs to another run"):
        simulated(Checkpoint(path, label, resume=True), guarded=True, **more)


def test_rows_that_are_damaged_or_missing_are_refused(tmp_path: Path) -> None:
    path = killed(tmp_path, 40, guarded=True)
    rows = path.with_name("run.checkpoint.rows")
    content = bytearray(rows.read_bytes())
    content[100] ^= 1
    for damage in (bytes(content), content[:-1000], b""):
        rows.write_bytes(damage)
        with pytest.raises(SnapshotError, match="rows' is damaged"):
            simulated(Checkpoint(path, "a", resume=True), guarded=True)
    rows.unlink()
    with pytest.raises(SnapshotError, match="rows' is damaged"):
        simulated(Checkpoint(path, "a", resume=True), guarded=True)


@pytest.mark.slow
def test_rows_written_after_the_last_state_are_written_anew(
    form: str, whole: bytes, tmp_path: Path
) -> None:
    """A kill between the rows and the state that names them."""
    path = killed(tmp_path, 200, every=1.0, **FORMS[form])
    with path.with_name("run.checkpoint.rows").open("ab") as rows:
        rows.write(b"half a row")
    result = simulated(Checkpoint(path, "a", resume=True, every=1e-9), **FORMS[form])
    assert result.save(tmp_path / "result").read_bytes() == whole


def test_result_files_hold_no_time_of_day(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = simulated()
    first = result.save(tmp_path / "a").read_bytes()
    later = time.localtime(time.time() + 1e8)
    monkeypatch.setattr(time, "time", lambda: 2e9)
    monkeypatch.setattr(time, "localtime", lambda *_: later)
    assert result.save(tmp_path / "b").read_bytes() == first
    with zipfile.ZipFile(tmp_path / "b.npz") as archive:
        assert {item.date_time for item in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


@pytest.mark.slow
def test_filter_and_integrator_do_not_drift() -> None:
    """Ten minutes of a motion of 6 s: looked at once a minute, everything is where it was. A day of it is measured by
    benchmarks/control/reliability."""
    arm = rbi.load_robot("two_link")
    controller = laws.controller(arm, 15.0, 40.0, backend="compiled")
    found = rbi.simulate_batch(
        [controller],
        arm.with_payload(0.3),
        rbi.trajectories.cosine(arm, center=0.5, amplitude=0.2, period=6.0),
        environment=np.array([3.0, 0.0, 2.0, 0.0, 0.0, 0.0]),
        duration=600.0,
        substeps=2,
        channels=("q_r", "s", "tau"),
        every=60_000,
        metrics=False,
    )
    for name, rounding in (("q_r", 1e-12), ("s", 1e-10), ("tau", 1e-6)):
        assert np.ptp(found[name][0, 2:], axis=0).max() < rounding


GAINS = ("--k1", "15", "--k2", "40")
ARGUMENTS = ("run", "two_link", *GAINS, "--duration", "3", "--substeps", "1", "--quiet")


@pytest.mark.slow
def test_command_that_is_killed_goes_on_to_the_same_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = ("--out", str(tmp_path / "killed"))
    process = [sys.executable, "-c", _KILLS_ITSELF, *ARGUMENTS, *out]
    assert subprocess.run(process, check=False).returncode == -signal.SIGKILL
    assert not (tmp_path / "killed" / "result.npz").exists()
    assert call(monkeypatch, *ARGUMENTS, *out, "--resume") == 0
    assert call(monkeypatch, *ARGUMENTS, "--out", str(tmp_path / "whole")) == 0
    content = [(tmp_path / name / "result.npz").read_bytes() for name in ("killed", "whole")]
    assert content[0] == content[1]
    names = {path.name for path in (tmp_path / "killed").iterdir()}
    assert not {name for name in names if "checkpoint" in name or name.endswith(".part")}


@pytest.mark.slow
def test_resume_with_other_options_is_refused_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    process = [sys.executable, "-c", _KILLS_ITSELF, *ARGUMENTS, "--out", str(tmp_path)]
    assert subprocess.run(process, check=False).returncode == -signal.SIGKILL
    arguments = (*ARGUMENTS, "--out", str(tmp_path), "--amplitude", "0.3", "--resume")
    assert call(monkeypatch, *arguments) == 2
    assert "belongs to another run" in capsys.readouterr().err.replace("\n", " ")


_KILLS_ITSELF = """
import os, signal
from rbimpedance.simulation import checkpoint as c
from rbimpedance.cli.app import main
c.Checkpoint.__init__.__kwdefaults__["every"] = 0.01
save = c.Checkpoint.save
def save_and_die(self, *arguments):
    save(self, *arguments)
    os.kill(os.getpid(), signal.SIGKILL)
c.Checkpoint.save = save_and_die
main()
"""
