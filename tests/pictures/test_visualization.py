"""The viewer without a browser: what it draws and where, what its files hold, and how its server behaves."""

from __future__ import annotations

import base64
import dataclasses
import gzip
import http.client
import json
import os
import pickle
import re
import socket
import webbrowser
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import trimesh

import rbimpedance as rbi
from rbimpedance import ArmModel, ModelError, ParameterError, SimulationResult, load_robot, view
from rbimpedance.interaction import FrameWrench, Sum
from rbimpedance.pictures.page.drawing import Drawing
from rbimpedance.pictures.page.meshes import ColoredMesh, read_mesh, thinned
from rbimpedance.pictures.page.shapes import look_of
from rbimpedance.pictures.viewer import MOST_FRAMES, _at_tool, animate

from ..arms import LIMIT, mimic_urdf, spinner_urdf, urdf, urdf_joint, urdf_link
from ..runs import swung


def scene_of(html: str) -> tuple[dict[str, Any], bytes]:
    """The header of the scene that a page carries, and its arrays."""
    found = re.search(r'id="scene">([^<]*)<', html)
    assert found is not None
    content = gzip.decompress(base64.b64decode(found[1]))
    size = int.from_bytes(content[:4], "little")
    return json.loads(content[4 : 4 + size]), content[4 + size :]


def numbers(pointer: dict[str, Any], arrays: bytes) -> np.ndarray[Any, np.dtype[np.float32]]:
    return np.frombuffer(arrays[pointer["start"] : pointer["end"]], "<f4")


@pytest.fixture(scope="module")
def two_link() -> ArmModel:
    return load_robot("two_link")


@pytest.fixture(scope="module")
def panda() -> ArmModel:
    return load_robot("panda")


# --- what is drawn, and where -----------------------------------------------------------------------------------


def test_every_visual_of_the_urdf_is_drawn_where_the_arm_carries_it(two_link: ArmModel) -> None:
    q1, q2 = 0.3, 0.5
    poses = Drawing(two_link).poses(np.array([q1, q2]))
    assert len(poses) == 7
    elbow = 0.8 * np.array([np.cos(q1), 0.0, np.sin(q1)])
    tool = elbow + 0.8 * np.array([np.cos(q1 + q2), 0.0, np.sin(q1 + q2)])
    beside = np.array([0.0, -0.15, 0.0])
    np.testing.assert_allclose(poses[-1, :3], tool + beside, atol=1e-12)
    np.testing.assert_allclose(poses[4, :3], (elbow + tool) / 2.0 + beside, atol=1e-12)


@pytest.mark.slow
def test_locked_fingers_stay_where_they_were_locked() -> None:
    fingers = ("panda_finger_joint1", "panda_finger_joint2")
    free = load_robot("panda")
    locked = load_robot("panda", lock=fingers, locked_configuration={fingers[0]: 0.03})
    q = np.append(locked.neutral, 0.03)
    np.testing.assert_allclose(
        Drawing(locked).poses(locked.neutral), Drawing(free).poses(q), atol=1e-12
    )


@pytest.mark.parametrize(
    "arm",
    [
        ArmModel(pin.buildSampleModelManipulator(), name="sample", tool_frame="effector_body"),
        load_robot(spinner_urdf()),
        load_robot(mimic_urdf()),
    ],
    ids=["no URDF", "no shapes", "mimic"],
)
def test_arm_without_shapes_is_drawn_from_joint_to_joint(arm: ArmModel) -> None:
    drawing = Drawing(arm)
    rng = np.random.default_rng(3)
    for q in (arm.neutral, arm.random_configuration(rng)):
        corners = drawing.corners(drawing.poses(q))
        for frame in arm.joint_names:
            _, origin = arm.frame_placement(q, frame)
            assert (corners.min(axis=0) < origin).all()
            assert (corners.max(axis=0) > origin).all()


