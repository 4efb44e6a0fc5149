"""`SimulationResult`: metrics against numbers worked out by hand, and its file."""

from __future__ import annotations

import json
import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import rbimpedance as rbi
from rbimpedance.control import telemetry
from rbimpedance.control.telemetry import FLAGS
from rbimpedance.trajectories import hold

from .. import arms, laws

Array = NDArray[np.float64]
REALS = ("t", "q", "v", "q_r", "e1", "e2", "e_im", "s", "tau", "tau_ext")
CHANNELS = (*REALS, *FLAGS, "wrench", "tau_stop")


def result(t: Array, **channels: Any) -> rbi.SimulationResult:
    """Two joints; channels that are not given are zero."""
    arrays: dict[str, Any] = {name: np.zeros((len(t), 2)) for name in REALS if name != "t"}
    arrays |= {name: np.zeros((len(t), 2), dtype=np.bool_) for name in FLAGS}
    arrays |= {name: np.array(x, dtype=float) for name, x in channels.items()}
    provenance = {"plant": {"joint_names": ["hip", "knee"]}, "note": "π"}
    return rbi.SimulationResult(t=t, **arrays, provenance=provenance)


T = np.array([0.0, 0.5, 1.0, 1.5])
E1 = [[3.0, 0.0], [-0.005, 0.0], [0.0005, 0.0], [-0.00005, 0.0]]
TAU = [[0.0, 1.0], [2.0, 1.0], [-1.0, 1.0], [-1.5, 1.0]]


@pytest.fixture(scope="module")
def run() -> rbi.SimulationResult:
    """A short run of a real loop."""
    arm = arms.spinner()
    controller = laws.controller(
        arm,
        surface=rbi.PowerSurface(3.0, 5.0 / 3.0),
        reaching=rbi.SuperTwisting(8.0, [10.0, 11.0, 12.0]),
        dt=0.01,
    )
    return rbi.simulate(
        controller, arm.with_payload(0.3), hold(arm), environment=np.ones(6), duration=0.2
    )


# --- metrics -------------------------------------------------------------------------------------


def test_largest_and_rms_errors_are_those_by_hand() -> None:
    figures = result(
        T,
        e1=[[1.0, 0.0], [-2.0, 0.0], [0.0, 0.0], [0.0, 4.0]],
        e2=[[0.0, 0.0]] * 3 + [[-6.0, 8.0]],
        e_im=[[1.0, -1.0]] * 4,
    ).metrics()
    assert_array_equal(figures["e1_max"], [2.0, 4.0])
    assert_allclose(figures["e1_rms"], [np.sqrt(5.0 / 4.0), 2.0], rtol=1e-15)
    assert_array_equal(figures["e2_max"], [6.0, 8.0])
    assert_allclose(figures["e2_rms"], [3.0, 4.0], rtol=1e-15)
    assert_array_equal(figures["e_im_max"], [1.0, 1.0])
    assert_array_equal(figures["e_im_rms"], [1.0, 1.0])


def test_settling_times_are_those_by_hand() -> None:
    """Joint 1 enters 1e-2 at 0.5 s, 1e-3 at 1 s, 1e-4 at 1.5 s; joint 2 is there from the start."""
    figures = result(T, e1=E1).metrics()
    assert_array_equal(figures["settling_1e-2"], [0.5, 0.0])
    assert_array_equal(figures["settling_1e-3"], [1.0, 0.0])
    assert_array_equal(figures["settling_1e-4"], [1.5, 0.0])


@pytest.mark.parametrize(
    ("e1", "time"),
    [
        ([0.0, 0.0, 0.0, 0.0], 0.0),
        ([1.0, 1.0, 1.0, 1.0], np.inf),
        ([0.0, 0.0, 0.0, -1.0], np.inf),
        ([1.0, 0.0, 0.0, 0.0], 0.5),
        ([0.0, -1.0, 0.0, 0.0], 1.0),
        ([1.0, 0.0, 1.0, 0.0], 1.5),
        ([0.5, 0.5, 0.5, 0.5], 0.0),
    ],
)
def test_settled_means_from_then_on(e1: list[float], time: float) -> None:
    run = result(T, e1=np.transpose([e1, e1]))
    assert_array_equal(run.settling_time(0.5), [time, time])


