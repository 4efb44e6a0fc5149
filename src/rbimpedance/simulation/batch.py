"""Many closed loops at once: worlds that may differ in everything, over all cores, in bounded memory."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, BoolArray, choice, whole_number
from .._common.deprecation import renamed_arguments
from ..control.cartesian_base import CartesianControllerBase
from ..control.protocol import Controller
from ..exceptions import DimensionError, ParameterError
from ..interaction import EnvironmentLike
from ..robot.arm_model import ArmModel
from ..robot.hardware import Hardware
from ..trajectories import Trajectory
from ..trajectories.cartesian import CartesianTrajectory
from .batch_log import BatchLog
from .batch_run import run_worlds
from .closed_loop import LOGGED, ClosedLoop
from .plants import Plant
from .plants.integrators import Integrator
from .run import closed_loop, on_hardware
from .sampling import tick_times

AnyController: TypeAlias = Controller[Any] | CartesianControllerBase[Any]


@dataclass(frozen=True, eq=False, kw_only=True)
class BatchResult:
    """What N worlds left behind; the first axis of everything but the time is the world.

    Attributes:
        t: Times of the samples, shape (samples,) [s].
        channels: The requested channels, by the names and in the units of `SimulationResult`: shape (N, samples, nv),
            or nq for q and q_r. NaN (False) after a world has diverged.
        metrics: The figures of `SimulationResult.metrics` but violations and growth, each of shape (N, nv), from every
            tick; empty where they were not requested, NaN where a world has diverged.
        q: Configuration at the end, shape (N, nq); undefined for a world that diverged.
        v: Velocity at the end, shape (N, nv) [rad/s or m/s].
        diverged: Whether a joint left every sensible range, shape (N,), bool.
        divergence_time: Time of the last sound sample of such a world, else NaN, shape (N,) [s].
        divergence_joint: Name of the joint that left first, else None, one for each world.
    """

    t: Array
    channels: Mapping[str, Array]
    metrics: Mapping[str, Array]
    q: Array
    v: Array
    diverged: BoolArray
    divergence_time: Array
    divergence_joint: tuple[str | None, ...]

    def __repr__(self) -> str:
        channels = ", ".join(self.channels) or "no channels"
        lost = int(np.count_nonzero(self.diverged))
        return (
            f"BatchResult({len(self)} worlds, {len(self.t)} samples of {channels}; {lost} diverged)"
        )

    def __len__(self) -> int:
        """Number of worlds."""
        return len(self.diverged)

    def __getitem__(self, channel: str) -> Array:
        """A channel by its name."""
        return self.channels[channel]


@renamed_arguments(wrench="environment")
def simulate_batch(  # noqa: PLR0913 (worlds and their settings, each given by name)
    controller: AnyController | Sequence[AnyController],
    plant: ArmModel | Plant[Any] | Sequence[ArmModel | Plant[Any]],
    trajectory: Trajectory | CartesianTrajectory | Sequence[Trajectory | CartesianTrajectory],
    *,
    environment: EnvironmentLike | Sequence[Any] | None = None,
    q0: ArrayLike | None = None,
    v0: ArrayLike | None = None,
    duration: float,
    substeps: int = 4,
    integrator: Integrator = "semi-implicit",
    hardware: Hardware | Sequence[Hardware | None] | None = None,
    channels: Sequence[str] = (),
    every: int = 1,
    metrics: bool = True,
    after: float = 0.0,
    threads: int | None = None,
) -> BatchResult:
    """Run many closed loops, each equal to that of `simulate` to rounding, over all cores.

    Every argument up to `v0`, and `hardware`, is either the same for all worlds, or a list with one for each: plants,
    controllers, trajectories, environments; arrays with one row more for q0, v0 and constant wrenches. A controller, a
    trajectory or an environment that several worlds share is prepared once.

    Memory grows with the worlds times the samples kept, `duration`/(dt·`every`), of the requested channels; the figures
    of merit are sums that are kept up to date, from every tick. A world is one compiled function, without the
    interpreter's lock, whether its controller's `backend` is "compiled" or "pinocchio"; with "numpy" it is run in
    Python, as is what has no compiled form, one world after the other; the logger "rbimpedance" says the latter, once.
    Of a `CartesianController` the tick is compiled and the loop is Python's.

    Four or more worlds that are alike run eight at once, equal to `simulate` to 1e-12 and not to the last bit: the same
    joints in the same order, none continuous, a law by formulas, and not "rk4". Numbers may differ, in the plants, too.

    On `hardware` the worlds of a `HardwareController` with rigid joints are compiled, too, and bit-equal to those of
    `simulate`: about 0.05 ms a tick for seven joints, of which much is for the trajectory, which is sampled for every
    world in Python. An `ImpedanceController` is compiled there on links without friction. All others, and a
    `HardwareController` with springs, are run in Python: one to two milliseconds a tick, one world after the other.

    Args:
        controller: Controllers, all of the same period, for the same number of joints.
        plant: Arms that are simulated.
        trajectory: Desired motions.
        environment: Environments; each as in `simulate`.
        q0: Initial configurations, shape (nq,) or (N, nq); where each trajectory begins by default.
        v0: Initial velocities, shape (nv,) or (N, nv); at rest by default.
        duration: Length of the runs [s].
        substeps: Physics steps per control period.
        integrator: "semi-implicit" or "rk4".
        hardware: What is between a tick and the links, as in `simulate`.
        channels: Names of what is logged: any of `SimulationResult`'s arrays but t, wrench and tau_stop.
        every: Ticks from one sample to the next.
        metrics: Whether the figures of merit are wanted.
        after: Leave out the samples before this time in all but the settling times [s].
        threads: How many to use; as many as there are cores for this process by default.

    Returns:
        Samples and figures. A world that diverges is marked there; the others continue.

    Raises:
        ParameterError: As for `simulate`; worlds of different periods; an unknown channel; `every` or `threads` is no
            positive whole number; fewer than two samples after `after`.
        DimensionError: Lists of different lengths, arms of different size, or an input of wrong shape or kind.
        NonFiniteError: An input holds NaN or infinity.
    """
    for name in channels:
        choice("channels", name, LOGGED)
    threads = _cores() if threads is None else threads
    whole_number("every", every, 1, "ticks from one sample to the next")
    whole_number("threads", threads, 1, "number of threads")
    worlds = _worlds(
        controller=_many(controller),
        plant=_many(plant),
        trajectory=_many(trajectory),
        environment=_many(environment, _is_one_wrench),
        q0=_many(q0, _is_one_vector),
        v0=_many(v0, _is_one_vector),
        hardware=_many(hardware),
    )
    settings: Any = {"duration": duration, "substeps": substeps, "integrator": integrator}
    loops = [_loop(**world, **settings) for world in worlds]
    _check_alike(loops)
    log = run_worlds(loops, tuple(channels), every, after if metrics else None, threads)
    return _result(loops, log, every)


def _loop(
    controller: Any, plant: ArmModel | Plant[Any], hardware: Hardware | None, **more: Any
) -> ClosedLoop:
    """A world, behind drives and encoders where there are any."""
    if hardware is not None:
        controller, plant = on_hardware(controller, plant, hardware)
    return closed_loop(controller, plant, **more)


def _result(loops: list[ClosedLoop], log: BatchLog, every: int) -> BatchResult:
    """What the worlds left behind."""
    dt, marks = loops[0].controller.dt, [log.divergence.get(i) for i in range(len(loops))]
    return BatchResult(
        t=tick_times(range(0, loops[0].ticks + 1, every), dt),
        channels=log.channels,
        metrics=log.metrics,
        q=log.q,
        v=log.v,
        diverged=np.array([mark is not None for mark in marks]),
        divergence_time=np.array([np.nan if mark is None else mark[0] * dt for mark in marks]),
        divergence_joint=tuple(None if mark is None else mark[1] for mark in marks),
    )


def _cores() -> int:
    """Cores that this process may use, as reported by the system."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _many(
    value: Any, is_one: Callable[[Any], bool] = lambda _: False
) -> tuple[Any, list[Any] | None]:
    """The value, and if it is one for each world, the list of them."""
    is_list = isinstance(value, list | tuple | np.ndarray)
    return value, (list(value) if is_list and not is_one(value) else None)


