"""`load_robot`: any robot description becomes an `ArmModel`, with every check on the way in.

The order, one file of `loading` after the other:

1. `arguments` checks what is given; `robot_sources` finds the source, `robot_text` and `encoding` read its file,
   `xacro_expansion` expands it.
2. `urdf_reader` reads the text strictly (`strict_xml`, `xml_faults`), repairs it on request (`repair`), and checks that
   links and joints make one robot (`urdf_tree`). What comes out is a `urdf_document`.
3. `full_robot` makes one robot of the document, or of a `pinocchio.Model` that is given: `joint_selection` says which
   joints are locked, `model_building` has Pinocchio build the model and compares it with the document.
4. `reduction` freezes what is locked, `soundness` checks mass and inertia, `tool_frame` and `model_notes` look at the
   result, which becomes the `ArmModel`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .._common.arrays import gain, per_joint, vector
from ..exceptions import ModelError
from .arm_model import ArmModel
from .loading.arguments import folders_of, given_positions, repair_names
from .loading.full_robot import FullRobot, from_document, from_model
from .loading.model_notes import model_notes
from .loading.recipe import accepting_no_mass, with_recipe
from .loading.reduction import reduced
from .loading.robot_sources import read_source
from .loading.soundness import check_inertia, massless_joints, no_mass
from .loading.tool_frame import default_tool_frame
from .loading.urdf_reader import parse_urdf
from .loading.wording import error_context, printable
from .postures import set_ready


def load_robot(
    source: object,
    *,
    joints: Iterable[str] | None = None,
    lock: Iterable[str] = (),
    locked_configuration: Mapping[str, float] | None = None,
    tool_frame: str | None = None,
    gravity: ArrayLike | None = None,
    armature: ArrayLike | None = None,
    massless: bool = False,
    package_dirs: str | Path | Sequence[str | Path] = (),
    xacro_args: Mapping[str, object] | None = None,
    repair: bool | str | Iterable[str] = False,
) -> ArmModel:
    """Load a robot and check it on the way in.

    Args:
        source: Path to a .urdf or .xacro file; XML text; the name of a robot that is bundled ("two_link"), comes with
            example-robot-data ("panda") or with robot_descriptions ("iiwa7_description"), looked up in this order; a
            `yourdfpy.URDF`; a `pinocchio.Model` or `RobotWrapper`.
        joints: Names of the joints to keep; all others are locked, a floating base too. Joints that mimic a kept one
            are kept with it.
        lock: Names of joints to freeze. "root_joint" welds a floating base to the world.
        locked_configuration: Positions of locked joints by name [rad or m]. The others are locked in Pinocchio's
            neutral configuration, moved into the position limits; mimicking joints where what they follow puts them.
        tool_frame: Frame that Jacobians and wrenches refer to by default. Without it, the link at the end of the
            longest chain of joints (fixed ones count) that can move; of several, the one with more movable joints on
            its chain, then the first of the document.
        gravity: Acceleration of free fall in world axes, shape (3,) [m/s²]. Without it, the document's own in
            `<rbimpedance><gravity xyz="0 0 -9.8"/></rbimpedance>`, else (0, 0, -9.81).
        armature: Reflected inertia of the rotors on the diagonal of M, scalar or (nv,) [kg·m² or kg]; replaces what a
            `pinocchio.Model` contains.
        massless: True accepts joints that move links without mass. Their gravity torque is 0 in the model, so that the
            controller does not hold the real links; `notes` name the joints. They need `armature`.
        package_dirs: Folders that hold ROS packages: for `package://` addresses of meshes, and for $(find package) in
            xacro files. The file's own package and its neighbours, AMENT_PREFIX_PATH and ROS_PACKAGE_PATH follow.
        xacro_args: Arguments of a xacro file by name, as in `xacro file.xacro name:=value`. A module of
            robot_descriptions brings its own, which these replace.
        repair: True fixes unambiguous errors of a document; names of `loading.repair.REPAIRS` fix those only. `notes`
            lists the changes.

    Returns:
        The arm; its `notes` say what was found on the way: limits that are not given, meshes that are not there, ...

    Raises:
        ModelError: No such source, or its description is not sound; says which element and what would be right.
        UnsupportedJointError: Joints that cannot be controlled, by name, with the remedy.
        MissingExtraError: A robot_descriptions name without that package.
        ParameterError: `armature` is negative or not finite.
        DimensionError: `gravity` or `armature` has a wrong shape.
        NonFiniteError: `gravity` holds NaN or infinity.
    """
    values, repairs = given_positions(locked_configuration), repair_names(repair)
    folders = folders_of(package_dirs)
    if isinstance(source, pin.RobotWrapper):
        source = source.model
    if isinstance(source, pin.Model):
        with error_context("the pinocchio.Model"):
            robot = from_model(source, joints, lock, values)
            return _arm(robot, tool_frame, gravity, armature, massless=massless)
    with error_context(""):
        text = read_source(source, folders, repairs, xacro_args)
    with error_context(text.origin):
        document = parse_urdf(text.text, text.origin, repairs)
        robot = from_document(document, text, joints, lock, values)
        robot = replace(robot, description=with_recipe(robot, source, folders, repairs))
        return _arm(robot, tool_frame, gravity, armature, massless=massless)


def _arm(
    robot: FullRobot,
    tool_frame: str | None,
    gravity: ArrayLike | None,
    armature: ArrayLike | None,
    *,
    massless: bool,
) -> ArmModel:
    """Freeze locked joints, set the requested parameters, and check the dynamics."""
    model = reduced(robot)
    weightless = massless_joints(model)
    if weightless and not massless:
        raise no_mass(weightless, model.nv)
    if gravity is not None:
        model.gravity.linear = vector("gravity", gravity, 3, "x, y, z")
    tool = default_tool_frame(model, robot.link_order) if tool_frame is None else tool_frame
    if not isinstance(tool, str):
        raise ModelError(f"tool_frame= takes the name of a frame, got {tool!r}")
    notes = model_notes(robot, model, tool, weightless)
    if armature is not None:
        given = gain("armature", armature, "non-negative", lambda x: x >= 0.0)
        model.armature = np.array(per_joint("armature", given, model.nv))
    if robot.posture:
        set_ready(model, robot.posture)
    arm = ArmModel(
        model,
        name=printable(robot.name),
        tool_frame=tool,
        notes=tuple(printable(note) for note in notes),
        description=accepting_no_mass(robot.description, model) if massless else robot.description,
    )
    check_inertia(arm)
    return arm
