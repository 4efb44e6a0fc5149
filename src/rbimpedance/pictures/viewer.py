"""See an arm and its runs: in a browser, in a notebook, and as a file that can be sent to someone.

`view` shows an arm, `animate` a result (`result.animate()` is the same). Both return a `Viewer` at once and start
nothing: a server on this machine's loopback address runs from the first look at `Viewer.url` until `Viewer.close`.
"""

from __future__ import annotations

import errno
import html
import os
import warnings
import webbrowser
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, positive_number
from .._common.deprecation import renamed_arguments
from .._common.files import whole_file
from ..exceptions import ModelError, RBImpedanceError
from ..interaction import EnvironmentLike, FrameInteraction, Interaction, as_interaction
from ..robot.arm_model import ArmModel
from ..robot.load import load_robot
from ..robot.loading.recipe import RECIPE
from ..robot.loading.robot_sources import runs_as_program
from ..simulation.result import SimulationResult
from .page.drawing import Drawing
from .page.page import page
from .page.scene import Frame, Surface, scene
from .page.server import Server
from .tool import compliance_of, poses_of

MOST_FRAMES = 1200
"""Frames of an animation at most: longer runs show fewer of them a second."""

UNEXPLAINED = 0.02
"""Share of a logged torque that a force at the tool may leave unexplained before a moment is drawn as well."""


class Viewer:
    """A picture of an arm, or the animation of a result.

    In a notebook it embeds itself, as a page that needs no server. `url` starts one; from then on `display` moves the
    arm in every browser that shows the page. A `with` statement closes it in the end.

    Attributes:
        arm: The arm.
        notes: What could not be shown, and its substitute.
    """

    def __init__(
        self,
        arm: ArmModel,
        frames: list[Frame],
        *,
        title: str,
        period: float = 0.0,
        surfaces: tuple[Surface, ...] = (),
        compliance: Array | None = None,
        port: int = 0,
    ) -> None:
        self.arm = arm
        self._drawing = Drawing(arm)
        self.notes = self._drawing.notes
        self._frames = frames
        self._settings: dict[str, Any] = {"title": title, "period": period, "surfaces": surfaces}
        self._settings |= {"compliance": compliance}
        self._port = port
        self._server: Server | None = None

    def __repr__(self) -> str:
        where = f" at {self._server.url}" if self._server is not None else ""
        return f"<Viewer of '{self.arm.name}'{where}>"

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    # --- in a browser -------------------------------------------------------------------------------------------

    @property
    def url(self) -> str:
        """Address of the page on this machine; the first look starts its server.

        Raises:
            ParameterError: The requested port is not free.
        """
        if self._server is None:
            self._server = Server(lambda known: self.html(live=known), self._port)
        return self._server.url

    def open(self) -> Viewer:
        """Show the page in the system's browser, and return this viewer; warns where there is no browser."""
        if not _open_in_browser(self.url):
            warnings.warn(f"no browser with windows here; {self.url} shows the page", stacklevel=2)
        return self

    @renamed_arguments(wrench="environment")
    def display(
        self,
        q: ArrayLike,
        *,
        q_r: ArrayLike | None = None,
        environment: EnvironmentLike | None = None,
    ) -> None:
        """Show another configuration; it does not wait for the browsers.

        Args:
            q: Configuration, shape (nq,).
            q_r: Configuration of the reference, shape (nq,), drawn as a ghost.
            environment: Any `Interaction` that acts at frames, or a wrench on the tool, shape (6,), drawn as arrows.

        Raises:
            DimensionError: Wrong shape or kind.
            NonFiniteError: An input holds NaN or infinity.
        """
        frame = _still(self.arm, q, q_r, environment)
        before, self._frames = self._frames, [frame]
        self._settings |= {"surfaces": _surfaces(self._settings["surfaces"], environment)}
        self._settings |= {"compliance": None}
        if self._server is None:
            return
        if len(before) > 1 or _kind(before[0]) != _kind(frame):
            self._server.tell({"reload": True})
            return
        poses = {"arm": self._drawing.poses(frame.q).ravel().tolist()}
        if frame.q_r is not None:
            poses["ghost"] = self._drawing.poses(frame.q_r).ravel().tolist()
        wrenches = [] if frame.wrenches is None else frame.wrenches.ravel().tolist()
        self._server.tell({**poses, "wrenches": wrenches, "surfaces": list(frame.travel)})

    def close(self) -> None:
        """Stop the server and free its port; the viewer can still write files."""
        if self._server is not None:
            self._server.close()
            self._server = None

    # --- as a file ----------------------------------------------------------------------------------------------

    def html(self, *, live: int = 0) -> str:
        """Return the page as one text that loads nothing from anywhere.

        Args:
            live: Number of the latest news that this page knows of, for a page that listens to the server that it came
                from; 0 for one that does not.
        """
        return page(scene(self._drawing, self._frames, live=live, **self._settings))

    def save_html(self, path: str | os.PathLike[str]) -> Path:
        """Write the page as one file that works offline; it appears whole or not at all.

        Args:
            path: Where to.

        Returns:
            The path that was written.

        Raises:
            OSError: It cannot be written there.
        """
        target = Path(path)
        if not target.parent.is_dir():
            raise FileNotFoundError(errno.ENOENT, "no such folder", str(target.parent))
        with whole_file(target) as file:
            file.write(self.html().encode())
        return target

    def _repr_html_(self) -> str:
        """The page in a frame, as notebooks embed it."""
        return (
            f'<iframe srcdoc="{html.escape(self.html())}" title="{html.escape(self._settings["title"])}" '
            'style="width: 100%; aspect-ratio: 16 / 10; border: 0"></iframe>'
        )


