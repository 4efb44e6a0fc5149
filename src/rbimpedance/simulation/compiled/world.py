"""One closed loop in compiled form: a controller, a plant, what pushes on it, and where it is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from ..._common.arrays import Array
from ..._numba.layouts.tables import hold
from ...control.baseline_law import FormulaBaseline
from ...control.compiled import baseline_tick
from ...control.compiled.block import COLUMNS
from ...control.compiled.law import DT, TickInputs
from ...control.compiled.pack import can_pack, pack_law, scratch
from ...interaction import Interaction
from ...law.impedance import ImpedanceFilter
from ...robot.arm_model import ArmModel
from ...robot.compiled.tables import ArmTables, workspace
from ...trajectories import Reference
from ..joint_stops import JointStops
from .between import Between
from .drives import Drives
from .environment import Drive, EnvironmentTables, can_sample
from .log import LogArrays, MetricSums, no_figures
from .loop import (
    DIVERGED,
    FINISHED,
    RUNGE_KUTTA,
    SEMI_IMPLICIT,
    STIFF,
    UNSOUND,
    Clock,
    Controlled,
    LoopWorkspace,
    Memory,
    ReferenceSamples,
    rollout,
)
from .measuring import Measuring
from .plant import PlantMotion, PlantTables, Stages

STEPS_AT_ONCE = 4096
"""Physics steps in a block: between two of them the interpreter gets its turn, a few milliseconds apart."""

Ending = Literal["finished", "unsound", "diverged"]
_ENDINGS: dict[int, Ending] = {FINISHED: "finished", UNSOUND: "unsound", DIVERGED: "diverged"}


_NO_PART: tuple[int, Any] = 0, np.zeros(1)


class Outcome(NamedTuple):
    """How a block of ticks ended.

    Attributes:
        ending: At its end; at inputs that no controller takes; or at a joint that left every range.
        tick: The tick at which it ended early.
        joint: The joint that left.
    """

    ending: Ending
    tick: int
    joint: int


class Settings(NamedTuple):
    """How the plant is stepped.

    Attributes:
        ticks: Number of the last tick.
        substeps: Physics steps in a period.
        integrator: "semi-implicit", "stiff" for the same with friction taken at the step's end, or "rk4".
        speed_bound: Speed at which a joint has diverged [rad/s or m/s].
    """

    ticks: int
    substeps: int
    integrator: Literal["semi-implicit", "stiff", "rk4"]
    speed_bound: float

    def blocks(self) -> list[range]:
        """Return the ticks in blocks of about `STEPS_AT_ONCE` physics steps."""
        size, end = max(STEPS_AT_ONCE // self.substeps, 1), self.ticks + 1
        return [range(start, min(start + size, end)) for start in range(0, end, size)]


class Block(NamedTuple):
    """A block of ticks, and what it needs.

    Attributes:
        ticks: The ticks.
        reference: Desired motion at each: checked arrays of one row a tick, or of one row for all.
        drive: What of the environment depends on time, at `World.times`.
        desk: Work space; two threads must not share one.
        journal: Where the channels go.
        figures: Where the figures of merit go; None where they are not wanted.
    """

    ticks: range
    reference: Reference
    drive: Drive
    desk: LoopWorkspace
    journal: LogArrays
    figures: MetricSums | None = None


_INTEGRATORS = {"semi-implicit": SEMI_IMPLICIT, "stiff": STIFF, "rk4": RUNGE_KUTTA}


class World:
    """A closed loop under way; `desk` gives the work space that `run` needs.

    Args:
        controlled: The controller.
        plant: The simulated arm.
        tables: Its tables.
        interaction: What pushes on it; one that `reason_against_parts` has nothing against.
        q: Configuration, shape (nq,); taken over.
        v: Velocity, shape (nv,); taken over.
        settings: How the plant is stepped.
        stops: Stops of its joints; None for none.
        restoring: For a baseline, its `restoring_table`.
        measuring: Its instruments; None for exact ones.
        engine: Its drives, see `Drives`; None for none.

    Raises:
        ParameterError: The drives cannot be integrated with such steps.
        ModelError: The environment acts at a frame that the arm does not have.
    """

    def __init__(
        self,
        controlled: Controlled,
        plant: ArmModel,
        tables: ArmTables,
        interaction: Interaction,
        q: Array,
        v: Array,
        settings: Settings,
        stops: JointStops | None = None,
        restoring: Array | None = None,
        measuring: Measuring | None = None,
        engine: Any = None,
    ) -> None:
        nv = plant.nv
        self.controlled = controlled
        own = tables._replace(joints=tables.joints.copy())
        self.plant = PlantTables(own, np.array(plant.armature), _stop_table(stops))
        self.surroundings = EnvironmentTables(interaction, plant)
        motion = PlantMotion(q, v, *np.zeros((3, nv)))
        self.memory = Memory(motion, np.zeros((nv, COLUMNS)), np.zeros((nv, COLUMNS)))
        self.settings, self.dt = settings, float(controlled.law.gains[0, DT])
        self.restoring, self.measuring = restoring, measuring
        h = self.dt / settings.substeps
        self.drives = None if engine is None else Drives(engine, tables, motion, h)

    def times(self, block: range) -> Array:
        """Return the times in a block at which the plant asks what pushes on it."""
        h = self.dt / self.settings.substeps
        ticks = np.arange(block.start, block.stop)[:, None] * self.dt
        times = (ticks + np.arange(self.settings.substeps) * h).ravel()
        if self.settings.integrator == "rk4":
            times = (times[:, None] + np.array([0.0, h / 2.0, h])).ravel()
        if block.stop == self.settings.ticks + 1:  # no period after the last tick
            times = times[: 1 + (len(block) - 1) * len(times) // len(block)]
        return times

    @property
    def has_parts(self) -> bool:
        """Whether a part of the loop is its own: the tick of a baseline, instruments, drives."""
        return not (self.restoring is None and self.measuring is None and self.drives is None)

    def parts(self, block: range, desk: LoopWorkspace) -> list[tuple[int, Any]]:
        """Return address and words of the parts, in the order of `Clock.ticks`; the words have to be kept."""
        measuring, drives = self.measuring, self.drives
        ahead = np.zeros((2, len(desk.v_d))) if drives is None else drives.ahead
        return [
            self._own_tick(desk),
            _NO_PART if measuring is None else measuring.part(block, self.memory, ahead, desk),
            _NO_PART if drives is None else drives.part,
        ]

    def _own_tick(self, desk: LoopWorkspace) -> tuple[int, Any]:
        """Return the part of a baseline's tick; none for the impedance law."""
        if self.restoring is None:
            return _NO_PART
        arm, own, _ = self.controlled
        motion = self.memory.motion
        given = TickInputs(
            desk.seen_q, desk.seen_v, desk.q_d, desk.v_d, desk.a_d, desk.seen_tau_ext
        )
        words = hold(
            baseline_tick.BaselineWords(
                *(arm, own, self.restoring, desk.control, baseline_tick.scratch_of(len(motion.v))),
                *(self.memory.even, self.memory.odd, given, motion.tau),
            )
        )
        return baseline_tick.baseline_part(), words

    def clock(self, block: range, parts: Sequence[tuple[int, Any]] = ()) -> Clock:
        """Return what a kernel needs to know of the ticks of a block."""
        addresses = [word for at, words in parts for word in (at, words.ctypes.data)]
        settings = self.settings
        integrator = _INTEGRATORS[settings.integrator]
        return Clock(
            np.array(
                [
                    *(block.start, block.stop, settings.ticks, settings.substeps, integrator),
                    *(addresses or 6 * [0]),
                ]
            ),
            np.array([self.dt / settings.substeps, settings.speed_bound]),
            np.zeros(2, dtype=np.int64),
        )

    def between(self, block: Block) -> Between:
        """Return what the kernels between Pinocchio's algorithms need for a block."""
        environment, motion = self.surroundings.driven(block.drive), self.memory.motion
        return Between(
            self.controlled, self.plant, environment, ReferenceSamples(*block.reference), motion, block.desk,
            self.clock(block.ticks), block.journal, no_figures(), self.memory.even, np.zeros(len(motion.v)),
        )  # fmt: skip

    def run(self, block: Block) -> Outcome:
        """Do a block of ticks, without the interpreter's lock."""
        parts = self.parts(block.ticks, block.desk) if self.has_parts else []
        clock = self.clock(block.ticks, parts)
        arguments = (
            self.controlled, self.plant, self.surroundings.driven(block.drive), ReferenceSamples(*block.reference),
            self.memory, block.desk, clock, block.journal, block.figures or no_figures(),
        )  # fmt: skip
        status = rollout(*arguments)
        tick, joint = clock.outcome.tolist()
        return Outcome(_ENDINGS[status], tick, joint)


