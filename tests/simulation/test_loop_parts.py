"""Instruments and drives in the compiled loop, compared with the readable forms of both."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import rbimpedance as rbi
from rbimpedance.control import baselines
from rbimpedance.control.encoders import QuantizedEncoders
from rbimpedance.interaction import LowPass
from rbimpedance.interaction.estimators import MomentumObserver
from rbimpedance.simulation.closed_loop import LOGGED, run
from rbimpedance.simulation.compiled_runs import reason_against
from rbimpedance.simulation.plants import DrivenPlant
from rbimpedance.simulation.run import closed_loop
from rbimpedance.trajectories import cosine
from rbimpedance.tuning import ImperfectController

from ..arms import spinner

DT = 1e-3
ARM = spinner()
LINKS = ARM.with_payload(0.3).with_armature(0.2).with_friction(0.0, 0.0)
TARGET = rbi.Impedance(mass=1.0, damping=10.0, stiffness=20.0)
LAWS: dict[str, Any] = {
    "law": rbi.ImpedanceController(
        ARM, TARGET, rbi.PowerSurface(3.0, 1.5), rbi.SuperTwisting(8.0, 10.0), DT
    ),
    "PD+": baselines.PDPlus(ARM, TARGET, DT),
}
COUNTING = partial(QuantizedEncoders, resolution=2.0 * np.pi / 2**21, bandwidth=300.0)
NOISY = partial(ImperfectController, position_noise=1e-4, velocity_noise=1e-3, seed=3)


def _same(controller: Any) -> Any:
    return controller


WRAPS: dict[str, tuple[Any, Any, Any]] = {
    "noise": (NOISY, LINKS, None),
    "delay": (partial(ImperfectController, delay=2), LINKS, None),
    "noise and delay": (partial(NOISY, delay=3), LINKS, None),
    "observer": (_same, LINKS, MomentumObserver(ARM, 50.0, DT)),
    "encoders": (COUNTING, LINKS, None),
    "tachometer": (partial(QuantizedEncoders, velocity="measured", bandwidth=100.0), LINKS, None),
    "lag": (COUNTING, DrivenPlant(LINKS, time_constant=1e-3, ripple=0.02), None),
    "dead time": (_same, DrivenPlant(LINKS, dead_time=2e-3, cogging=0.02), None),
    "springs": (_same, DrivenPlant(LINKS, stiffness=3e3), None),
    "springs, encoders on the links": (
        _same,
        DrivenPlant(LINKS, stiffness=3e3, time_constant=1e-3, ripple=0.02, encoders="link"),
        None,
    ),
    "springs, friction": (NOISY, DrivenPlant(LINKS.with_friction(0.1, 0.1), stiffness=3e3), None),
}


def _experiment(plant: Any, sensor: Any) -> dict[str, Any]:
    motion = cosine(ARM, amplitude=0.3, period=2.0)
    q0 = ARM.integrate(motion(0.0).q, np.full(ARM.nv, 0.1))
    push = [1.0, 2.0, 3.0, 0.1, 0.0, 0.2]
    settings = {"duration": 0.1, "substeps": 8, "sensor": sensor}
    return {"plant": plant, "trajectory": motion, "q0": q0, "environment": push, **settings}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", WRAPS)
def test_compiled_run_behind_instruments_and_drives_is_the_readable_one(
    name: str, law: str
) -> None:
    wrap, plant, sensor = WRAPS[name]
    controller, given = wrap(LAWS[law]), _experiment(plant, sensor)
    loop = closed_loop(controller, integrator="semi-implicit", **given)
    assert reason_against(loop) is None
    expected, found = run(loop), rbi.simulate(controller, **given)
    # a stiff spring, and a step that rounds a count, amplify the last digit
    within = 1e-10 if isinstance(plant, DrivenPlant) or "encoders" in name else 1e-12
    for channel in LOGGED:
        truth = getattr(expected, channel)
        scale = max(1.0, float(np.abs(truth).max()))
        assert_allclose(
            getattr(found, channel), truth, rtol=0.0, atol=within * scale, err_msg=channel
        )


@pytest.mark.parametrize("name", ["noise and delay", "encoders", "springs"])
def test_batch_behind_instruments_and_drives_is_its_single_runs(name: str) -> None:
    wrap, plant, _ = WRAPS[name]
    given = _experiment(plant, None)
    del given["sensor"], given["plant"]
    controllers = [wrap(LAWS[law]) for law in LAWS]
    batch = rbi.simulate_batch(controllers, plant, channels=("q", "tau"), **given)
    for i, controller in enumerate(controllers):
        single = rbi.simulate(controller, plant, **given)
        assert_allclose(batch["q"][i], single.q, rtol=0.0, atol=1e-12)
        assert_allclose(batch["tau"][i], single.tau, rtol=0.0, atol=1e-9)


def test_torque_constant_still_acts() -> None:
    weak = ImperfectController(LAWS["PD+"], torque_constant=0.5)
    given = _experiment(LINKS, None)
    weaker, plain = rbi.simulate(weak, **given), rbi.simulate(LAWS["PD+"], **given)
    assert_allclose(weaker.tau[0], 0.5 * plain.tau[0], rtol=1e-12)


def test_other_sensors_are_run_by_the_readable_form() -> None:
    given = _experiment(LINKS, LowPass(50.0, DT))
    loop = closed_loop(LAWS["law"], integrator="semi-implicit", **given)
    assert "LowPass" in str(reason_against(loop))
    assert np.isfinite(rbi.simulate(LAWS["law"], **given).q).all()


def test_numpy_backend_behind_noise_stays_numpy() -> None:
    controller, given = NOISY(LAWS["law"].with_backend("numpy")), _experiment(LINKS, None)
    result = rbi.simulate(controller, **given)
    loop = closed_loop(controller, integrator="semi-implicit", **given)
    assert_allclose(result.q, run(loop).q, rtol=0.0, atol=0.0)
