"""Pictures of a run at the tool: both frames where they are, the wrench, and the compliance as the target has it."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import rbimpedance as rbi
from rbimpedance.pictures.page.scene import scene
from rbimpedance.pictures.tool import compliance_of, poses_of
from rbimpedance.pictures.viewer import animate
from rbimpedance.trajectories import cartesian

from ..browser import Browser, find_browser
from ..runs import swung

STIFFNESS = np.array([1000.0, 500.0, 200.0, 30.0, 30.0, 30.0])
FORCE = np.array([0.0, 0.0, 12.0, 0.0, 0.0, 0.0])
TURNED = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()


@functools.cache
def run(axes: str = "world") -> rbi.SimulationResult:
    """A pushed tool on a line."""
    arm, given = rbi.load_robot("ur5", armature=0.1), TURNED if axes == "turned" else axes
    q = np.array([0.0, -1.2, 1.6, -1.9, -1.57, 0.3])
    start = rbi.Pose(*arm.frame_placement(q))
    controller = rbi.CartesianController(
        arm, rbi.CartesianImpedance((3.0, 0.15), STIFFNESS, axes=given), dt=2e-3
    )
    line = cartesian.line(start, [0.0, 0.1, 0.05], 0.06, rotation=[0.3, 0.0, 0.0])
    return rbi.simulate(controller, arm, line, environment=FORCE, q0=q, duration=0.06, substeps=1)


@pytest.mark.parametrize("axes", ["world", "reference", "turned"])
def test_compliance_is_that_of_the_target_in_its_axes(axes: str, tmp_path: Path) -> None:
    """R·diag(sizes)·Rᵀ is the compliance in world axes, of a run from a file, too."""
    result = run(axes)
    assert result.tool is not None
    R_r = result.tool.rotation_r[-1]
    R_c = {"world": np.eye(3), "reference": R_r, "turned": TURNED}[axes]
    expected = R_c @ np.diag(1.0 / STIFFNESS[:3]) @ R_c.T
    for each in (result, rbi.SimulationResult.load(result.save(tmp_path / "run.npz"))):
        found = compliance_of(each)
        assert found is not None
        R = found.rotation(R_r)
        assert_allclose(R @ np.diag(found.sizes) @ R.T, expected, atol=1e-15)
        assert np.linalg.det(R) == pytest.approx(1.0)


def test_scene_has_both_frames_where_they_are_and_the_force_at_the_tool() -> None:
    result = run()
    viewer: Any = animate(result, fps=500.0)
    drawn = scene(viewer._drawing, viewer._frames, **viewer._settings)
    log = result.tool
    assert log is not None
    poses = drawn["frames"]["tool"]
    assert poses.shape == (31, 3, 7)
    for i, (R, p) in enumerate(((log.rotation, log.position), (log.rotation_r, log.position_r))):
        for k in (0, 15, 30):
            placed = pin.XYZQUATToSE3(poses[k, i])
            assert_allclose(placed.rotation, R[k], atol=1e-12)
            assert_allclose(placed.translation, p[k], atol=1e-12)
    assert_allclose(drawn["frames"]["wrenches"][5, 0], [*log.position[5], *FORCE], atol=1e-6)
    assert_allclose(drawn["trace"], log.position, atol=1e-12)
    assert_allclose(drawn["compliance"] / drawn["compliance"].max(), [0.2, 0.4, 1.0])


def test_other_runs_have_neither_frames_nor_compliance() -> None:
    result = swung(rbi.load_robot("two_link"))
    viewer: Any = animate(result)
    drawn = scene(viewer._drawing, viewer._frames, **viewer._settings)
    assert drawn["now"]["tool"] is None
    assert drawn["compliance"] is None
    assert poses_of(result, 0, None) is None
    for draw in (rbi.figures.tool_path, rbi.figures.tool_errors):
        with pytest.raises(rbi.ParameterError, match="controller at the tool"):
            draw(result)


def test_figure_shows_paths_frames_and_force_where_they_are() -> None:
    result = run()
    log = result.tool
    assert log is not None
    (space,) = rbi.figures.tool_path(result).axes
    curves: list[Any] = [np.column_stack(line.get_data_3d()) for line in space.lines]  # type: ignore[attr-defined]
    assert_allclose(curves[0], log.position_r)
    assert_allclose(curves[1], log.position)
    ends = np.array([curve[1] - curve[0] for curve in curves[2:5]])
    assert_allclose(ends / np.linalg.norm(ends, axis=1)[:, None], log.rotation[0].T, atol=1e-12)
    assert [text.get_text() for text in space.texts] == ["12 N"]
    assert [space.get_xlabel(), space.get_ylabel()] == ["x [m]", "y [m]"]


def test_errors_have_their_units_on_the_axes() -> None:
    panels = rbi.figures.tool_errors(run()).axes
    assert [axes.get_ylabel() for axes in panels] == [
        "$e_1$ [m]", "$e_1$ [rad]", "force [N]", r"moment [N$\cdot$m]",
    ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.skipif(find_browser() is None, reason="no Chromium on this machine")
def test_page_shows_frames_and_compliance(tmp_path: Path) -> None:
    path = run().save_html(tmp_path / "run.html")
    with Browser(str(find_browser())) as browser:
        browser.show(path.as_uri())
        browser.run("player.pause()")
        whole = browser.picture()
        for part in ("frames", "compliance"):
            browser.run(f"player.toggle('{part}', false)")
            without = browser.picture()
            assert float((np.abs(whole - without).max(axis=2) > 8).mean()) > 5e-4
            browser.run(f"player.toggle('{part}', true)")
        assert browser.errors == []