def test_torque_figures_are_those_by_hand() -> None:
    figures = result(T, tau=TAU).metrics()
    assert_array_equal(figures["tau_peak"], [2.0, 1.0])
    assert_allclose(figures["tau_variation"], [(2.0 + 3.0 + 0.5) / 1.5, 0.0], rtol=1e-15)


def test_samples_before_a_time_can_be_left_out() -> None:
    figures = result(T, e1=E1, tau=TAU).metrics(after=0.75)
    assert_array_equal(figures["e1_max"], [0.0005, 0.0])
    assert_array_equal(figures["tau_peak"], [1.5, 1.0])
    assert_allclose(figures["tau_variation"], [0.5 / 0.5, 0.0], rtol=1e-15)
    assert_array_equal(figures["settling_1e-2"], [0.5, 0.0])


def test_every_figure_is_per_joint() -> None:
    figures = result(T).metrics()
    errors = {f"{e}_{kind}" for e in ("e1", "e2", "e_im") for kind in ("max", "rms")}
    settling = {"settling_1e-2", "settling_1e-3", "settling_1e-4"}
    assert set(figures) >= errors | settling | {"tau_peak", "tau_variation"}
    assert {x.shape for x in figures.values()} == {(2,)}


@pytest.mark.parametrize("after", [1.25, 1.5, 9.0])
def test_figures_of_less_than_two_samples_are_refused(after: float) -> None:
    with pytest.raises(rbi.ParameterError, match=r"^after must be before the last two samples"):
        result(T).metrics(after=after)


def test_joint_names_are_the_plants() -> None:
    assert result(T).joint_names == ("hip", "knee")


def test_table_of_channels_is_what_a_result_has() -> None:
    """Names, shapes and kinds of the table are those of the arrays; every flag is the controller's."""
    run = result(T)
    for channel in telemetry.CHANNELS:
        array = getattr(run, channel.name)
        assert array.shape == channel.shape(4, 2, 2)
        assert (array.dtype == np.bool_) == channel.is_flag
        if channel.source == "controller":
            assert channel.name in rbi.ControllerOutput._fields
    assert sorted(CHANNELS) == sorted(channel.name for channel in telemetry.CHANNELS)


# --- file ----------------------------------------------------------------------------------------


def test_file_gives_back_every_bit(run: rbi.SimulationResult, tmp_path: Path) -> None:
    other = rbi.SimulationResult.load(run.save(tmp_path / "run.npz"))
    for name in CHANNELS:
        assert_array_equal(getattr(other, name), getattr(run, name))
        assert getattr(other, name).dtype == getattr(run, name).dtype
    assert other.provenance == run.provenance
    assert other.joint_names == ("spin", "slide", "tilt")


def test_extreme_numbers_survive_the_file(tmp_path: Path) -> None:
    odd = [[np.nan, -0.0], [np.inf, 5e-324], [-np.inf, 1.7e308], [0.1, 1.0 / 3.0]]
    other = rbi.SimulationResult.load(result(T, tau=odd).save(tmp_path / "odd.npz"))
    assert other.tau.tobytes() == np.array(odd).tobytes()
    assert other.provenance["note"] == "π"


def test_provenance_says_what_was_run(run: rbi.SimulationResult) -> None:
    origin = json.loads(json.dumps(run.provenance))
    assert origin == run.provenance
    assert origin["dt"] == 0.01
    assert (origin["substeps"], origin["integrator"]) == (4, "semi-implicit")
    assert {"rbimpedance", "pin", "numpy", "scipy", "python"} <= set(origin["versions"])
    assert origin["versions"]["numpy"] == np.__version__
    assert origin["controller"]["arm"]["digest"] == arms.spinner().digest
    assert origin["plant"]["digest"] == arms.spinner().with_payload(0.3).digest
    assert origin["controller"]["reaching"]["k2"] == [10.0, 11.0, 12.0]
    assert origin["controller"]["surface"]["type"] == "PowerSurface"
    assert origin["controller"]["impedance"]["stiffness"] == 20.0


def test_file_carries_a_unit_for_every_array(run: rbi.SimulationResult, tmp_path: Path) -> None:
    with np.load(run.save(tmp_path / "run.npz"), allow_pickle=False) as archive:
        header = json.loads(str(archive["header"]))
        assert set(archive.files) == set(header["units"]) | {"header"}
    assert header["units"]["t"] == "s"
    assert all(header["units"].values())


