"""From what the user does not know to gains that carry it: `Uncertainty`, `propose_gains`, `GainProposal`."""

from __future__ import annotations

from .imperfect import ImperfectController as ImperfectController
from .motions import Spread as Spread
from .proposal import GainProposal as GainProposal
from .proposal import propose_gains as propose_gains
from .uncertainty import PlantSample as PlantSample
from .uncertainty import Uncertainty as Uncertainty
