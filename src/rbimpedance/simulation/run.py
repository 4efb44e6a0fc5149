"""The closed loop: a controller at its period, a plant of its own by ABA in between, and the log of both."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, choice, positive_number, vector, whole_number
from .._common.deprecation import renamed_arguments, warn_renamed
from ..control.cartesian_base import CartesianControllerBase
from ..control.controller import ImpedanceController
from ..control.encoders import QuantizedEncoders
from ..control.errors import check_reference
from ..control.protocol import Backend, Controller
from ..control.wrapper import tool_inside
from ..exceptions import ParameterError
from ..interaction import EnvironmentLike, Perfect, Sensor, as_interaction
from ..robot.arm_model import ArmModel
from ..robot.hardware import Hardware
from ..trajectories import Trajectory
from ..trajectories.cartesian import CartesianTrajectory
from .checkpoint import Checkpoint
from .closed_loop import ClosedLoop, OnTick, run
from .compiled_runs import has_parts, law_of, reason_against, run_around_pinocchio, run_compiled
from .driven_runs import run_driven
from .imperfect_runs import run_imperfect
from .joint_stops import JointStops
from .plants import DrivenPlant, Plant
from .plants.integrators import INTEGRATORS, Integrator
from .result import SimulationResult
from .tool_view import start_of, tool_view

P = ParamSpec("P")
T = TypeVar("T")


def _backend_of_the_controller(function: Callable[P, T]) -> Callable[P, T]:
    """Let `simulate` take its former `backend`, which is the controller's now."""

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        given: dict[str, Any] = kwargs
        backend: Any = given.pop("backend", None)
        if backend is not None:
            warn_renamed("backend= of simulate", "backend= of ImpedanceController")
            parts: list[Any] = list(args)
            controller = parts[0] if parts else given["controller"]
            if isinstance(controller, ImpedanceController):
                controller = controller.with_backend(backend)
            if parts:
                args = (controller, *parts[1:])  # type: ignore[assignment]
            else:
                given["controller"] = controller
        return function(*args, **kwargs)

    return call


@renamed_arguments(wrench="environment")
@_backend_of_the_controller
def simulate(  # noqa: PLR0913 (what acts on a run, each given by name)
    controller: Controller[Any] | CartesianControllerBase[Any],
    plant: ArmModel | Plant[Any],
    trajectory: Trajectory | CartesianTrajectory,
    *,
    environment: EnvironmentLike | None = None,
    sensor: Sensor[Any] | None = None,
    q0: ArrayLike | None = None,
    v0: ArrayLike | None = None,
    duration: float,
    substeps: int = 4,
    integrator: Integrator = "semi-implicit",
    joint_stops: bool | JointStops = False,
    hardware: Hardware | None = None,
    on_tick: OnTick | None = None,
    checkpoint: Checkpoint | None = None,
) -> SimulationResult:
    """Run a controller against a plant.

    At t = k·dt the controller sees the plant's state and the torque of the environment, and its torque is then held
    for one period, in which the plant takes `substeps` steps; the environment acts at every one of them.

    The loop is computed as the `backend` of an `ImpedanceController` says, with results equal to rounding: "numpy" by
    Python, the specification; "pinocchio" by compiled code around Pinocchio's algorithms; "compiled" by one compiled
    function (docs/how-a-tick-runs.md). The compiled loops take every `Interaction` of the library, and
    sample trajectory and functions of time ahead, some thousand steps at once. The one compiled function also runs
    baselines of the joints without limits, and both behind `QuantizedEncoders`, `ImperfectController` or a
    `MomentumObserver`, and on a `DrivenPlant` of rigid links without torque loop and rotors' friction; springs, too.
    What has no compiled form, and every other controller, is run in Python; where "compiled" was requested, the logger
    "rbimpedance" says so, once.

    Args:
        controller: Any object with `arm`, `dt`, `init`, `step` and `impedance_error`; or a `CartesianController`, whose
            run is done in Python and has `result.tool`.
        plant: The arm that is simulated; give it what the controller does not know. It is copied: controller and
            plant never share a model. Rigid links by Pinocchio's ABA; or another `Plant`, run in Python.
        trajectory: Desired motion as a function of time; of the tool for a `CartesianController`.
        environment: None, an `Interaction` (`FrameWrench`, `JointTorque`, ...), or a wrench (6,) at the tool
            frame in world axes, constant or as a function of time.
        sensor: Measurement of the environment's torque: delayed, filtered, or estimated without a force sensor.
            Exact by default; the result logs the true torque, and `replay_sensor` gives the measured one. A
            `CartesianController` has an exact wrist sensor by default, which measures what acts at frames on its link
            and beyond; from another sensor's torque it computes the wrench.
        q0: Initial configuration, shape (nq,); where the trajectory begins by default, for a tool by
            `inverse_kinematics`.
        v0: Initial velocity, shape (nv,); at rest by default.
        duration: Length of the run [s], a multiple of the control period.
        substeps: Physics steps per control period, a positive whole number.
        integrator: "semi-implicit" (Euler, first order) or "rk4" (fourth order); other plants have their own.
        joint_stops: Whether the joints have stops at the plant's position limits: stiff springs with dampers, see
            `JointStops`, or stops of one's own. Without them a joint swings through its limit; `result.verdict()` says
            so.
        hardware: What is between a tick and the links: the plant is put behind the drives of the description, and the
            controller behind its encoders. None for nothing.
        on_tick: Called with (ticks done, ticks in all), for a progress bar: at every tick, or every few thousand
            physics steps of a compiled run.
        checkpoint: File in which the run stores its progress, and from which an interrupted run continues.

    Returns:
        The log at every tick, t = 0 and t = duration included.

    Raises:
        DivergenceError: A joint left every sensible range; with time, joint and the result so far.
        ParameterError: A duration that is no multiple of the period, a bad number of substeps, an unknown integrator,
            or a controller made for another number of joints.
        DimensionError: An input of wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
        SnapshotError: The checkpoint is of another run, or damaged.
    """
    if hardware is not None:
        controller, plant = on_hardware(controller, plant, hardware)
    loop = closed_loop(
        controller,
        plant,
        trajectory,
        environment=environment,
        sensor=sensor,
        q0=q0,
        v0=v0,
        duration=duration,
        substeps=substeps,
        integrator=integrator,
        joint_stops=joint_stops,
    )
    run_fast = {
        "numpy": _run_around_law,
        "pinocchio": run_around_pinocchio,
        "compiled": run_compiled,
    }[_backend(loop)]
    result = run_fast(loop, on_tick, checkpoint)
    return run(loop, on_tick, checkpoint) if result is None else result