def _is_one_vector(value: Any) -> bool:
    return len(value) == 0 or all(np.ndim(entry) == 0 for entry in value)


def _is_one_wrench(value: Any) -> bool:
    """Whether a list is a wrench: numbers, not environments."""
    return len(value) == 0 or all(isinstance(x, int | float | np.number) for x in value)


def _worlds(**parts: tuple[Any, list[Any] | None]) -> list[dict[str, Any]]:
    """What each world is made of."""
    sizes = {name: len(many) for name, (_, many) in parts.items() if many is not None}
    n = max(sizes.values(), default=1)
    for name, size in sizes.items():
        if size != n or n == 0:
            raise DimensionError(name, f"one for all worlds, or a list of {max(n, 1)}", f"{size}")
    return [
        {name: one if many is None else many[i] for name, (one, many) in parts.items()}
        for i in range(n)
    ]


def _check_alike(loops: list[ClosedLoop]) -> None:
    """Refuse worlds of different periods or sizes."""
    first = loops[0]
    for i, loop in enumerate(loops):
        if loop.controller.dt != first.controller.dt:
            words = f"of the same period in all worlds, {first.controller.dt:g} s"
            raise ParameterError(f"controller[{i}].dt", loop.controller.dt, words)
        size, expected = (loop.plant.nq, loop.plant.nv), (first.plant.nq, first.plant.nv)
        if size != expected:
            words = f"an arm with nq, nv = {expected[0]}, {expected[1]} like the first"
            raise DimensionError(f"plant[{i}]", words, f"nq, nv = {size[0]}, {size[1]}")
