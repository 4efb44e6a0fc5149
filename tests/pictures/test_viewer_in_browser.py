"""What a person sees: the live page and the saved file in a headless Chromium, picture by picture."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rbimpedance import ArmModel, Viewer, load_robot, view

from ..browser import Browser, find_browser
from ..runs import swung

CORPUS = Path(__file__).parents[3] / "shared" / "urdf_corpus"
MOVING = ("arm", "ghost", "force", "moment", "trace")
PARTS = (*MOVING, "surface")
FORCE = np.array([12.0, 0.0, 25.0])
WRENCH = [*FORCE, 0.0, 3.0, 0.0]

pytestmark = pytest.mark.skipif(
    find_browser() is None,
    reason="no Chromium on this machine (Debian: apt-get install chromium)",
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with Browser(str(find_browser())) as browser:
        yield browser


@pytest.fixture(
    scope="module",
    params=[
        "two_link",
        "panda",
        "kinova",
        pytest.param(
            str(CORPUS / "kuka_kr5_arc.urdf"),
            marks=pytest.mark.skipif(not CORPUS.is_dir(), reason=f"there is no folder {CORPUS}"),
        ),
    ],
    ids=["two_link", "panda", "kinova", "meshless"],
)
def arm(request: pytest.FixtureRequest) -> ArmModel:
    return load_robot(request.param)


def share(one: NDArray[np.int16], other: NDArray[np.int16]) -> float:
    """Share of the pixels in which two pictures differ visibly."""
    return float((np.abs(one - other).max(axis=2) > 8).mean())


def shown(browser: Browser, *parts: str) -> NDArray[np.int16]:
    """The picture with the named parts only."""
    wanted = json.dumps({part: part in parts for part in PARTS})
    browser.run(f"Object.entries({wanted}).forEach((one) => player.toggle(...one))")
    return browser.picture()


def check_scene(browser: Browser) -> None:
    """The arm, its ghost and the arrow are there, large enough, inside the page, and nothing went wrong."""
    empty = shown(browser)
    whole = shown(browser, *PARTS)
    assert share(whole, empty) > 0.1
    assert share(shown(browser, "arm"), empty) > 0.05
    assert share(shown(browser, "ghost"), empty) > 0.01
    assert share(shown(browser, "force"), empty) > 0.001
    assert browser.errors == []


def check_framing(browser: Browser, *times: float) -> None:
    """Everything that moves fills a tenth of the page, and none of it is cut off."""
    empty = shown(browser)
    shown(browser, *MOVING)
    for time in times:
        browser.run(f"player.seek({time})")
        everything = browser.picture()
        assert share(everything, empty) > 0.1
        differs = np.abs(everything - empty).max(axis=2) > 40  # without the shadows
        assert not differs[[0, -1]].any()
        assert not differs[:, [0, -1]].any()


@pytest.mark.slow
def test_live_page_shows_arm_ghost_and_force_and_follows_display(
    browser: Browser, arm: ArmModel
) -> None:
    q_r = arm.integrate(arm.neutral, np.full(arm.nv, 0.4))
    with view(arm, q_r=q_r, environment=WRENCH) as viewer:
        browser.show(viewer.url)
        check_scene(browser)
        assert share(shown(browser, "moment"), shown(browser)) > 0.002
        assert {url.split("/")[2] for url in browser.requests if url.startswith("http")} == {
            viewer.url.split("/")[2]
        }
        before = shown(browser, "arm")
        moved = arm.integrate(arm.neutral, np.full(arm.nv, -0.3))
        browser.run(
            "window.last = player.show; player.show = (x) => { player.news = 1; return last.call(player, x) }"
        )
        viewer.display(moved, q_r=q_r, environment=WRENCH)
        browser.wait_for("player.news")
        assert share(shown(browser, "arm"), before) > 0.01
        assert browser.errors == []


@pytest.mark.slow
def test_saved_file_shows_the_run_offline_and_scrubs(
    browser: Browser, arm: ArmModel, tmp_path: Path
) -> None:
    path = swung(arm, force=FORCE).save_html(tmp_path / "run.html")
    browser.show(path.as_uri())
    browser.run("player.pause()")
    browser.run("player.seek(0)")
    check_scene(browser)
    at_start = shown(browser, "arm")
    check_framing(browser, 0.25, 0.75)
    browser.run(
        "(() => { const bar = document.getElementById('time'); bar.value = player.duration / 4;"
        "bar.dispatchEvent(new Event('input')) })()"
    )
    assert share(shown(browser, "arm"), at_start) > 0.01
    assert browser.run("player.time") == pytest.approx(0.25, abs=0.01)
    assert [url for url in browser.requests if not url.startswith("data:")] == [path.as_uri()]
    assert browser.errors == []


@pytest.fixture
def run_page(browser: Browser, tmp_path: Path) -> Browser:
    path = swung(load_robot("two_link"), force=FORCE).save_html(tmp_path / "run.html")
    browser.show(path.as_uri())
    return browser


@pytest.mark.slow
def test_run_plays_by_itself_and_the_button_pauses_it(run_page: Browser) -> None:
    run_page.wait_for("player.time > 0.05")
    run_page.run("document.getElementById('play').click()")
    stopped = run_page.run("player.time")
    run_page.picture()
    assert run_page.run("player.time") == stopped
    run_page.run("document.getElementById('play').click()")
    run_page.wait_for(f"player.time !== {stopped}")


def seconds_per_second(page: Browser, start: str, until: float) -> Any:
    """Seconds of the run that pass in one of the clock, after a start by some code."""
    return page.run(
        f"(async () => {{ player.seek(0); const start = performance.now(); {start}"
        f"while (player.time < {until}) await new Promise(done => setTimeout(done, 20));"
        "player.pause();"
        "return player.time / (performance.now() - start) * 1000 })()"
    )


@pytest.mark.slow
def test_speed_slows_the_run_down(run_page: Browser) -> None:
    run_page.run("player.pause()")
    run_page.run(
        "(() => { const speed = document.getElementById('speed'); speed.value = '0.1';"
        "speed.dispatchEvent(new Event('change')) })()"
    )
    covered = seconds_per_second(run_page, "player.play();", until=0.02)
    assert 0.0 < covered <= 0.1


@pytest.mark.slow
def test_playing_again_before_the_next_frame_does_not_double_the_speed(run_page: Browser) -> None:
    run_page.run("player.pause()")
    covered = seconds_per_second(
        run_page, "player.play(); player.pause();" * 2 + "player.play();", until=0.6
    )
    assert 0.0 < covered <= 1.0


@pytest.mark.slow
def test_arrow_of_a_force_that_grows_while_running_stays_in_proportion(browser: Browser) -> None:
    with view("two_link", environment=np.zeros(6)) as viewer:
        browser.show(viewer.url)
        for newtons in (1.0, 50.0):
            viewer.display([0.0, 0.0], environment=[0, 0, newtons, 0, 0, 0])
            browser.wait_for(f"player.largest.force === {newtons}")
            assert browser.run("player.arrows[0].visible")
            height = browser.run("player.arrows[0].children[1].position.y")
            assert 0.0 < height < browser.run("player.scene.arrows.force.size")


@pytest.mark.slow
def test_page_survives_a_closed_tab_and_a_new_kind_of_scene(browser: Browser) -> None:
    arm = load_robot("two_link")
    with view(arm) as viewer:
        browser.show(viewer.url)
        browser._call("Page.navigate", url="about:blank")
        for angle in np.linspace(0.0, 1.0, 20):
            viewer.display([angle, angle])
        browser.show(viewer.url)
        before = browser.picture()
        viewer.display(
            [1.0, 1.0], q_r=[0.5, 0.5]
        )  # a ghost where there was none: the page loads anew
        browser.wait_for("window.player && player.ghosts.length > 0")
        assert share(browser.picture(), before) > 0.005
        assert browser.errors == []


@pytest.mark.slow
def test_notebook_frame_shows_the_arm(browser: Browser, tmp_path: Path) -> None:
    viewer: Viewer = view("two_link", environment=[*FORCE, 0, 0, 0])
    page = tmp_path / "notebook.html"
    page.write_text(f"<!DOCTYPE html><meta charset=utf-8>{viewer._repr_html_()}", encoding="utf-8")
    browser.errors.clear()
    browser._call("Page.navigate", url=page.as_uri())
    browser.wait_for("document.querySelector('iframe')?.contentWindow.player !== undefined")
    pixels = browser.picture().reshape(-1, 3)
    ocean_blue = (pixels[:, 2] - pixels[:, 0] > 60) & (pixels[:, 2] > pixels[:, 1])
    assert ocean_blue.mean() > 0.005
    assert browser.errors == []
