"""Noise, delay and torque constants in compiled code, against the readable loop."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rbimpedance as rbi
from rbimpedance.control.imperfect import ImperfectController
from rbimpedance.simulation import simulate_batch
from rbimpedance.simulation.closed_loop import run
from rbimpedance.simulation.run import closed_loop

from ..arms import spinner_urdf

IMPERFECTIONS: dict[str, dict[str, Any]] = {
    "torque constants": {"torque_constant": [0.9, 1.1, 1.05]},
    "delay": {"delay": 2},
    "noise": {"position_noise": 1e-5, "velocity_noise": 1e-4, "seed": 3},
    "all": {"torque_constant": 1.1, "delay": 1, "position_noise": [1e-5, 0.0, 2e-5], "seed": 1},
}


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> rbi.ArmModel:
    """A continuous, a prismatic and an oblique joint."""
    path = tmp_path_factory.mktemp("arm") / "spinner.urdf"
    path.write_text(spinner_urdf(), encoding="utf-8")
    return rbi.load_robot(path)


@pytest.mark.parametrize("name", IMPERFECTIONS)
def test_compiled_imperfections_are_those_of_the_readable_loop(
    arm: rbi.ArmModel, name: str
) -> None:
    law = rbi.ImpedanceController(arm, backend="compiled")
    controller = ImperfectController(law, **IMPERFECTIONS[name])
    wrench = np.array([0.3, 1.0, -0.5, 0.0, 0.1, 0.0])
    parts: Any = (controller, arm.with_payload(0.5), rbi.trajectories.hold(arm, arm.neutral))
    settings: Any = {"environment": wrench, "duration": 0.1, "substeps": 2}
    readable = run(closed_loop(*parts, integrator="semi-implicit", **settings))
    fast = rbi.simulate(*parts, **settings)
    batch = simulate_batch([controller] * 2, *parts[1:], channels=("q", "tau", "s"), **settings)
    for channel in ("q", "v", "e1", "s", "tau", "tau_ext", "e_im"):
        np.testing.assert_allclose(
            getattr(fast, channel), getattr(readable, channel), rtol=1e-8, atol=1e-9
        )
    for channel in ("q", "tau", "s"):
        np.testing.assert_array_equal(batch[channel][1], getattr(fast, channel))
    np.testing.assert_allclose(
        batch.metrics["tau_variation"][0], readable.metrics()["tau_variation"], rtol=1e-6
    )
