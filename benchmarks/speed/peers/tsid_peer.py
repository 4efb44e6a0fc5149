"""TSID: a posture task by its quadratic program."""

from __future__ import annotations

import sys

import numpy as np
import pinocchio as pin
import tsid
from protocol import KD, KP, State, serve

robot = tsid.RobotWrapper(sys.argv[1], pin.StdVec_StdString(), False)
formulation = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
rest = np.zeros(robot.nv)
formulation.computeProblemData(0.0, rest, rest)
posture = tsid.TaskJointPosture("posture", robot)
posture.setKp(KP * np.ones(robot.nv))
posture.setKd(KD * np.ones(robot.nv))
formulation.addMotionTask(posture, 1.0, 1, 0.0)
solver = tsid.SolverHQuadProgFast("solver")
solver.resize(formulation.nVar, formulation.nEq, formulation.nIn)  # codespell:ignore
sample = tsid.TrajectorySample(robot.nv)


def tick(x: State) -> np.ndarray:
    """Set the reference, build the problem, solve it."""
    sample.value(x.q_d)
    sample.derivative(x.v_d)
    sample.second_derivative(x.a_d)
    posture.setReference(sample)
    solution = solver.solve(formulation.computeProblemData(0.0, x.q, x.v))
    return formulation.getActuatorForces(solution) - x.tau_ext


serve({"tick": tick})
