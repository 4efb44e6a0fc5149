"""Old addresses of modules, kept for one release: importing one works, and warns with the new address."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

MOVED = {
    "rbimpedance.baselines": "rbimpedance.control.baselines",
    "rbimpedance.bounded_surface": "rbimpedance.law.bounded_surface",
    "rbimpedance.cartesian": "rbimpedance.robot.cartesian",
    "rbimpedance.checkpointing": "rbimpedance.simulation.checkpoint",
    "rbimpedance.controller": "rbimpedance.control.controller",
    "rbimpedance.dynamics": "rbimpedance.robot.arm_model",
    "rbimpedance.encoders": "rbimpedance.control.encoders",
    "rbimpedance.energy": "rbimpedance.simulation.energy",
    "rbimpedance.estimators": "rbimpedance.interaction.estimators",
    "rbimpedance.finite_time": "rbimpedance.law.finite_time_impedance",
    "rbimpedance.impedance": "rbimpedance.law.impedance",
    "rbimpedance.lean": "rbimpedance.control.realtime",
    "rbimpedance.limits": "rbimpedance.law.limits",
    "rbimpedance.loop": "rbimpedance.control.loop",
    "rbimpedance.observers": "rbimpedance.interaction.observers",
    "rbimpedance.plants": "rbimpedance.simulation.plants",
    "rbimpedance.plotting": "rbimpedance.pictures.figures",
    "rbimpedance.reference_guard": "rbimpedance.control.guards.reference_guard",
    "rbimpedance.result": "rbimpedance.simulation.result",
    "rbimpedance.robots": "rbimpedance.robot.load",
    "rbimpedance.safety": "rbimpedance.control.guards",
    "rbimpedance.scenarios": "rbimpedance.simulation.scenarios",
    "rbimpedance.snapshot": "rbimpedance.control.snapshot",
    "rbimpedance.stability": "rbimpedance.law.certificate",
    "rbimpedance.super_twisting": "rbimpedance.law.super_twisting",
    "rbimpedance.surfaces": "rbimpedance.law.surfaces",
    "rbimpedance.telemetry": "rbimpedance.control.telemetry",
    "rbimpedance.tracking": "rbimpedance.control.errors",
    "rbimpedance.tuning.input_gain": "rbimpedance.law.input_gain",
    "rbimpedance.variable_impedance": "rbimpedance.law.impedance_changes",
    "rbimpedance.visualization": "rbimpedance.pictures.viewer",
}
"""The documented modules of version 0.1, and where their content is now."""


class MovedModules(MetaPathFinder, Loader):
    """Finds a module of `MOVED` under its old address."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return how to load a moved module, None for every other name."""
        del path, target
        return ModuleSpec(name, self) if name in MOVED else None

    def exec_module(self, module: ModuleType) -> None:
        """Put the new module in the place of the old one."""
        old, new = module.__name__, MOVED[module.__name__]
        warnings.warn(
            f"{old} has moved to {new}; the old address will be removed in the next release",
            DeprecationWarning,
            stacklevel=2,
        )
        sys.modules[old] = import_module(new)