def _stop_table(stops: JointStops | None) -> Array:
    if stops is None:
        return np.zeros((0, 4))
    return np.column_stack([stops.lower, stops.upper, stops.stiffness, stops.damping])


def controlled(controller: Any, tables: ArmTables) -> Controlled:
    """Return an `ImpedanceController` or a baseline as tables.

    Args:
        controller: One that `reason_against_parts` has nothing against.
        tables: Those of its arm.
    """
    if isinstance(controller, FormulaBaseline):
        own = baseline_tick.pack_baseline(controller)
        return Controlled(tables, own, _target(controller._filter))  # type: ignore[arg-type]
    return Controlled(tables, pack_law(controller._law), _target(controller._filter))


def _target(impedance_filter: ImpedanceFilter) -> Array:
    """M_d, D_d and K_d side by side, diagonals only where that is all."""
    matrices = impedance_filter.matrices
    if all(np.array_equal(A, np.diag(np.diag(A))) for A in matrices):
        return np.column_stack([np.diag(A) for A in matrices])
    return np.hstack(matrices)


def desk(nq: int, nv: int) -> LoopWorkspace:
    """Return work space for arms of this size."""
    stages = Stages(np.zeros(nq), *np.zeros((3, nv)))
    return LoopWorkspace(
        *(scratch(nv), workspace(nv), workspace(nv), stages, np.zeros(nq), *np.zeros((3, nv))),
        *(np.zeros(nq), *np.zeros((3, nv)), np.ones(nv)),
    )


def reason_against_parts(controller: Any, interaction: Interaction) -> str | None:
    """Return the name of a part without a compiled form, or None."""
    if not can_sample(interaction):
        return f"an interaction of the user's own ({type(interaction).__name__})"
    if isinstance(controller, FormulaBaseline):
        has_form = baseline_tick.has_compiled_tick(controller)
        return None if has_form else f"its {type(controller).__name__} with limits or such a target"
    if type(controller._filter) is not ImpedanceFilter:
        return f"a target that is not linear ({type(controller.impedance).__name__})"
    if not can_pack(controller.surface, controller.reaching):
        surface, reaching = type(controller.surface).__name__, type(controller.reaching).__name__
        return f"{surface} with {reaching}"
    return None
