"""Broken logs get a typed error that says what and where, or a named finding; never a guess."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.exceptions import LogError
from rbimpedance.logs import Log

from . import recordings
from .recordings import JOINTS, joint_state, motion, stamps, table, write_bag


def times(changes: dict[int, float]) -> list[float]:
    seconds = [ns / 1e9 for ns in stamps()]
    for row, value in changes.items():
        seconds[row] = value
    return seconds


def column(name: str, changes: dict[int, Any]) -> dict[str, list[Any]]:
    channel, _, joint = name.partition(".")
    values: list[Any] = motion()[channel][:, JOINTS.index(joint)].tolist()
    for row, value in changes.items():
        values[row] = value
    return {name: values}


def truncated(path: Path) -> Path:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    return path


def _truncated_mcap(folder: Path) -> Path:
    (file,) = recordings.bag(folder / "bag", mcap=True).glob("*.mcap")
    return truncated(file)


def _truncated_parquet(folder: Path) -> Path:
    log = Log.from_arrays(np.arange(120) / 50, motion()["position"], joint_names=JOINTS)
    return truncated(log.save(folder / "log.parquet"))


def _truncated_npz(folder: Path) -> Path:
    log = Log.from_arrays(np.arange(120) / 50, motion()["position"], joint_names=JOINTS)
    return truncated(log.save(folder / "log.npz"))


def _half_a_row(folder: Path) -> Path:
    file = table(folder / "log.csv")
    text = file.read_text(encoding="utf-8").rstrip()
    file.write_text(text[: text.rindex(",")], encoding="utf-8")
    return file


def _degrees(folder: Path) -> Path:
    columns = {
        f"position.{joint}": np.degrees(motion()["position"][:, i]).tolist()
        for i, joint in enumerate(JOINTS)
    }
    return table(folder / "log.csv", columns)


def _degrees_per_second(folder: Path) -> Path:
    columns = {
        f"velocity.{joint}": np.degrees(motion()["velocity"][:, i]).tolist()
        for i, joint in enumerate(JOINTS)
    }
    return table(folder / "log.csv", columns)


def _two_topics(folder: Path) -> Path:
    rows = zip(stamps(), motion()["position"], strict=True)
    messages = [
        (topic, ns, joint_state(ns, JOINTS, row))
        for ns, row in rows
        for topic in ("/left", "/right")
    ]
    return write_bag(folder / "bag", messages)


def _no_joints(folder: Path) -> Path:
    header = joint_state(0, JOINTS, [0, 0, 0]).header
    types = recordings.TYPES.types
    vector = types["geometry_msgs/msg/Vector3"](0, 0, 0)
    wrench = types["geometry_msgs/msg/Wrench"](vector, vector)
    return write_bag(folder / "bag", [("/ft", 0, types[recordings.WRENCH](header, wrench))])


def _damaged_info(folder: Path) -> Path:
    data = recordings.lerobot(folder / "set")
    (data / "meta" / "info.json").write_text("{", encoding="utf-8")
    return data


def _nameless(folder: Path) -> Path:
    data = recordings.lerobot(folder / "set")
    file = data / "meta" / "info.json"
    info = json.loads(file.read_text(encoding="utf-8"))
    info["features"]["observation.state"]["names"] = None
    file.write_text(json.dumps(info), encoding="utf-8")
    return data


def _csv(changes: dict[str, Any]) -> Callable[[Path], Path]:
    return lambda folder: table(folder / "log.csv", changes)


ERRORS: dict[str, tuple[Callable[[Path], Path], str]] = {
    "nothing there": (lambda folder: folder / "log.mcap", "no such file"),
    "unknown ending": (lambda folder: table(folder / "log.txt"), "cannot read '.txt'"),
    "NaN": (
        _csv(column("velocity.elbow", {17: float("nan")})),
        "velocity of joint 'elbow' at sample 17 is nan",
    ),
    "infinity": (
        _csv(column("effort.wrist", {3: float("inf")})),
        "effort of joint 'wrist' at sample 3",
    ),
    "words among numbers": (
        _csv(column("position.elbow", {5: "ERR"})),
        "'position.elbow' is not of numbers",
    ),
    "clock set back": (
        _csv({"time": times({k: 0.1 + k / 50 - 1.0 for k in range(60, 120)})}),
        "time goes back by 0.88 s after sample 59",
    ),
    "no time": (_csv({"time": None}), "no column is the time"),
    "two times": (_csv({"stamp": times({})}), "several columns are times"),
    "a row without a time": (_csv({"time": [*times({})[:-1], ""]}), "'time' is empty in row 120"),
    "no positions": (
        _csv({f"position.{joint}": None for joint in JOINTS}),
        "no column is a position",
    ),
    "a joint without velocity": (
        _csv({"velocity.elbow": None}),
        "velocity of 'elbow' is missing",
    ),
    "positions in degrees": (_degrees, "positions look like degrees: .* moves by 57.3 times"),
    "velocities in degrees": (_degrees_per_second, "velocities look like degrees"),
    "truncated MCAP": (_truncated_mcap, "cannot be read as a bag"),
    "truncated Parquet": (_truncated_parquet, "not a whole parquet file"),
    "truncated npz": (_truncated_npz, "not a whole npz file"),
    "truncated CSV": (_half_a_row, "not a whole csv file"),
    "two arms in a bag": (_two_topics, "2 topics with joint states"),
    "no joints in a bag": (_no_joints, "0 topics with joint states"),
    "damaged info of a data set": (_damaged_info, "info.json is damaged"),
    "data set without names": (_nameless, "3 joints without names"),
    "one sample": (
        _csv({"time": [0.0] * 120} | {f"{c}.{j}": [0.0] * 120 for c in motion() for j in JOINTS}),
        r"1 sample\(s\)",
    ),
}


@pytest.mark.parametrize("case", list(ERRORS))
def test_broken_log_is_refused_with_what_is_wrong(tmp_path: Path, case: str) -> None:
    write, words = ERRORS[case]
    with pytest.raises(LogError, match=words):
        Log.read(write(tmp_path))


def _late_stamps(folder: Path) -> Path:
    """The robot's clock runs 1 % slow beside that of the computer that records."""
    rows = zip(stamps(), motion()["position"], strict=True)
    messages = [
        ("/joint_states", ns + 10**9, joint_state(int(ns * 0.9), JOINTS, row)) for ns, row in rows
    ]
    return write_bag(folder / "bag", messages)


