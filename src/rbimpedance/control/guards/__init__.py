"""Protection between faulty inputs and motors: a guard with a policy, and an energy tank at the impedance port."""

from .energy_tank import EnergyTank as EnergyTank
from .fault_guard import FaultGuard as FaultGuard
from .fault_telemetry import FaultEvent as FaultEvent
from .fault_telemetry import GuardedOutput as GuardedOutput
from .faults import Fault as Fault
from .faults import FaultError as FaultError
from .faults import OperatingRange as OperatingRange
from .soft_start import SoftStart as SoftStart
from .soft_start import SoftStartState as SoftStartState
