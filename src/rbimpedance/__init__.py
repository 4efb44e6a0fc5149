"""Robust joint impedance control of any URDF arm on Pinocchio.

`load_robot` turns a robot description into an `ArmModel`; an `ImpedanceController` makes the arm feel like a chosen
mass, damper and spring; `simulate` closes the loop with a plant of its own.
"""

from __future__ import annotations

from . import baselines as baselines
from . import scenarios as scenarios
from . import trajectories as trajectories
from .controller import ControllerOutput as ControllerOutput
from .controller import ControllerState as ControllerState
from .controller import ImpedanceController as ImpedanceController
from .dynamics import ArmModel as ArmModel
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
from .limits import Limits as Limits
from .observers import SuperTwistingDisturbanceObserver as SuperTwistingDisturbanceObserver
from .observers import observe as observe
from .result import SimulationResult as SimulationResult
from .robots import load_robot as load_robot
from .simulation import simulate as simulate
from .stability import Certificate as Certificate
from .stability import certify as certify
from .super_twisting import SuperTwisting as SuperTwisting
from .surfaces import FastTerminalSurface as FastTerminalSurface
from .surfaces import NonsingularTerminalSurface as NonsingularTerminalSurface
from .surfaces import PowerSurface as PowerSurface
from .trajectories import Reference as Reference

__version__ = "0.1.0"