@renamed_arguments(wrench="environment")
def view(
    robot: object,
    q: ArrayLike | None = None,
    *,
    q_r: ArrayLike | None = None,
    environment: EnvironmentLike | None = None,
    open: bool = False,
    port: int = 0,
) -> Viewer:
    """Show an arm.

    Args:
        robot: The arm, or anything that `load_robot` takes.
        q: Configuration, shape (nq,); `arm.neutral` by default.
        q_r: Configuration of a reference, shape (nq,), drawn as a ghost.
        environment: Any `Interaction` that acts at frames, or a wrench on the tool, shape (6,), drawn as arrows; walls
            are drawn as surfaces.
        open: Open the system's browser.
        port: Port on 127.0.0.1 for the page; 0 for any that is free.

    Returns:
        The viewer: embeds itself in a notebook; `url`, `save_html` and `display` elsewhere.

    Raises:
        ModelError: The robot cannot be loaded.
        DimensionError: A configuration or a wrench of wrong shape.
        NonFiniteError: One that holds NaN or infinity.
        ParameterError: With `open`: the port is not free.
    """
    arm = robot if isinstance(robot, ArmModel) else load_robot(robot)
    frame = _still(arm, arm.neutral if q is None else q, q_r, environment)
    viewer = Viewer(arm, [frame], title=arm.name, surfaces=_surfaces((), environment), port=port)
    return viewer.open() if open else viewer


@renamed_arguments(wrench="environment")
def animate(
    result: SimulationResult,
    *,
    robot: object = None,
    environment: EnvironmentLike | None = None,
    fps: float = 30.0,
    open: bool = False,
    port: int = 0,
) -> Viewer:
    """Show a result: the arm, its reference as a ghost, force and moment on it, the path of its tool.

    Of a controller at the tool also its frame, the reference's, and an ellipsoid that is long where the target is soft.

    Args:
        result: The result.
        robot: The arm, or anything that `load_robot` takes. Without it, the simulated arm; a result from a file says
            which robot that was, where it had a name or a path.
        environment: What `simulate` was given: its wrenches are drawn where they act, its walls as surfaces. Without
            it, the logged wrench at the tool, or where there is none the force or wrench that gives the logged tau_ext.
        fps: Frames per second of the run.
        open: Open the system's browser.
        port: Port on 127.0.0.1 for the page; 0 for any that is free.

    Returns:
        The viewer; see `view`.

    Raises:
        ModelError: The result does not say which robot it was, or the robot given has other joints.
        ParameterError: `fps` is not positive; with `open`: the port is not free.
    """
    arm = _arm_of(result, robot)
    span = float(result.t[-1] - result.t[0])
    rate = positive_number("fps", fps, "frames per second")
    count = min(max(round(span * rate), 1), MOST_FRAMES, len(result.t) - 1) + 1
    times = np.linspace(result.t[0], result.t[-1], count)
    samples = np.searchsorted(result.t, times - 1e-9).clip(max=len(result.t) - 1)
    pushes = None if environment is None else as_interaction(environment)
    acting = result.tau_ext.any() if pushes is None else True
    compliance = compliance_of(result)
    frames = [
        replace(
            _moment(arm, result, int(k), pushes, has_force=bool(acting)),
            at_tool=poses_of(result, int(k), compliance),
        )
        for k in samples
    ]
    viewer = Viewer(
        arm,
        frames,
        title=arm.name,
        period=span / max(count - 1, 1),
        surfaces=_surfaces((), pushes),
        compliance=None if compliance is None else compliance.sizes,
        port=port,
    )
    return viewer.open() if open else viewer


def _open_in_browser(url: str) -> bool:
    """Open a page where a browser has windows; one that runs in the terminal would take that over and not return."""
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return False
    return type(browser) is not webbrowser.GenericBrowser and browser.open(url)


# --- what a frame shows -----------------------------------------------------------------------------------------