@pytest.mark.slow
def test_payload_changes_nothing_in_the_picture(panda: ArmModel) -> None:
    loaded = pickle.loads(pickle.dumps(panda.with_payload(2.0)))
    assert loaded.description == panda.description
    q = panda.neutral
    np.testing.assert_array_equal(Drawing(loaded).poses(q), Drawing(panda).poses(q))


MESH = '<geometry><mesh filename="{}" scale="0.001 0.001 0.001"/></geometry>'


def with_mesh(folder: Path, name: str, collision: str = "") -> ArmModel:
    """An arm of one link that shows a mesh file of the folder."""
    hand = urdf_link("hand", 1.0).replace(
        "</link>", f"<visual>{MESH.format(name)}</visual>{collision}</link>"
    )
    path = folder / "arm.urdf"
    path.write_text(urdf(urdf_joint("turn", "revolute", "base", "hand", "0 1 0", LIMIT), hand))
    return load_robot(path)


def test_mesh_is_shown_in_its_scale(tmp_path: Path) -> None:
    trimesh.creation.box((100.0, 200.0, 300.0)).export(tmp_path / "box.stl")
    look = look_of(with_mesh(tmp_path, "box.stl"))
    boxes = [box for box in look.boxes if np.allclose(np.ptp(box, axis=0), [0.1, 0.2, 0.3])]
    assert len(boxes) == 1
    assert look.notes == ()


@pytest.mark.parametrize(
    ("name", "word"),
    [("none.stl", "it does not exist"), ("bad.stl", "bad.stl"), ("no.xyz9", "no.xyz9")],
)
def test_mesh_that_cannot_be_shown_is_named_and_replaced(
    tmp_path: Path, name: str, word: str
) -> None:
    if name != "none.stl":
        (tmp_path / name).write_bytes(b"version https://git-lfs.github.com/spec/v1\n")
    collision = '<collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision>'
    for arm, shown in (
        (with_mesh(tmp_path, name, collision), "Box"),
        (with_mesh(tmp_path, name), "BVHModelOBBRSS"),
    ):
        look = look_of(arm)
        assert len(look.notes) == 1
        assert word in look.notes[0]
        kinds = {type(item.geometry).__name__ for item in look.geometry.geometryObjects}
        assert shown in kinds


# --- meshes -----------------------------------------------------------------------------------------------------


def test_edges_of_a_box_stay_sharp_and_a_ball_stays_round(tmp_path: Path) -> None:
    for name, solid, corners in (
        ("box.stl", trimesh.creation.box((1.0, 2.0, 3.0)), 24),
        ("ball.stl", trimesh.creation.icosphere(subdivisions=3), 642),
    ):
        solid.export(tmp_path / name)
        mesh = ColoredMesh(read_mesh(tmp_path / name, (1, 1, 1)))
        assert len(mesh.vertices) == corners
        assert len(mesh.faces) == len(solid.faces)


def test_thinned_mesh_keeps_its_shape(tmp_path: Path) -> None:
    trimesh.creation.icosphere(subdivisions=5).export(tmp_path / "ball.stl")
    (part,) = thinned(read_mesh(tmp_path / "ball.stl", (1, 1, 1)), 0.1)
    assert len(part.faces) == pytest.approx(2048, rel=0.05)
    solid = trimesh.Trimesh(part.vertices, part.faces)
    assert solid.volume == pytest.approx(4.0 / 3.0 * np.pi, rel=0.01)


# --- files ------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_panda_file_is_below_a_megabyte_and_holds_its_visuals_only(
    panda: ArmModel, tmp_path: Path
) -> None:
    path = view(panda).save_html(tmp_path / "panda.html")
    assert path.stat().st_size < 1e6
    header, _ = scene_of(path.read_text(encoding="utf-8"))
    assert len(header["nodes"]) == 11
    assert header["frames"] is None


@pytest.mark.slow
def test_mesh_that_occurs_twice_is_stored_once() -> None:
    header, _ = scene_of(view("panda").html())
    fingers = [node for node in header["nodes"] if "like" in node]
    assert len(fingers) == 1


