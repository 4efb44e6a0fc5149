"""What a controller knows of an arm from counted positions and sent torques: speed, disturbance, friction.

Every estimator is immutable, its state explicit, and usable without the others. Their formulas take arrays over the
joints, or the numbers of one joint in compiled code: each stands once.
"""

from __future__ import annotations

from .differentiator import RobustDifferentiator as RobustDifferentiator
from .extended_state import Estimate as Estimate
from .extended_state import ExtendedStateObserver as ExtendedStateObserver
from .friction_learning import FrictionLearner as FrictionLearner
from .noise_gate import NoiseGate as NoiseGate
