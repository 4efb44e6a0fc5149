"""What a study is: robots × disturbances × samples × controllers, each by its name."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .._common.arrays import Array, positive_number, whole_number
from .._common.brief import brief_repr
from .._common.deprecation import renamed_arguments, renamed_attribute
from .._common.suggestions import suggest
from ..control.protocol import Controller
from ..exceptions import ParameterError
from ..interaction import EnvironmentLike, Sensor
from ..law.impedance import Impedance
from ..robot.arm_model import ArmModel
from ..simulation.plants import Plant
from ..simulation.result import SimulationResult
from ..simulation.run import simulate
from ..trajectories import Trajectory
from ..tuning import GainProposal


def unchanged(controller: Controller[Any]) -> Controller[Any]:
    """Return a controller as it is: nothing between it and the arm."""
    return controller


@brief_repr()
@dataclass(frozen=True, eq=False, kw_only=True)
class Task:
    """What a controller is made for, and all that it may know.

    Attributes:
        robot: Name of the robot in the study.
        arm: The arm as it is described, with nothing in its hand.
        impedance: Target impedance.
        dt: Control period [s].
        proposal: Gains proposed for what is not known; None where the study proposes none.
    """

    robot: str
    arm: ArmModel
    impedance: Impedance
    dt: float
    proposal: GainProposal | None = None

    @property
    def model(self) -> ArmModel:
        """What controllers compute with: the proposal's model, which may carry a part of the payload, or the arm."""
        return self.arm if self.proposal is None else self.proposal.arm

    @property
    def known(self) -> GainProposal:
        """The proposal, where a controller cannot be made without.

        Raises:
            ParameterError: The task has none.
        """
        if self.proposal is None:
            raise ParameterError("proposal", None, f"given in the task of '{self.robot}'")
        return self.proposal


@brief_repr()
@dataclass(frozen=True, eq=False, kw_only=True)
class Experiment:
    """Conditions of a run that the controller does not know.

    Attributes:
        plant: The arm that is simulated.
        trajectory: Desired motion.
        environment: What pushes on the plant, as in `simulate`.
        sensor: The controller's measurement of the environment; exact by default.
        q0: Initial configuration, shape (nq,); where the trajectory begins by default.
        wrap: Puts the sensors and actuators around a controller that are part of the disturbance.
        substeps: Physics steps per control period, where the plant needs others than the study has.
        inputs: What was drawn, by name; columns `input_*` of the table.
    """

    plant: ArmModel | Plant[Any]
    trajectory: Trajectory
    environment: EnvironmentLike | None = None
    sensor: Sensor[Any] | None = None
    q0: Array | None = None
    wrap: Callable[[Controller[Any]], Controller[Any]] = unchanged
    substeps: int | None = None
    inputs: Mapping[str, float] = field(default_factory=dict)

    def simulate(
        self, controller: Controller[Any], *, duration: float, substeps: int
    ) -> SimulationResult:
        """Put a controller through it.

        Args:
            controller: The controller.
            duration: Length of the run [s].
            substeps: Physics steps per control period, unless the plant needs others.

        Raises:
            DivergenceError: The arm is lost.
        """
        return simulate(
            self.wrap(controller),
            self.plant,
            self.trajectory,
            environment=self.environment,
            sensor=self.sensor,
            q0=self.q0,
            duration=duration,
            substeps=substeps if self.substeps is None else self.substeps,
        )

    wrench = renamed_attribute("wrench", "environment")


Experiment.__init__ = renamed_arguments(wrench="environment")(Experiment.__init__)  # type: ignore[method-assign]