@pytest.mark.parametrize(
    ("name", "written"),
    [("run", "run.npz"), ("run.npz", "run.npz"), ("v1.2", "v1.2.npz"), ("a.NPZ", "a.NPZ.npz")],
)
def test_ending_is_added_where_it_is_missing(tmp_path: Path, name: str, written: str) -> None:
    assert result(T).save(tmp_path / name) == tmp_path / written
    assert [path.name for path in tmp_path.iterdir()] == [written]


def test_path_may_be_text(tmp_path: Path) -> None:
    path = result(T).save(str(tmp_path / "run.npz"))
    assert_array_equal(rbi.SimulationResult.load(str(path)).t, T)


def test_saving_again_replaces_the_file(tmp_path: Path) -> None:
    result(T, e1=E1).save(tmp_path / "run")
    path = result(T + 1.0).save(tmp_path / "run")
    assert_array_equal(rbi.SimulationResult.load(path).t, T + 1.0)


def test_file_has_the_permissions_of_any_other(tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.touch()
    assert result(T).save(tmp_path / "run").stat().st_mode == other.stat().st_mode


@pytest.mark.parametrize("stage", ["savez_compressed", "fsync", "replace"])
def test_failed_saving_leaves_the_old_file_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stage: str
) -> None:
    path = result(T, e1=E1).save(tmp_path / "run.npz")
    old = path.read_bytes()

    def fail(*_: object, **__: object) -> None:
        raise OSError("disk full")

    owner = {"savez_compressed": "numpy", "fsync": "os", "replace": "pathlib.Path"}[stage]
    monkeypatch.setattr(f"{owner}.{stage}", fail)
    with pytest.raises(OSError, match="disk full"):
        result(T + 1.0).save(path)
    assert path.read_bytes() == old
    assert list(tmp_path.iterdir()) == [path]


def test_every_truncated_file_is_refused(tmp_path: Path) -> None:
    path = result(T, e1=E1).save(tmp_path / "run.npz")
    whole, cut = path.read_bytes(), tmp_path / "cut.npz"
    for size in range(0, len(whole) - 1, 97):
        cut.write_bytes(whole[:size])
        with pytest.raises(rbi.ModelError, match="not a complete result file"):
            rbi.SimulationResult.load(cut)


@pytest.mark.parametrize("name", ["header", *CHANNELS])
def test_damaged_member_is_refused(run: rbi.SimulationResult, tmp_path: Path, name: str) -> None:
    path = run.save(tmp_path / "run.npz")
    with zipfile.ZipFile(path) as archive:
        member = archive.getinfo(f"{name}.npy")
    content = bytearray(path.read_bytes())
    end = member.header_offset + 30 + len(member.filename) + member.compress_size
    content[end - 20] ^= 0xFF
    path.write_bytes(bytes(content))
    with pytest.raises(rbi.ModelError, match="not a complete result file"):
        rbi.SimulationResult.load(path)


def header(**changes: Any) -> Array:
    return np.array(json.dumps({"format": 2, "units": {}, "provenance": {}} | changes))


ZEROS = {name: np.zeros(3) for name in CHANNELS}
FOREIGN: dict[str, tuple[dict[str, Any], str]] = {
    "no header": (ZEROS, "not a complete result file"),
    "header is no JSON": (ZEROS | {"header": np.array("{")}, "not a complete result file"),
    "header is a list": (ZEROS | {"header": np.array("[1]")}, "not a complete result file"),
    "header is an object": (
        ZEROS | {"header": np.array([{"format": 2}], dtype=object)},
        "not a complete result file",
    ),
    "no provenance": (ZEROS | {"header": np.array('{"format": 2}')}, "not a complete result file"),
    "no arrays": ({"header": header()}, "not a complete result file"),
    "pickled array": (
        ZEROS | {"header": header(), "tau": np.array([1.0, None], dtype=object)},
        "not a complete result file",
    ),
    "another format": (ZEROS | {"header": header(format=99)}, "format 99; this version reads 2"),
}


@pytest.mark.parametrize(("content", "words"), FOREIGN.values(), ids=FOREIGN)
def test_foreign_archive_is_refused(tmp_path: Path, content: dict[str, Any], words: str) -> None:
    np.savez(tmp_path / "foreign.npz", **content)
    with pytest.raises(rbi.ModelError, match=words):
        rbi.SimulationResult.load(tmp_path / "foreign.npz")


