"""The closed loop: one run, its readable and its compiled forms, and many worlds at once."""

from .batch import BatchResult as BatchResult
from .batch import simulate_batch as simulate_batch
from .closed_loop import SPEED_BOUND as SPEED_BOUND
from .joint_stops import JointStops as JointStops
from .run import simulate as simulate
from .verdict import Verdict as Verdict
