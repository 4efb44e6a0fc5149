"""From what the user does not know to gains that tolerate it: `Uncertainty`, `propose_gains`, `GainProposal`."""

from __future__ import annotations

from ..control.imperfect import ImperfectController as ImperfectController
from .hardware_proposal import HardwareProposal as HardwareProposal
from .motions import MotionMargin as MotionMargin
from .plant_sample import PlantSample as PlantSample
from .proposal import GainProposal as GainProposal
from .proposal import propose_gains as propose_gains
from .tool_proposal import CartesianGainProposal as CartesianGainProposal
from .torque_demand import TorqueDemand as TorqueDemand
from .torque_demand import slowed as slowed
from .uncertainty import Uncertainty as Uncertainty
