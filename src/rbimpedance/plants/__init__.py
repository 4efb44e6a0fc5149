"""What a run moves: rigid links by Pinocchio's ABA, and whatever else keeps the form of a `Plant`."""

from .protocol import Motion as Motion
from .protocol import Plant as Plant
from .rigid import RigidPlant as RigidPlant