def _no_stamps(folder: Path) -> Path:
    rows = zip(stamps(), motion()["position"], strict=True)
    return write_bag(
        folder / "bag", [("/joint_states", ns, joint_state(0, JOINTS, row)) for ns, row in rows]
    )


FINDINGS: dict[str, tuple[Callable[[Path], Path], str, str]] = {
    "a gap": (
        _csv({"time": times({k: k / 50 + 0.5 for k in range(60, 120)})}),
        "gap",
        "the largest is 0.52 s, from t = 1.18 s",
    ),
    "the same sample twice": (
        _csv(
            {"time": times({8: 7 / 50})}
            | {
                f"{c}.{j}": [*a[:8, i], a[7, i], *a[9:, i]]
                for c, a in motion().items()
                for i, j in enumerate(JOINTS)
            }
        ),
        "duplicate",
        "1 sample(s) have the time of the one before: left out",
    ),
    "two samples at one time": (
        _csv({"time": times({8: 7 / 50})}),
        "duplicate",
        "although 1 of them differ",
    ),
    "a channel of NaN": (
        _csv({f"effort.{joint}": [float("nan")] * 120 for joint in JOINTS}),
        "missing",
        "effort was not measured",
    ),
    "a column of something else": (_csv({"battery": [24.0] * 120}), "missing", "battery"),
    "two clocks": (_late_stamps, "clocks", "drift apart by 0.238 s"),
    "no stamps": (_no_stamps, "clocks", "times of recording are used"),
}


@pytest.mark.parametrize("case", list(FINDINGS))
def test_flaw_that_is_known_is_a_finding(tmp_path: Path, case: str) -> None:
    write, kind, words = FINDINGS[case]
    found = Log.read(write(tmp_path)).findings
    assert any(finding.kind == kind and words in finding.words for finding in found), found


def test_invalid_samples_are_left_out_on_request(tmp_path: Path) -> None:
    file = table(tmp_path / "log.csv", column("velocity.elbow", {17: float("nan")}))
    log = Log.read(file, drop_invalid=True)
    assert len(log) == 119
    assert [finding.kind for finding in log.findings] == ["invalid"]


def test_positions_far_beyond_an_arms_limits_are_in_another_unit() -> None:
    arm = rbi.load_robot("ur5")
    t, angles = np.arange(100) / 100, np.tile(np.linspace(0, 200, 100)[:, None], 6)
    log = Log.from_arrays(t, angles, joint_names=arm.joint_names)
    with pytest.raises(LogError, match='unit="deg"'):
        log.on(arm)
    assert (
        np.abs(Log.from_arrays(t, angles / 57.3, joint_names=arm.joint_names).on(arm).q).max() < 4
    )


def test_joint_that_a_log_does_not_have_is_named_with_near_ones(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"no joint 'elbo'.*did you mean 'elbow'"):
        Log.read(table(tmp_path / "log.csv"), joints=["elbo"])
