"""The environment's action on the arm, and its measurement by the controller.

Wrenches and contacts push on the arm (`Interaction`); sensors are between the torque that they exert and the one
that the controller sees; the contact rules say which impedance suits which wall.
"""

from __future__ import annotations

from .contact import Push as Push
from .contact import Wall as Wall
from .contact_rules import NormalImpedance as NormalImpedance
from .contact_rules import contact_damping as contact_damping
from .contact_rules import critical_delay as critical_delay
from .contact_rules import impedance_for_wall as impedance_for_wall
from .contact_rules import normal_impedance as normal_impedance
from .contact_rules import recommended_mass as recommended_mass
from .contact_rules import smallest_mass as smallest_mass
from .estimators import MomentumObserver as MomentumObserver
from .estimators import SuperTwistingMomentumObserver as SuperTwistingMomentumObserver
from .sensors import Chain as Chain
from .sensors import Delay as Delay
from .sensors import LowPass as LowPass
from .sensors import Perfect as Perfect
from .sensors import Sensor as Sensor
from .wrench_sensor import WrenchSensor as WrenchSensor
from .wrench_sensor import calibrate_tool as calibrate_tool
from .wrenches import AppliedWrench as AppliedWrench
from .wrenches import EnvironmentLike as EnvironmentLike
from .wrenches import FrameInteraction as FrameInteraction
from .wrenches import FrameWrench as FrameWrench
from .wrenches import Interaction as Interaction
from .wrenches import JointTorque as JointTorque
from .wrenches import Nothing as Nothing
from .wrenches import Sum as Sum
from .wrenches import TimeFunction as TimeFunction
from .wrenches import as_interaction as as_interaction