def test_page_names_the_arm_as_text() -> None:
    xml = spinner_urdf().replace(
        'name="arm"', 'name="&lt;script&gt;alert(1)&lt;/script&gt;{{style}}"'
    )
    html = view(load_robot(xml)).html()
    assert "<script>alert" not in html
    assert "<title>&lt;script&gt;alert(1)&lt;/script&gt;{{style}}</title>" in html


def test_file_appears_whole_or_not_at_all(
    two_link: ArmModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    viewer = view(two_link)
    kept = viewer.save_html(tmp_path / "arm.html").read_bytes()

    def full(*_: object, **__: object) -> int:
        raise OSError("no space left")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="no space"):
        viewer.save_html(tmp_path / "arm.html")
    assert [path.name for path in tmp_path.iterdir()] == ["arm.html"]
    assert (tmp_path / "arm.html").read_bytes() == kept


# --- results ----------------------------------------------------------------------------------------------------


def test_frames_are_the_runs_poses_at_their_times(two_link: ArmModel) -> None:
    result = swung(two_link, duration=1.0)
    header, arrays = scene_of(animate(result, fps=20.0).html())
    frames = header["frames"]
    assert frames["count"] == 21
    assert frames["period"] == pytest.approx(0.05)
    poses = numbers(frames["arm"], arrays).reshape(21, 7, 7)
    ghosts = numbers(frames["ghost"], arrays).reshape(21, 7, 7)
    drawing = Drawing(two_link)
    for k in (0, 7, 20):
        np.testing.assert_allclose(poses[k], drawing.poses(result.q[5 * k]), atol=1e-6)
        np.testing.assert_allclose(ghosts[k], drawing.poses(result.q_r[5 * k]), atol=1e-6)


@pytest.mark.slow
def test_force_on_the_tool_is_found_from_the_logged_torque(panda: ArmModel) -> None:
    force = np.array([5.0, -3.0, 8.0])
    result = swung(panda, force=force)
    header, arrays = scene_of(result.animate().html())
    count = header["frames"]["count"]
    wrenches = numbers(header["frames"]["wrenches"], arrays).reshape(count, 9)
    np.testing.assert_allclose(wrenches[:, 3:6], np.tile(force, (count, 1)), rtol=1e-4)
    assert not wrenches[:, 6:].any()
    _, tool = panda.frame_placement(result.q[0])
    np.testing.assert_allclose(wrenches[0, :3], tool, atol=1e-6)


def test_moment_on_the_tool_is_found_from_the_logged_torque(panda: ArmModel) -> None:
    q = panda.integrate(panda.neutral, np.full(panda.nv, 0.3))
    wrench = np.array([5.0, -3.0, 8.0, 0.5, 2.0, -1.0])
    found = _at_tool(panda, q, panda.external_torque(q, wrench))
    np.testing.assert_allclose(found[0, 3:], wrench, rtol=1e-6)


@pytest.mark.slow
def test_wrenches_that_are_given_act_at_their_frames_and_walls_are_surfaces(
    panda: ArmModel,
) -> None:
    wall = rbi.Wall(point=[1.0, 5.0, 7.0], normal=[2.0, 0.0, 0.0], stiffness=1e3)
    push = FrameWrench([0, 0, 9, 0, 3, 0], frame="panda_link4")
    header, arrays = scene_of(swung(panda).animate(environment=Sum(push, wall)).html())
    wrenches = numbers(header["now"]["wrenches"], arrays).reshape(2, 9)
    np.testing.assert_allclose(wrenches[0, 3:], [0, 0, 9, 0, 3, 0])
    np.testing.assert_allclose(
        wrenches[0, :3], panda.frame_placement(swung(panda).q[0], "panda_link4")[1], atol=1e-6
    )
    (surface,) = header["surfaces"]
    assert surface["normal"] == [1.0, 0.0, 0.0]
    assert surface["point"][0] == pytest.approx(1.0)


