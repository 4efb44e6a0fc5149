"""Robust joint impedance control of any URDF arm on Pinocchio.

`load_robot` turns a robot description into an `ArmModel`; an `ImpedanceController` makes the arm feel like a chosen
mass, damper and spring; `simulate` closes the loop with a plant of its own.
"""

from __future__ import annotations

import sys as _sys
from importlib import import_module as _import_module
from operator import attrgetter as _attrgetter
from types import ModuleType as _ModuleType
from typing import TYPE_CHECKING

from ._common import first_sign as _first_sign  # noqa: F401  (first: it waits for the others)

# isort: split
from . import hardware as hardware
from . import interaction as interaction
from . import simulation as simulation
from . import study as study
from . import trajectories as trajectories
from ._common.deprecation import warn_renamed as _warn_renamed
from ._common.leaf import leaf as _leaf
from ._common.moved import MOVED as _MOVED
from ._common.moved import MovedModules as _MovedModules
from .control import baselines as baselines
from .control.cartesian import CartesianController as CartesianController
from .control.cartesian import Posture as Posture
from .control.controller import ControllerOutput as ControllerOutput
from .control.controller import ControllerState as ControllerState
from .control.controller import ImpedanceController as ImpedanceController
from .control.encoders import QuantizedEncoders as QuantizedEncoders
from .control.guards import EnergyTank as EnergyTank
from .control.guards import FaultError as FaultError
from .control.guards import FaultGuard as FaultGuard
from .control.guards import OperatingRange as OperatingRange
from .control.guards import SoftStart as SoftStart
from .control.guards.reference_guard import ReferenceGuard as ReferenceGuard
from .control.hardware_controller import HardwareController as HardwareController
from .control.loop import Loop as Loop
from .control.observed import ObservedController as ObservedController
from .control.realtime import RealtimeController as RealtimeController
from .control.sensorless import CompliantController as CompliantController
from .control.sensorless import SensorlessController as SensorlessController
from .control.snapshot import load_snapshot as load_snapshot
from .control.snapshot import save_snapshot as save_snapshot
from .exceptions import DimensionError as DimensionError
from .exceptions import DivergenceError as DivergenceError
from .exceptions import InputError as InputError
from .exceptions import JointLimitError as JointLimitError
from .exceptions import LogError as LogError
from .exceptions import MissingExtraError as MissingExtraError
from .exceptions import ModelError as ModelError
from .exceptions import NonFiniteError as NonFiniteError
from .exceptions import ParameterError as ParameterError
from .exceptions import RBImpedanceError as RBImpedanceError
from .exceptions import RobotError as RobotError
from .exceptions import UnsafeError as UnsafeError
from .exceptions import UnsupportedJointError as UnsupportedJointError
from .interaction import FrameWrench as FrameWrench
from .interaction import Interaction as Interaction
from .interaction import JointTorque as JointTorque
from .interaction import Sensor as Sensor
from .interaction import Wall as Wall
from .interaction import WrenchSensor as WrenchSensor
from .interaction import impedance_for_wall as impedance_for_wall
from .interaction.estimators import MomentumObserver as MomentumObserver
from .interaction.observers import (
    SuperTwistingDisturbanceObserver as SuperTwistingDisturbanceObserver,
)
from .law.bounded_surface import BoundedSurface as BoundedSurface
from .law.cartesian_impedance import CartesianImpedance as CartesianImpedance
from .law.certificate import Certificate as Certificate
from .law.certificate import certify as certify
from .law.finite_time_impedance import FiniteTimeImpedance as FiniteTimeImpedance
from .law.impedance import Impedance as Impedance
from .law.impedance_changes import blend as blend
from .law.impedance_changes import check_variation as check_variation
from .law.limits import Limits as Limits
from .law.poses import CartesianReference as CartesianReference
from .law.poses import Pose as Pose
from .law.sampled_certificate import SampledCertificate as SampledCertificate
from .law.sampled_certificate import certify_sampled as certify_sampled
from .law.super_twisting import FormulaReaching as FormulaReaching
from .law.super_twisting import SuperTwisting as SuperTwisting
from .law.surfaces import FastTerminalSurface as FastTerminalSurface
from .law.surfaces import FormulaSurface as FormulaSurface
from .law.surfaces import NonsingularTerminalSurface as NonsingularTerminalSurface
from .law.surfaces import PowerSurface as PowerSurface
from .law.surfaces import Surface as Surface
from .logs import Log as Log
from .robot.arm_model import ArmModel as ArmModel
from .robot.cartesian import joint_matrix as joint_matrix
from .robot.hardware import Hardware as Hardware
from .robot.inverse_kinematics import inverse_kinematics as inverse_kinematics
from .robot.load import load_robot as load_robot
from .simulation import BatchResult as BatchResult
from .simulation import scenarios as scenarios
from .simulation import simulate as simulate
from .simulation import simulate_batch as simulate_batch
from .simulation.checkpoint import Checkpoint as Checkpoint
from .simulation.energy import energy_balance as energy_balance
from .simulation.plants import DrivenPlant as DrivenPlant
from .simulation.plants import MujocoPlant as MujocoPlant
from .simulation.replay import estimate_disturbance as estimate_disturbance
from .simulation.replay import replay_sensor as replay_sensor
from .simulation.result import SimulationResult as SimulationResult
from .study import Study as Study
from .study import run_study as run_study
from .trajectories import Reference as Reference
from .tuning import CartesianGainProposal as CartesianGainProposal
from .tuning import GainProposal as GainProposal
from .tuning import HardwareProposal as HardwareProposal
from .tuning import MotionMargin as MotionMargin
from .tuning import Uncertainty as Uncertainty
from .tuning import propose_gains as propose_gains
from .tuning.gains_file import load_gains as load_gains
from .tuning.gains_file import save_gains as save_gains

