"""Robust joint impedance control of any URDF arm on Pinocchio.

`load_robot` turns a robot description into an `ArmModel`; an `ImpedanceController` makes the arm feel like a chosen
mass, damper and spring; `simulate` closes the loop with a plant of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import baselines as baselines
from . import interaction as interaction
from . import scenarios as scenarios
from . import trajectories as trajectories
from ._leaf import leaf as _leaf
from .bounded_surface import BoundedSurface as BoundedSurface
from .cartesian import joint_matrix as joint_matrix
from .checkpointing import Checkpoint as Checkpoint
from .controller import ControllerOutput as ControllerOutput
from .controller import ControllerState as ControllerState
from .controller import ImpedanceController as ImpedanceController
from .dynamics import ArmModel as ArmModel
from .encoders import QuantizedEncoders as QuantizedEncoders
from .energy import energy_balance as energy_balance
from .estimators import MomentumObserver as MomentumObserver
from .estimators import SuperTwistingMomentumObserver as SuperTwistingMomentumObserver
from .estimators import sense as sense
from .exceptions import DimensionError as DimensionError
from .exceptions import DivergenceError as DivergenceError
from .exceptions import GainError as GainError
from .exceptions import InputError as InputError
from .exceptions import MissingExtraError as MissingExtraError
from .exceptions import ModelError as ModelError
from .exceptions import NonFiniteError as NonFiniteError
from .exceptions import RBImpedanceError as RBImpedanceError
from .exceptions import UnsupportedJointError as UnsupportedJointError
from .finite_time import FiniteTimeImpedance as FiniteTimeImpedance
from .impedance import Impedance as Impedance
from .interaction import FrameWrench as FrameWrench
from .interaction import Interaction as Interaction
from .interaction import JointTorque as JointTorque
from .interaction import Push as Push
from .interaction import Sum as Sum
from .interaction import Wall as Wall
from .interaction import WrenchSensor as WrenchSensor
from .interaction import impedance_for_wall as impedance_for_wall
from .lean import LeanController as LeanController
from .limits import Limits as Limits
from .observers import SuperTwistingDisturbanceObserver as SuperTwistingDisturbanceObserver
from .observers import observe as observe
from .plants import DrivenPlant as DrivenPlant
from .plants import MujocoPlant as MujocoPlant
from .plants import engine_agreement as engine_agreement
from .reference_guard import ReferenceGuard as ReferenceGuard
from .result import SimulationResult as SimulationResult
from .robots import load_robot as load_robot
from .safety import EnergyTank as EnergyTank
from .safety import FaultGuard as FaultGuard
from .safety import OperatingRange as OperatingRange
from .simulation import BatchResult as BatchResult
from .simulation import simulate as simulate
from .simulation import simulate_batch as simulate_batch
from .snapshot import load_snapshot as load_snapshot
from .snapshot import save_snapshot as save_snapshot
from .stability import Certificate as Certificate
from .stability import certify as certify
from .study import Experiment as Experiment
from .study import Study as Study
from .study import Task as Task
from .study import run_study as run_study
from .study import summarize as summarize
from .super_twisting import SuperTwisting as SuperTwisting
from .surfaces import FastTerminalSurface as FastTerminalSurface
from .surfaces import NonsingularTerminalSurface as NonsingularTerminalSurface
from .surfaces import PowerSurface as PowerSurface
from .trajectories import Reference as Reference
from .tuning import GainProposal as GainProposal
from .tuning import Spread as Spread
from .tuning import Uncertainty as Uncertainty
from .tuning import propose_gains as propose_gains
from .variable_impedance import blend as blend
from .variable_impedance import check_variation as check_variation

if TYPE_CHECKING:
    from .visualization import Viewer as Viewer
    from .visualization import view as view

__version__ = "0.1.0"

_FROM_LEAVES = {"view": "visualization", "Viewer": "visualization"}


def __getattr__(name: str) -> object:
    """Load what the package offers of its leaves when it is asked for."""
    if name in _FROM_LEAVES:
        return getattr(_leaf(_FROM_LEAVES[name]), name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