def on_hardware(
    controller: Controller[Any] | CartesianControllerBase[Any],
    plant: ArmModel | Plant[Any],
    hardware: Hardware,
) -> tuple[Controller[Any] | CartesianControllerBase[Any], DrivenPlant]:
    """Return the controller behind its encoders, and the arm behind its drives.

    Raises:
        ParameterError: A plant that has drives already, or that the hardware does not fit.
    """
    if isinstance(plant, DrivenPlant):
        raise ParameterError("plant", plant, "without drives where hardware is given")
    driven = DrivenPlant.for_(hardware, plant, controller.dt)
    if hardware.encoder_bits is None:
        return controller, driven
    return QuantizedEncoders.for_(hardware, controller), driven


def _run_around_law(
    loop: ClosedLoop, on_tick: OnTick | None, checkpoint: Checkpoint | None
) -> SimulationResult | None:
    """Run a loop whose law is behind sensors or drives by compiled code; None where it has no compiled form."""
    result = None if checkpoint is not None else run_imperfect(loop, on_tick)
    return run_driven(loop, on_tick, checkpoint) if result is None else result


def _backend(loop: ClosedLoop) -> Backend:
    """Who computes a loop: the controller says it; compiled code does what is around it, and baselines, if it can."""
    law = law_of(loop)
    asked: Backend = law.backend if isinstance(law, ImpedanceController) else "compiled"
    if asked == "numpy":
        return "numpy"
    if has_parts(loop) and reason_against(loop) is None:
        return "compiled"
    return asked if law is loop.controller and isinstance(law, ImpedanceController) else "numpy"


def closed_loop(
    controller: Any,
    plant: ArmModel | Plant[Any],
    trajectory: Any,
    *,
    environment: EnvironmentLike | None = None,
    q0: ArrayLike | None = None,
    v0: ArrayLike | None = None,
    sensor: Sensor[Any] | None = None,
    duration: float,
    substeps: int,
    integrator: Integrator,
    joint_stops: bool | JointStops = False,
) -> ClosedLoop:
    """Return the checked parts of a run; arguments and errors are those of `simulate`."""
    ticks = number_of_ticks(duration, controller.dt)
    whole_number("substeps", substeps, 1, "the period is a multiple of the physics step")
    choice("integrator", integrator, INTEGRATORS)
    arm, engine = (plant, None) if isinstance(plant, ArmModel) else (plant.arm, plant)
    acting = as_interaction(environment)
    if (controller.arm.nq, controller.arm.nv) != (arm.nq, arm.nv):
        words = f"an arm with the controller's nq, nv = {controller.arm.nq}, {controller.arm.nv}"
        raise ParameterError("plant", repr(plant), words)
    begin = _start(controller, trajectory) if q0 is None else q0
    q = arm.check_configuration("q0", begin)
    if isinstance(controller, CartesianControllerBase):
        controller, sensor = tool_view(controller, arm, acting, sensor)
    return ClosedLoop(
        controller=controller,
        plant=arm,
        engine=engine,
        trajectory=trajectory,
        environment=acting,
        sensor=Perfect() if sensor is None else sensor,
        q=np.array(q),
        v=np.zeros(arm.nv) if v0 is None else vector("v0", v0, arm.nv).copy(),
        ticks=ticks,
        substeps=substeps,
        integrator=integrator,
        stops=_stops(joint_stops, arm, controller.dt / substeps),
    )


def _start(controller: Any, trajectory: Any) -> Array:
    """Where the trajectory begins."""
    tool = tool_inside(controller)
    if tool is not None:
        return start_of(tool, trajectory)
    return check_reference(controller.arm, trajectory(0.0)).q


def _stops(joint_stops: bool | JointStops, arm: ArmModel, h: float) -> JointStops | None:
    if isinstance(joint_stops, JointStops):
        return joint_stops
    if not isinstance(joint_stops, bool):
        raise ParameterError("joint_stops", joint_stops, "True, False or JointStops")
    return JointStops.at_limits(arm, h) if joint_stops else None


def number_of_ticks(duration: float, dt: float) -> int:
    """Return how many control periods a run lasts.

    Raises:
        ParameterError: The duration is not positive, or no multiple of the period.
    """
    duration = positive_number("duration", duration, "length of the run in seconds")
    ticks = max(round(duration / dt), 1)
    if abs(ticks * dt - duration) > 1e-9 * duration:
        raise ParameterError(
            "duration",
            duration,
            f"a multiple of the control period dt = {dt:g} s, e.g. {ticks * dt:g}",
        )
    return ticks
