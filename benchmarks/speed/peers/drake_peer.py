"""Drake: computed torque by CalcInverseDynamics, and its two joint controllers as systems."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from protocol import KD, KP, State, command, serve
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.controllers import InverseDynamicsController, JointStiffnessController


def plant() -> MultibodyPlant:
    """The arm, welded to the world."""
    made = MultibodyPlant(1e-3)
    Parser(made).AddModelsFromString(Path(sys.argv[1]).read_text(encoding="utf-8"), "urdf")
    made.WeldFrames(made.world_frame(), made.GetFrameByName("panda_link0"))
    for index in made.GetJointIndices():
        if made.get_joint(index).num_velocities() == 1:
            made.AddJointActuator(f"actuator{int(index)}", made.get_joint(index))
    made.Finalize()
    return made


arm = plant()
n = arm.num_velocities()
context, forces = arm.CreateDefaultContext(), MultibodyForces(arm)
controller = InverseDynamicsController(
    arm, KP * np.ones(n), np.zeros(n), KD * np.ones(n), has_reference_acceleration=True
)
stiffness = JointStiffnessController(arm, KP * np.ones(n), KD * np.ones(n))
controller_context = controller.CreateDefaultContext()
stiffness_context = stiffness.CreateDefaultContext()


def tick(x: State) -> np.ndarray:
    """CalcInverseDynamics under gravity."""
    arm.SetPositions(context, x.q)
    arm.SetVelocities(context, x.v)
    arm.CalcForceElementsContribution(context, forces)
    return arm.CalcInverseDynamics(context, command(x), forces) - x.tau_ext


def inverse_dynamics_controller(x: State) -> np.ndarray:
    """The system InverseDynamicsController."""
    controller.get_input_port_estimated_state().FixValue(
        controller_context, np.concatenate([x.q, x.v])
    )
    controller.get_input_port_desired_state().FixValue(
        controller_context, np.concatenate([x.q_d, x.v_d])
    )
    controller.get_input_port_desired_acceleration().FixValue(controller_context, x.a_d)
    torque = controller.get_output_port_control().Eval(controller_context)
    return torque - x.tau_ext


def joint_stiffness_controller(x: State) -> np.ndarray:
    """The system JointStiffnessController: gravity, and a spring that is not multiplied by M(q)."""
    stiffness.get_input_port_estimated_state().FixValue(
        stiffness_context, np.concatenate([x.q, x.v])
    )
    stiffness.get_input_port_desired_state().FixValue(
        stiffness_context, np.concatenate([x.q_d, x.v_d])
    )
    return stiffness.get_output_port_actuation().Eval(stiffness_context) - x.tau_ext


serve(
    {
        "tick": tick,
        "inverse_dynamics_controller": inverse_dynamics_controller,
        "joint_stiffness_controller": joint_stiffness_controller,
    }
)