@brief_repr()
@dataclass(frozen=True, eq=False, kw_only=True)
class Study:
    """Robots × disturbances × samples × controllers.

    A disturbance draws from a generator that depends on seed, robot, disturbance and number of the sample, and on
    nothing else: every controller meets the same experiments, and a part of a study is equal to that part of the whole.
    Makers that are functions of a module are identified by their name and source when a study is continued.

    Attributes:
        name: Of the study, and of its file.
        robots: By name, what makes the task on each; it is called once in each process.
        controllers: By name, what makes each controller; the others are compared with the first.
        disturbances: By name, what draws an experiment.
        samples: Experiments drawn for each robot and disturbance.
        duration: Length of a run [s].
        after: Time from which errors count [s].
        seed: Of everything random.
        substeps: Physics steps per control period.

    Raises:
        ParameterError: Nothing to run, a name that cannot be one of a file, or a number that cannot be.
    """

    name: str
    robots: Mapping[str, Callable[[], Task]]
    controllers: Mapping[str, Callable[[Task], Controller[Any]]]
    disturbances: Mapping[str, Callable[[Task, np.random.Generator], Experiment]]
    samples: int
    duration: float
    after: float
    seed: int
    substeps: int = 4

    def __post_init__(self) -> None:
        if not self.name or not self.name.replace("-", "").replace("_", "").isalnum():
            raise ParameterError("name", self.name, "letters, digits, - and _: it names a file")
        for part in ("robots", "controllers", "disturbances"):
            if not getattr(self, part):
                raise ParameterError(part, getattr(self, part), "at least one, by name")
            object.__setattr__(self, part, dict(getattr(self, part)))
        whole_number("samples", self.samples, 1, "experiments for each robot and disturbance")
        whole_number("substeps", self.substeps, 1, "physics steps per control period")
        whole_number("seed", self.seed)
        positive_number("duration", self.duration, "length of a run in seconds")
        if not 0.0 <= self.after < self.duration:
            raise ParameterError(
                "after", self.after, f"from 0 to below the duration, {self.duration:g}"
            )

    @property
    def chunks(self) -> tuple[tuple[str, str], ...]:
        """Robot and disturbance of every chunk, in the order of the table."""
        return tuple((robot, name) for robot in self.robots for name in self.disturbances)

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.chunks) * self.runs_per_chunk

    @property
    def runs_per_chunk(self) -> int:
        """Number of runs of one robot and one disturbance."""
        return self.samples * len(self.controllers)

    def generator(self, robot: str, disturbance: str, sample: int) -> np.random.Generator:
        """Return the generator that an experiment is drawn from.

        Args:
            robot: Its name.
            disturbance: Its name.
            sample: Number of the sample.
        """
        return np.random.default_rng([self.seed, *_words(robot), *_words(disturbance), sample])

    def part(
        self,
        *,
        robots: tuple[str, ...] = (),
        controllers: tuple[str, ...] = (),
        disturbances: tuple[str, ...] = (),
        samples: int | None = None,
    ) -> Study:
        """Return a part of the study, whose rows are those of the whole.

        Args:
            robots: Names, in any order; all by default.
            controllers: The same; the first of the study stays what the others are compared with, if it is there.
            disturbances: The same.
            samples: How many of the samples, the first ones; the study's own number by default.

        Raises:
            ParameterError: An unknown name, or a number of samples that cannot be.
        """
        return replace(
            self,
            robots=dict(_chosen("robots", self.robots, robots)),
            controllers=dict(_chosen("controllers", self.controllers, controllers)),
            disturbances=dict(_chosen("disturbances", self.disturbances, disturbances)),
            samples=self.samples if samples is None else samples,
        )


def _words(name: str) -> tuple[int, ...]:
    """128 bits of a name as four numbers, the same in every process."""
    digest = hashlib.sha256(name.encode()).digest()
    return tuple(int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4))


def _chosen(
    part: str, known: Mapping[str, Any], wanted: tuple[str, ...]
) -> Iterator[tuple[str, Any]]:
    for name in wanted:
        if name not in known:
            raise ParameterError(part, name, f"among the study's{suggest(name, known)}")
    return ((name, made) for name, made in known.items() if not wanted or name in wanted)