def _still(
    arm: ArmModel, q: ArrayLike, q_r: ArrayLike | None, given: EnvironmentLike | None
) -> Frame:
    q = arm.check_configuration("q", q)
    environment = None if given is None else as_interaction(given)
    return Frame(
        q=q,
        q_r=None if q_r is None else arm.check_configuration("q_r", q_r),
        wrenches=None
        if environment is None
        else _wrenches(arm, environment, 0.0, q, np.zeros(arm.nv)),
        travel=_travel(environment, 0.0),
    )


def _moment(
    arm: ArmModel,
    result: SimulationResult,
    k: int,
    environment: Interaction | None,
    *,
    has_force: bool,
) -> Frame:
    """The picture at sample k of a result."""
    q, t = result.q[k], float(result.t[k])
    if environment is not None:
        wrenches = _wrenches(arm, environment, t, q, result.v[k])
    elif not has_force:
        wrenches = np.zeros((0, 9))
    elif np.isfinite(result.wrench[k]).all() and result.wrench[k].any():
        wrenches = np.array([[*arm.frame_placement(q)[1], *result.wrench[k]]])
    else:
        wrenches = _at_tool(arm, q, result.tau_ext[k])
    tool = arm.frame_placement(q)[1] if result.tool is None else result.tool.position[k]
    return Frame(q, result.q_r[k], wrenches, _travel(environment, t), tool)


def _wrenches(arm: ArmModel, environment: Interaction, t: float, q: Array, v: Array) -> Array:
    """Where the environment acts and with which force and moment, shape (n, 9)."""
    if not isinstance(environment, FrameInteraction):
        return np.zeros((0, 9))
    acting = environment.wrenches(arm, t, q, v)
    rows = [[*arm.frame_placement(q, frame)[1], *wrench] for frame, wrench in acting]
    return np.array(rows).reshape(-1, 9)


def _at_tool(arm: ArmModel, q: Array, tau_ext: Array) -> Array:
    """The smallest force at the tool that gives tau_ext, or wrench where no force does, shape (1, 9)."""
    J = arm.jacobian(q)
    force, *_ = np.linalg.lstsq(J[:3].T, tau_ext, rcond=1e-3)
    wrench = np.append(force, np.zeros(3))
    if np.linalg.norm(J.T @ wrench - tau_ext) > UNEXPLAINED * np.linalg.norm(tau_ext):
        wrench, *_ = np.linalg.lstsq(J.T, tau_ext, rcond=1e-3)
    return np.array([[*arm.frame_placement(q)[1], *wrench]])


def _walls(environment: object) -> list[Any]:
    """The parts of an environment that have a flat surface."""
    parts = getattr(environment, "parts", (environment,))
    return [part for part in parts if hasattr(part, "point") and hasattr(part, "normal")]


def _surfaces(known: tuple[Surface, ...], environment: object) -> tuple[Surface, ...]:
    return tuple(Surface(wall.point, wall.normal) for wall in _walls(environment)) or known


def _travel(environment: object, t: float) -> tuple[float, ...]:
    moved = [getattr(wall, "displacement", None) for wall in _walls(environment)]
    return tuple(0.0 if move is None else float(move(t)) for move in moved)


def _kind(frame: Frame) -> tuple[bool, bool, int, int]:
    """Changes for which a page must be rebuilt."""
    return (
        frame.q_r is not None,
        frame.at_tool is not None,
        0 if frame.wrenches is None else len(frame.wrenches),
        len(frame.travel),
    )


def _arm_of(result: SimulationResult, robot: object) -> ArmModel:
    """The arm of a result: the one given, the one simulated, or the one that its file names."""
    made_by = result.provenance["plant"]
    if robot is not None:
        arm = robot if isinstance(robot, ArmModel) else load_robot(robot)
    elif result.plant is not None:
        arm = result.plant
    else:
        arm = _named_by_file(made_by)
    if arm.joint_names != result.joint_names or arm.nq != result.q.shape[1]:
        raise ModelError(
            f"the result is of joints {', '.join(result.joint_names)}; '{arm.name}' has {', '.join(arm.joint_names)}"
        )
    return arm


def _named_by_file(made_by: Mapping[str, Any]) -> ArmModel:
    """The arm that a result from a file names; the file may be a stranger's, so nothing that it names is run."""
    recipe = made_by.get("recipe")
    if not recipe:
        raise ModelError(
            f"the result does not hold its robot, '{made_by['name']}', which had neither a name nor a path; "
            "give it with robot="
        )
    if not isinstance(recipe, Mapping) or not {"source"} <= recipe.keys() <= RECIPE:
        raise ModelError("the result does not say how its robot is loaded; give it with robot=")
    source, how = str(recipe["source"]), {k: v for k, v in recipe.items() if k != "source"}
    if runs_as_program(source):
        raise ModelError(
            f"the result names '{source}', which would be run as a program; give the robot with robot="
        )
    try:
        return load_robot(source, **how)
    except (RBImpedanceError, TypeError, ValueError) as error:
        raise ModelError(f"the robot of the result: {error}; give it with robot=") from error