if TYPE_CHECKING:
    from .pictures import figures as figures
    from .pictures.viewer import Viewer as Viewer
    from .pictures.viewer import view as view

__version__ = "0.1.0"

_LOADED_WHEN_USED = {"view": "pictures.viewer", "Viewer": "pictures.viewer"}

_RENAMED = {
    "GainError": "ParameterError",
    "LeanController": "RealtimeController",
    "Spread": "MotionMargin",
    "observe": "estimate_disturbance",
    "sense": "replay_sensor",
    "Push": "interaction.Push",
    "Sum": "interaction.Sum",
    "SuperTwistingMomentumObserver": "interaction.SuperTwistingMomentumObserver",
    "engine_agreement": "simulation.plants.engine_agreement",
    "Experiment": "study.Experiment",
    "Task": "study.Task",
    "summarize": "study.summarize",
}
"""Old public names, kept for one release, and the new ones."""

_ROOMS = {
    "baselines",
    "hardware",
    "interaction",
    "scenarios",
    "simulation",
    "study",
    "trajectories",
}
"""Modules that are public by themselves."""

_sys.meta_path.append(_MovedModules())


def __getattr__(name: str) -> object:
    """Load the package's pictures on first use."""
    if name in _LOADED_WHEN_USED:
        return getattr(_leaf(_LOADED_WHEN_USED[name]), name)
    if name == "figures":
        return _leaf("pictures.figures")
    if name in _RENAMED:
        _warn_renamed(f"rbimpedance.{name}", f"rbimpedance.{_RENAMED[name]}")
        return _attrgetter(_RENAMED[name])(_sys.modules[__name__])
    if f"{__name__}.{name}" in _MOVED:
        return _import_module(f"{__name__}.{name}")
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


def __dir__() -> list[str]:
    """Return the public names, and nothing else."""
    hidden = {"TYPE_CHECKING", "annotations"}
    there = {
        name
        for name, value in globals().items()
        if name in _ROOMS or not (name.startswith("_") or isinstance(value, _ModuleType))
    }
    return sorted((there - hidden) | _LOADED_WHEN_USED.keys() | {"figures", "__version__"})