def test_free_motion_has_no_arrow(two_link: ArmModel) -> None:
    header, _ = scene_of(swung(two_link).animate().html())
    assert header["now"]["wrenches"]["start"] == header["now"]["wrenches"]["end"]


@pytest.mark.slow
def test_long_run_is_thinned_out_in_time(two_link: ArmModel) -> None:
    result = swung(two_link, duration=60.0)
    header, _ = scene_of(result.animate(fps=100.0).html())
    assert header["frames"]["count"] == MOST_FRAMES + 1
    covered = MOST_FRAMES * header["frames"]["period"]
    assert covered == pytest.approx(60.0)


def test_run_of_a_single_sample_is_a_still_picture(two_link: ArmModel) -> None:
    header, _ = scene_of(swung(two_link, duration=0.0).animate().html())
    assert header["frames"] is None


@pytest.mark.slow
def test_result_from_a_file_finds_its_robot_again(tmp_path: Path) -> None:
    arm = load_robot("panda", joints=["panda_joint2", "panda_joint4"], tool_frame="panda_link5")
    result = swung(arm.with_payload(1.0), force=np.array([0.0, 0.0, 5.0]))
    again = SimulationResult.load(result.save(tmp_path / "run.npz"))
    assert again.plant is None
    assert again.animate().html() == result.animate().html()


def test_result_of_a_text_says_how_to_see_it(tmp_path: Path) -> None:
    arm = load_robot(spinner_urdf())
    result = swung(arm)
    result.animate()
    again = SimulationResult.load(result.save(tmp_path / "run.npz"))
    with pytest.raises(ModelError, match=r"neither a name nor a path; give it with robot="):
        again.animate()
    assert again.animate(robot=spinner_urdf()).arm.joint_names == arm.joint_names


@pytest.mark.parametrize(
    ("recipe", "words"),
    [
        ({"source": "evil.urdf.xacro"}, "would be run as a program"),
        ({"source": "panda_description"}, "would be run as a program"),
        ({"source": "panda", "gravity": [0, 0, 0]}, "does not say how its robot is loaded"),
        ({"lock": []}, "does not say how its robot is loaded"),
        (["panda"], "does not say how its robot is loaded"),
        ({"source": "panda", "lock": 7}, "the robot of the result"),
    ],
)
def test_what_a_file_of_a_stranger_names_is_neither_run_nor_a_crash(
    two_link: ArmModel, recipe: object, words: str
) -> None:
    result = swung(two_link)
    plant = {**result.provenance["plant"], "recipe": recipe}
    foreign = dataclasses.replace(
        result, provenance={**result.provenance, "plant": plant}, plant=None
    )
    with pytest.raises(ModelError, match=f"{words}.*give .*robot="):
        foreign.animate()


def test_robot_with_other_joints_is_refused(two_link: ArmModel) -> None:
    with pytest.raises(ModelError, match=r"joint1, joint2; 'panda' has panda_joint1"):
        swung(two_link).animate(robot="panda")


# --- the server -------------------------------------------------------------------------------------------------


