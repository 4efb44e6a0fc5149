"""The same motion, written by other programs in their forms, is one and the same log."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rosbags.highlevel import AnyReader

from rbimpedance.logs import Log

from . import recordings
from .recordings import COUNT, JOINTS, joint_state, motion, stamps, write_bag


def is_the_motion(log: Log) -> bool:
    same = [np.array_equal(getattr(log, name), array) for name, array in motion().items()]
    return log.joint_names == JOINTS and log.stamps.tolist() == stamps() and all(same)


@pytest.mark.parametrize("mcap", [False, True], ids=["sqlite", "mcap"])
def test_a_rosbag2_is_the_motion(tmp_path: Path, mcap: bool) -> None:
    log = Log.read(recordings.bag(tmp_path / "bag", mcap=mcap))
    assert is_the_motion(log)
    assert not log.findings


def test_a_bare_mcap_file_is_the_motion(tmp_path: Path) -> None:
    (file,) = recordings.bag(tmp_path / "bag", mcap=True).glob("*.mcap")
    assert is_the_motion(Log.read(file))


def test_a_csv_with_shuffled_columns_is_the_motion(tmp_path: Path) -> None:
    assert is_the_motion(Log.read(recordings.table(tmp_path / "log.csv"), joints=JOINTS))


def test_an_episode_of_a_lerobot_data_set_is_the_motion(tmp_path: Path) -> None:
    data = recordings.lerobot(tmp_path / "set")
    assert is_the_motion(Log.read(data, episode=1))
    first = Log.read(data)
    assert not first.position.any()
    assert [f.kind for f in first.findings] == ["episode"]


@pytest.mark.parametrize("ending", ["mcap", "csv", "parquet", "npz"])
def test_what_is_written_reads_back_bit_by_bit(tmp_path: Path, ending: str) -> None:
    rng = np.random.default_rng(1)
    log = Log.from_arrays(
        np.cumsum(rng.uniform(1e-4, 2e-4, 50)),
        rng.normal(size=(50, 3)) * 10.0 ** rng.integers(-300, 300, (50, 3)),
        joint_names=JOINTS,
        effort=rng.normal(size=(50, 3)),
        external=rng.normal(size=(50, 3)),
        wrench=rng.normal(size=(50, 6)),
    )
    again = Log.read(log.save(tmp_path / f"log.{ending}"))
    assert (again.joint_names, again.velocity, again.findings) == (JOINTS, None, ())
    for name in ("stamps", "position", "effort", "external", "wrench"):
        assert getattr(again, name).tobytes() == getattr(log, name).tobytes(), name


@settings(max_examples=20, deadline=None)
@given(
    st.lists(
        st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1),
        min_size=1,
        max_size=4,
        unique=True,
    ),
    st.data(),
)
def test_messages_with_any_names_of_joints_read_back(
    tmp_path_factory: pytest.TempPathFactory, names: list[str], data: st.DataObject
) -> None:
    position = data.draw(arrays(float, (3, len(names)), elements=st.floats(-1e9, 1e9)))
    file = tmp_path_factory.mktemp("names") / "log.mcap"
    log = Log.from_arrays([0.0, 1.0, 2.0], position, joint_names=names)
    again = Log.read(log.save(file))
    assert again.joint_names == tuple(names)
    assert np.array_equal(again.position, position)


def test_other_readers_of_mcap_open_what_is_written(tmp_path: Path) -> None:
    file = Log.from_arrays(np.arange(COUNT) / 50.0, motion()["position"], joint_names=JOINTS).save(
        tmp_path / "log.mcap"
    )
    with AnyReader([file]) as reader:
        (connection,) = reader.connections
        messages: list[Any] = [
            reader.deserialize(raw, connection.msgtype) for _, _, raw in reader.messages()
        ]
    assert connection.topic == "/joint_states"
    assert np.array_equal([m.position for m in messages], motion()["position"])
    assert all(tuple(m.name) == JOINTS and len(m.effort) == 0 for m in messages)


def test_messages_in_any_order_of_joints_are_sorted_and_it_is_said(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    messages = []
    for ns, row in zip(stamps(), motion()["position"], strict=True):
        order = rng.permutation(3)
        names = [JOINTS[i] for i in order]
        messages.append(("/joint_states", ns, joint_state(ns, names, row[order])))
    log = Log.read(write_bag(tmp_path / "bag", messages), joints=JOINTS)
    assert np.array_equal(log.position, motion()["position"])
    assert "order" in [finding.kind for finding in log.findings]


def test_messages_of_a_gripper_on_the_same_topic_are_left_out_and_it_is_said(
    tmp_path: Path,
) -> None:
    messages = []
    for ns, row in zip(stamps(), motion()["position"], strict=True):
        messages.append(("/joint_states", ns, joint_state(ns, JOINTS, row)))
        if ns % 40_000_000 == 0:
            messages.append(("/joint_states", ns + 1, joint_state(ns + 1, ["finger"], [0.1])))
    log = Log.read(write_bag(tmp_path / "bag", messages))
    assert np.array_equal(log.position, motion()["position"])
    assert [finding.kind for finding in log.findings] == ["partial"]


def test_a_wrench_with_times_of_its_own_is_held_and_it_is_said(tmp_path: Path) -> None:
    wrench_types = recordings.TYPES.types
    vector = wrench_types["geometry_msgs/msg/Vector3"]
    messages = []
    for k, (ns, row) in enumerate(zip(stamps(), motion()["position"], strict=True)):
        state = joint_state(ns, JOINTS, row)
        messages.append(("/joint_states", ns, state))
        if k % 2 == 0:
            wrench = wrench_types["geometry_msgs/msg/Wrench"](vector(k, 0, 0), vector(0, 0, k))
            messages.append(("/ft", ns, wrench_types[recordings.WRENCH](state.header, wrench)))
    log = Log.read(write_bag(tmp_path / "bag", messages))
    assert log.wrench is not None
    assert log.wrench[:6, 0].tolist() == [0, 0, 2, 2, 4, 4]
    assert [finding.kind for finding in log.findings] == ["held"]


def test_degrees_are_converted_where_they_are_named(tmp_path: Path) -> None:
    degrees: dict[str, Any] = {
        f"{channel}.{joint}": None for channel in ("position", "velocity") for joint in JOINTS
    }
    for channel in ("position", "velocity"):
        unit = "deg" if channel == "position" else "deg/s"
        for i, joint in enumerate(JOINTS):
            degrees[f"{channel}.{joint} [{unit}]"] = np.degrees(motion()[channel][:, i]).tolist()
    log = Log.read(recordings.table(tmp_path / "log.csv", degrees), joints=JOINTS)
    np.testing.assert_allclose(log.position, motion()["position"], rtol=1e-15, atol=1e-16)
    assert {finding.kind for finding in log.findings} == {"unit"}
    plain = {name.partition(" [")[0]: column for name, column in degrees.items() if column}
    log = Log.read(recordings.table(tmp_path / "plain.csv", plain), joints=JOINTS, unit="deg")
    assert log.velocity is not None
    np.testing.assert_allclose(log.velocity, motion()["velocity"], rtol=1e-15, atol=1e-16)


def test_reading_logs_is_imported_on_demand() -> None:
    code = (
        "import sys, rbimpedance.logs; assert not {'rosbags', 'mcap', 'pyarrow'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
