"""The simulated plants: rigid links by Pinocchio's ABA, and other classes with the interface of a `Plant`."""

from .agreement import EngineAgreement as EngineAgreement
from .agreement import engine_agreement as engine_agreement
from .driven_plant import DrivenPlant as DrivenPlant
from .driven_plant import DrivenState as DrivenState
from .mujoco_plant import MujocoPlant as MujocoPlant
from .protocol import Motion as Motion
from .protocol import Plant as Plant
from .rigid import RigidPlant as RigidPlant