def test_what_is_no_archive_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text.npz").write_text("t, q\n0, 1\n")
    np.save(tmp_path / "array.npy", T)
    for path in (tmp_path / "text.npz", tmp_path / "array.npy", tmp_path):
        with pytest.raises(rbi.ModelError, match="not a complete result file"):
            rbi.SimulationResult.load(path)


def test_file_of_a_version_with_fewer_channels_is_read(
    run: rbi.SimulationResult, tmp_path: Path
) -> None:
    """As version 0.1 wrote it: what it did not log is NaN, and flags are False."""
    older = [name for name in CHANNELS if name not in ("wrench", "tau_stop", "clipped")]
    told = header(units=dict.fromkeys(older, ""), provenance=run.provenance)
    np.savez(tmp_path / "old.npz", header=told, **{name: getattr(run, name) for name in older})
    read = rbi.SimulationResult.load(tmp_path / "old.npz")
    for name in older:
        assert_array_equal(getattr(read, name), getattr(run, name))
    assert read.wrench.shape == (len(run.t), 6)
    assert np.isnan(read.wrench).all()
    assert np.isnan(read.tau_stop).all()
    assert not read.clipped.any()


def test_missing_file_is_said_to_be_missing(tmp_path: Path) -> None:
    with pytest.raises(rbi.ModelError, match=r"^no result file '.*gone.npz'"):
        rbi.SimulationResult.load(tmp_path / "gone.npz")


# --- wrenches ------------------------------------------------------------------------------------


def pushed(wrench: Any, duration: float = 0.05) -> rbi.SimulationResult:
    arm = arms.spinner()
    controller = laws.controller(arm, surface=rbi.PowerSurface(3.0, 5.0 / 3.0), dt=0.005)
    return rbi.simulate(controller, arm, hold(arm), environment=wrench, duration=duration)


def test_logged_wrench_explains_the_logged_torque() -> None:
    """A force at another frame, moved to the tool, exerts the same torque there."""
    other = rbi.FrameWrench([1.0, 2.0, 3.0, 0.1, 0.2, 0.3], frame="hand", expressed_in="local")
    both = rbi.interaction.Sum(rbi.FrameWrench(lambda t: [t, 0, 0, 0, 0, 1.0]), other)
    run = pushed(both)
    for q, wrench, tau_ext in zip(run.q, run.wrench, run.tau_ext, strict=True):
        assert_allclose(arms.spinner().external_torque(q, wrench), tau_ext, atol=1e-12)


def test_wrench_of_a_wall_is_its_contact_force() -> None:
    arm = arms.spinner()
    _, tool = arm.frame_placement(arm.ready)
    wall = rbi.Wall(tool + np.array([0.0, 0.0, 0.001]), [0.0, 0.0, 1.0], 1000.0)
    run = pushed(wall)
    for t, q, v, wrench in zip(run.t, run.q, run.v, run.wrench, strict=True):
        assert_allclose(wrench, [0.0, 0.0, wall.force(arm, t, q, v), 0.0, 0.0, 0.0], atol=1e-12)
    assert run.wrench[0, 2] == pytest.approx(1.0)


def test_wrench_is_zero_where_nothing_acts_at_a_frame_and_nan_where_it_is_not_said() -> None:
    class Hidden:
        def torque(self, arm: rbi.ArmModel, t: float, q: Array, v: Array) -> Array:
            del t, q, v
            return np.ones(arm.nv)

    assert not pushed(None).wrench.any()
    assert not pushed(rbi.JointTorque([1.0, 2.0, 3.0])).wrench.any()
    assert np.isnan(pushed(Hidden()).wrench).all()
    mixed = rbi.interaction.Sum(rbi.FrameWrench(np.ones(6)), Hidden())
    assert np.isnan(pushed(mixed).wrench).all()


def test_wrench_of_a_function_survives_pickling_and_the_file(tmp_path: Path) -> None:
    run = pushed(lambda t: [np.sin(9.0 * t), 0.0, 0.0, 0.0, 0.0, 0.0])
    expected = np.sin(9.0 * run.t)
    for other in (
        pickle.loads(pickle.dumps(run)),
        rbi.SimulationResult.load(run.save(tmp_path / "x")),
    ):
        assert_allclose(other.wrench[:, 0], expected, atol=1e-15)
        assert not other.tau_stop.any()