def get(url: str, path: str = "/", **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection(url.split("/")[2], timeout=20.0)
    connection.request("GET", path, headers=headers)
    return connection.getresponse()


def test_view_starts_no_server_and_opens_no_browser(
    two_link: ArmModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unwanted(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr(webbrowser, "get", unwanted)
    monkeypatch.setattr(socket, "socket", unwanted)
    viewer = view(two_link)
    viewer.display([0.1, 0.2])
    viewer.html()
    assert repr(viewer) == "<Viewer of 'two_link'>"
    viewer.close()


def test_browser_opens_when_it_is_asked_for(
    two_link: ArmModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []

    class Fake:
        def open(self, url: str) -> bool:
            opened.append(url)
            return True

    monkeypatch.setattr(webbrowser, "get", Fake)
    with view(two_link, open=True) as viewer:
        assert opened == [viewer.url]


def test_machine_without_windows_is_told_the_address_and_no_terminal_is_taken_over(
    two_link: ArmModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(webbrowser, "get", lambda: webbrowser.GenericBrowser("sleep 1000"))
    viewer = view(two_link)
    with viewer, pytest.warns(UserWarning, match=r"no browser .* http://127\.0\.0\.1:\d+/"):
        viewer.open()


def test_page_is_served_on_the_loopback_address_only(two_link: ArmModel) -> None:
    with view(two_link) as viewer:
        answer = get(viewer.url)
        assert answer.status == 200
        assert scene_of(answer.read().decode())[0]["live"] == 1
        port = int(viewer.url.split(":")[2].strip("/"))
        with pytest.raises(
            OSError, match=r"refused|assign|timed out"
        ):  # a server on all addresses would answer
            socket.create_connection(("127.0.0.2", port), timeout=1.0)


def test_page_is_not_served_under_another_name(two_link: ArmModel) -> None:
    with view(two_link) as viewer:
        port = viewer.url.split(":")[2].strip("/")
        assert get(viewer.url, Host=f"evil.example:{port}").status == 403
        assert get(viewer.url, Host=f"localhost:{port}").status == 200
        assert get(viewer.url, "/etc/passwd").status == 404


def test_port_is_free_again_after_close_and_taken_before(two_link: ArmModel) -> None:
    first = view(two_link)
    port = int(first.url.split(":")[2].strip("/"))
    second = view(two_link, port=port)
    with pytest.raises(ParameterError, match=r"port must be free") as caught:
        _ = second.url
    assert (caught.value.name, caught.value.value) == ("port", port)
    first.close()
    assert second.url == f"http://127.0.0.1:{port}/"
    second.close()
    second.close()


def test_display_tells_the_page_where_the_shapes_are(two_link: ArmModel) -> None:
    with view(two_link) as viewer:
        events = get(viewer.url, "/events?1")
        viewer.display([0.3, 0.5])
        news = events.readline()
        poses = json.loads(news.removeprefix(b"data: "))["arm"]
        expected = Drawing(two_link).poses(np.array([0.3, 0.5]))
        np.testing.assert_allclose(np.reshape(poses, (7, 7)), expected, atol=1e-12)
        events.close()


def test_page_that_missed_news_while_it_was_loading_is_told_at_once(two_link: ArmModel) -> None:
    with view(two_link) as viewer:
        known = scene_of(get(viewer.url).read().decode())[0]["live"]
        viewer.display([0.3, 0.5])
        with get(viewer.url, f"/events?{known}") as events:
            assert events.readline().startswith(b'data: {"arm"')
        known = scene_of(get(viewer.url).read().decode())[0]["live"]
        viewer.display([0.3, 0.6])
        viewer.display([0.3, 0.6], q_r=[0.0, 0.0])
        with get(viewer.url, f"/events?{known}") as events:
            assert json.loads(events.readline().removeprefix(b"data: ")) == {"reload": True}


@pytest.mark.slow
def test_display_does_not_wait_for_a_browser_that_does_not_read(panda: ArmModel) -> None:
    step = np.full(panda.nv, 0.01)
    with view(panda) as viewer:
        host, port = viewer.url.split("/")[2].split(":")
        with socket.create_connection((host, int(port))) as deaf:
            deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
            deaf.sendall(f"GET /events?1 HTTP/1.1\r\nHost: {host}:{port}\r\n\r\n".encode())
            for share in np.linspace(0.0, 1.0, 2000):
                viewer.display(panda.integrate(panda.neutral, share * step))
        viewer.display(panda.neutral)
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", int(port))) != 0


@pytest.mark.parametrize(
    ("arguments", "word"),
    [({"q": [0.0]}, "q"), ({"q_r": [0.0, np.nan]}, "q_r"), ({"environment": [1.0, 2.0]}, "wrench")],
)
def test_bad_input_is_named(two_link: ArmModel, arguments: dict[str, Any], word: str) -> None:
    with pytest.raises(rbi.InputError, match=rf"^{word}\b"):
        view(two_link, **arguments)
