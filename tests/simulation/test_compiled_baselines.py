"""Baselines in the compiled loop, compared with their readable form in the readable loop."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import rbimpedance as rbi
from rbimpedance.control import baselines
from rbimpedance.interaction import Push
from rbimpedance.robot.knowledge import Knowledge
from rbimpedance.simulation.closed_loop import LOGGED, run
from rbimpedance.simulation.compiled_runs import reason_against
from rbimpedance.simulation.run import closed_loop
from rbimpedance.trajectories import cosine

from ..arms import spinner

DT = 1e-3
ARM = spinner()
DIAGONAL = rbi.Impedance(mass=1.0, damping=10.0, stiffness=20.0)
_COUPLING = np.full((ARM.nv, ARM.nv), 0.1)
COUPLED = rbi.Impedance(
    np.eye(ARM.nv) + _COUPLING, 10.0 + _COUPLING.sum(), np.diag([20.0] * ARM.nv) + _COUPLING
)

NAMES = ("computed torque", "PD", "PD+", "Slotine-Li", "PID", "sign", "boundary layer", "dead zone")


def _baseline(name: str, target: rbi.Impedance, known: Knowledge) -> Any:
    arm = ARM.with_friction(0.1, 0.05)
    plain = {
        "computed torque": baselines.ComputedTorqueImpedance,
        "PD": baselines.PDGravity,
        "PD+": baselines.PDPlus,
    }
    if name in plain:
        return plain[name](arm, target, DT, model=known)
    if name == "Slotine-Li":
        return baselines.SlotineLi(arm, target, 2.0, 10.0, DT, model=known)
    if name == "PID":
        return baselines.PIDImpedance(arm, target, 10.0, DT, model=known)
    smoothing: dict[str, Any] = {"sign": ("sign", None), "boundary layer": ("boundary-layer", 0.1)}
    kind, width = smoothing.get(name, ("dead-zone", 0.05))
    return baselines.FirstOrderSlidingMode(arm, target, 2.0, 5.0, DT, kind, width, model=known)


def _experiment() -> dict[str, Any]:
    motion = cosine(ARM, amplitude=0.3, period=2.0)
    q0 = ARM.integrate(
        motion(0.0).q, np.full(ARM.nv, 0.3)
    )  # the sign does not depend on a last digit
    push = Push([1.0, 2.0, 3.0, 0.1, 0.0, 0.2], start=0.02, duration=0.05)
    return {"trajectory": motion, "q0": q0, "environment": push, "duration": 0.1, "substeps": 2}


@pytest.mark.parametrize("known", ["full", "inertia"])
@pytest.mark.parametrize("target", [DIAGONAL, COUPLED], ids=["diagonal", "coupled"])
@pytest.mark.parametrize("name", NAMES)
def test_compiled_run_of_a_baseline_is_the_readable_one(
    name: str, target: rbi.Impedance, known: Knowledge
) -> None:
    controller, plant = _baseline(name, target, known), ARM.with_friction(0.2, 0.1)
    given = _experiment()
    loop = closed_loop(controller, plant, integrator="semi-implicit", **given)
    assert reason_against(loop) is None
    expected, found = run(loop), rbi.simulate(controller, plant, **given)
    for channel in LOGGED:
        truth = getattr(expected, channel)
        scale = max(1.0, float(np.abs(truth).max()))
        assert_allclose(
            getattr(found, channel), truth, rtol=0.0, atol=1e-12 * scale, err_msg=channel
        )


def test_batch_of_baselines_is_their_single_runs() -> None:
    controllers = [_baseline(name, DIAGONAL, "full") for name in NAMES]
    plants = [ARM.with_payload(mass) for mass in np.linspace(0.1, 0.5, len(NAMES))]
    given = _experiment()
    batch = rbi.simulate_batch(controllers, plants, channels=("q", "tau"), **given)
    for i, (controller, plant) in enumerate(zip(controllers, plants, strict=True)):
        single = rbi.simulate(controller, plant, **given)
        assert_allclose(batch["q"][i], single.q, rtol=0.0, atol=1e-12)
        assert_allclose(
            batch["tau"][i], single.tau, rtol=0.0, atol=1e-12 * np.abs(single.tau).max()
        )
        assert_allclose(batch.metrics["e1_rms"][i], single.metrics()["e1_rms"], rtol=1e-9)


def test_baseline_with_torque_limits_keeps_them_by_its_readable_form() -> None:
    limited = baselines.PIDImpedance(ARM, DIAGONAL, 10.0, DT, limits=0.5)
    result = rbi.simulate(limited, ARM, **_experiment())
    assert np.abs(result.tau).max() <= 0.5
    assert result.saturated.any()


def test_state_that_is_not_finite_is_refused_with_its_name() -> None:
    controller = _baseline("PD", DIAGONAL, "full")

    def motion(t: float) -> rbi.Reference:
        still = rbi.Reference(ARM.neutral, np.zeros(ARM.nv), np.zeros(ARM.nv))
        return still if t < 0.05 else still._replace(v=np.full(ARM.nv, np.nan))

    with pytest.raises(rbi.NonFiniteError, match=r"reference\.v"):
        rbi.simulate(controller, ARM, motion, q0=ARM.neutral, duration=0.1)


class Weak(baselines.PDGravity):
    """A law of a user's own, which a formula of this library does not describe."""

    def _law(self, tick: Any, integral: Any = None) -> Any:
        answer, after = super()._law(tick, integral)
        return answer._replace(tau=0.0 * answer.tau), after


def test_a_subclass_runs_as_it_is_written() -> None:
    result = rbi.simulate(Weak(ARM, DIAGONAL, DT), ARM.copy(), cosine(ARM), duration=0.02)
    assert not result.tau.any()
