"""What the tick is compared with: the same law in C++, and other libraries on the same arm."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from .build_cpp import build
from .environments import interpreter, version
from .workers import Worker, WorkerError

SOURCES = Path(__file__).parent
"""Where the C++ loop and the programs of the peers are."""


class Task(NamedTuple):
    """One thing that a peer does.

    Attributes:
        label: What the table calls it.
        note: What is and is not comparable.
        has_law: Whether its torque is that of M·(a_d + 100·(q_d - q) + 20·(v_d - v)) + bias - tau_ext.
    """

    label: str
    note: str
    has_law: bool = False


class Peer(NamedTuple):
    """A library.

    Attributes:
        distribution: Its name for pip.
        module: Its name for Python.
        requirements: What pip installs.
        tasks: What its program does, by the names in its protocol.
    """

    distribution: str
    module: str
    requirements: tuple[str, ...]
    tasks: Mapping[str, Task]


_COMPUTED_TORQUE = "computed torque, no impedance filter, no sliding mode, no telemetry"

PEERS = {
    "pybullet": Peer(
        "pybullet",
        "pybullet",
        ("pybullet>=3.2.7", "numpy"),
        {"tick": Task("PyBullet calculateInverseDynamics", f"{_COMPUTED_TORQUE}; lists", True)},
    ),
    "mujoco": Peer(
        "mujoco",
        "mujoco",
        ("mujoco>=3.3",),
        {
            "tick": Task(
                "MuJoCo mj_rne", f"{_COMPUTED_TORQUE}; only the stages that it needs", True
            ),
            "inverse": Task("MuJoCo mj_inverse", f"{_COMPUTED_TORQUE}; constraints off", True),
        },
    ),
    "tsid": Peer(
        "tsid",
        "tsid",
        ("tsid>=1.10",),
        {"tick": Task("TSID posture task", "the same torque by a quadratic program", True)},
    ),
    "drake": Peer(
        "drake",
        "pydrake",
        ("drake>=1.40",),
        {
            "tick": Task("Drake CalcInverseDynamics", _COMPUTED_TORQUE, True),
            "inverse_dynamics_controller": Task(
                "Drake InverseDynamicsController", f"{_COMPUTED_TORQUE}; a system with ports", True
            ),
            "joint_stiffness_controller": Task(
                "Drake JointStiffnessController",
                "spring and damper beside gravity; less than a tick",
            ),
        },
    ),
    "roboticstoolbox": Peer(
        "roboticstoolbox-python",
        "roboticstoolbox",
        ("roboticstoolbox-python>=1.1",),
        {"tick": Task("roboticstoolbox rne (DH, C)", "computed torque; masses of its own model")},
    ),
    "pink": Peer(
        "pin-pink",
        "pink",
        ("pin-pink>=3.1", "quadprog"),
        {"tick": Task("Pink solve_ik", "inverse kinematics by a quadratic program, no torque")},
    ),
}
"""By the names of their programs in peers/."""

STEP = "step"
"""What MuJoCo's program calls a step of its simulation."""


class Started(NamedTuple):
    """What runs, and why the rest does not.

    Attributes:
        workers: By name, "c++" for the C++ loop.
        versions: Of the peers that run.
        reasons: By name, of those that do not.
    """

    workers: dict[str, Worker]
    versions: dict[str, str]
    reasons: dict[str, str]


def start(stack: ExitStack, urdf: Path, names: tuple[str, ...], sources: Path = SOURCES) -> Started:
    """Start the C++ loop ("c++") and peers; each is installed or built first where it is not there.

    Args:
        stack: Ends them.
        urdf: Description that they read.
        names: Which.
        sources: Folder of their programs.
    """
    started = Started({}, {}, {})
    for name in names:
        try:
            command, number = _program(name, sources)
            started.workers[name] = stack.enter_context(Worker([*command, str(urdf.resolve())]))
            started.versions[name] = number
        except WorkerError as error:
            started.reasons[name] = str(error)
    return started


def _program(name: str, sources: Path) -> tuple[list[str], str]:
    if not sources.is_dir():
        raise WorkerError("its source is in a checkout of the project only")
    if name == "c++":
        return [str(build(sources / "cpp/tick.cpp"))], ""
    peer = PEERS[name]
    python = interpreter(name, peer.module, peer.requirements)
    program = str(sources / "peers" / f"{name}_peer.py")
    return [python, "-W", "ignore", program], version(python, peer.distribution)
