"""Ready experiments: section 4 of the paper, and the same with every correction and every baseline."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from .._common.arrays import Array
from .._common.deprecation import renamed_attribute
from ..control.baselines import (
    ComputedTorqueImpedance,
    FirstOrderSlidingMode,
    PDGravity,
    PIDImpedance,
    SlotineLi,
    Smoothing,
)
from ..control.controller import ImpedanceController
from ..control.protocol import Controller
from ..exceptions import ParameterError
from ..interaction import FrameWrench, Interaction
from ..law.impedance import Impedance
from ..law.super_twisting import Scheme, SuperTwisting
from ..law.surfaces import FastTerminalSurface, NonsingularTerminalSurface, PowerSurface, Surface
from ..robot.arm_model import ArmModel
from ..robot.knowledge import Knowledge
from ..robot.load import load_robot
from ..trajectories import Trajectory, cosine
from .checkpoint import Checkpoint
from .plants.integrators import Integrator
from .result import SimulationResult
from .run import simulate

SurfaceName = Literal["power", "fast-terminal", "nonsingular-terminal"]
"""The surfaces by name, at the gains of docs/theory.md."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Scenario:
    """A controller, a plant, and what they are put through.

    Attributes:
        controller: The controller with its own model.
        plant: The simulated arm.
        trajectory: Desired motion.
        environment: What pushes on the plant.
        q0: Initial configuration, shape (nq,).
        duration: Length [s].
        substeps: Physics steps per control period.
        integrator: Of the plant.
    """

    controller: Controller[Any]
    plant: ArmModel
    trajectory: Trajectory
    environment: Interaction
    q0: Array
    duration: float
    substeps: int = 4
    integrator: Integrator = "semi-implicit"

    def simulate(
        self,
        *,
        on_tick: Callable[[int, int], None] | None = None,
        checkpoint: Checkpoint | None = None,
    ) -> SimulationResult:
        """Run it; see `rbimpedance.simulate`."""
        return simulate(**vars(self), on_tick=on_tick, checkpoint=checkpoint)

    wrench = renamed_attribute("wrench", "environment")


def paper(
    *,
    known: Knowledge = "inertia",
    surface: SurfaceName = "power",
    scheme: Scheme = "explicit",
    dt: float = 1e-3,
    duration: float = 10.0,
    substeps: int = 4,
) -> Scenario:
    """Return section 4 of the paper on `urdf/two_link.urdf`, or a variation of it.

    Args:
        known: "inertia", as in the paper (f ≡ 0: gravity, Coriolis and friction are disturbance), or "full".
        surface: "power" (the paper's), "fast-terminal" or "nonsingular-terminal".
        scheme: "explicit" (the paper's law as sampled), "matched" or "implicit".
        dt: Control period [s].
        duration: Length [s].
        substeps: Physics steps per control period.

    Raises:
        ParameterError: An unknown name, or a period or duration that cannot be.
    """
    arm = load_robot("two_link")
    controller = ImpedanceController(
        arm,
        impedance=Impedance(mass=1.0, damping=10.0, stiffness=20.0),
        surface=paper_surface(surface),
        reaching=SuperTwisting(k1=8.0, k2=10.0, scheme=scheme),
        dt=dt,
        model=known,
    )
    return Scenario(
        controller=controller,
        plant=arm,
        trajectory=cosine(arm, center=0.5, amplitude=0.2, period=6.0),
        environment=FrameWrench(_paper_force),
        q0=np.zeros(2),
        duration=duration,
        substeps=substeps,
    )


def paper_comparison(*, dt: float = 1e-3, duration: float = 10.0) -> dict[str, Scenario]:
    """Return section 4 under the paper's law, each correction alone, both, and the baselines.

    All know the mass matrix only, and all have the same target impedance. The gains of the first-order sliding modes
    exceed the disturbance, about 25 rad/s² here; boundary layer and dead zone are 0.05 rad/s wide. The PID has the
    bandwidth with which it asks for as much torque at the start as the boundary layer.

    Args:
        dt: Control period [s].
        duration: Length [s].

    Returns:
        Scenarios by name, in the order of a table.
    """
    laws: dict[str, tuple[SurfaceName, Scheme]] = {
        "paper's law, as sampled": ("power", "explicit"),
        "surface corrected": ("fast-terminal", "explicit"),
        "surface corrected (nonsingular)": ("nonsingular-terminal", "explicit"),
        "scheme corrected": ("power", "matched"),
        "scheme corrected (implicit)": ("power", "implicit"),
        "both corrected": ("fast-terminal", "matched"),
        "both corrected (implicit)": ("fast-terminal", "implicit"),
        "both corrected (nonsingular)": ("nonsingular-terminal", "matched"),
    }
    scenarios = {
        name: paper(surface=surface, scheme=scheme, dt=dt, duration=duration)
        for name, (surface, scheme) in laws.items()
    }
    common = scenarios["paper's law, as sampled"]
    arm = common.controller.arm
    target = Impedance(mass=1.0, damping=10.0, stiffness=20.0)

    def sliding(smoothing: Smoothing, width: float | None) -> FirstOrderSlidingMode:
        return FirstOrderSlidingMode(arm, target, 5.0, 50.0, dt, smoothing, width, model="inertia")

    baselines: dict[str, Controller[Any]] = {
        "computed torque (Hogan)": ComputedTorqueImpedance(arm, target, dt, model="inertia"),
        "computed torque, PID": PIDImpedance(arm, target, 5.0, dt, model="inertia"),
        "PD, gravity unknown": PDGravity(arm, target, dt, model="inertia"),
        "first-order, sign": sliding("sign", None),
        "first-order, boundary layer": sliding("boundary-layer", 0.05),
        "first-order, dead zone": sliding("dead-zone", 0.05),
        "Slotine-Li": SlotineLi(arm, target, 5.0, 20.0, dt, model="inertia"),
    }
    return scenarios | {
        name: replace(common, controller=controller) for name, controller in baselines.items()
    }


def paper_surface(name: SurfaceName) -> Surface:
    """Return a surface by name, with the gains that the paper's scenario uses.

    Raises:
        ParameterError: An unknown name.
    """
    if name == "power":
        return PowerSurface(gamma=3.0, exponent=5.0 / 3.0)
    if name == "fast-terminal":
        return FastTerminalSurface(rate=2.0, gamma=3.0, exponent=0.6, smoothing=1e-3)
    if name == "nonsingular-terminal":
        return NonsingularTerminalSurface(beta=3.0, exponent=5.0 / 3.0)
    raise ParameterError("surface", name, '"power", "fast-terminal" or "nonsingular-terminal"')


def _paper_force(t: float) -> Array:
    """f_e = [5 sin 0.2t, 5 cos 0.2t] N in the arm's plane, the world's x-z plane, as a wrench."""
    return np.array([5.0 * np.sin(0.2 * t), 0.0, 5.0 * np.cos(0.2 * t), 0.0, 0.0, 0.0])
