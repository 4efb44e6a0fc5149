"""What docs/hardware-limits.md measures besides tables of laws: compiled runs, a second engine, the impedance shown."""

from __future__ import annotations

import numpy as np
import pytest

import rbimpedance as rbi
from benchmarks.control.hardware import interaction
from benchmarks.control.hardware.cases import USUAL, Case, evaluated, simulated
from benchmarks.control.hardware.linear_compiled import LinearRuns
from benchmarks.control.hardware.linear_laws import LAWS

SETTINGS = [(30.0, 100.0), (20.0, 80.0), (15.0, 60.0, 12.0), (40.0, 40.0)]


@pytest.mark.slow
@pytest.mark.parametrize(("label", "at"), list(zip(LAWS, SETTINGS, strict=True)))
def test_compiled_run_of_a_linear_law_is_that_of_simulate(
    label: str, at: tuple[float, ...]
) -> None:
    case, law, hardware = Case("kinova"), LAWS[label], rbi.Hardware(encoder_bits=19, **USUAL)
    controller = law.build(case.model(), hardware, at)
    alone = simulated(case, controller, hardware, case.motion(), length=0.6)
    runs = LinearRuns(case, hardware, 0.6)
    assert np.array_equal(runs.t, alone.t)
    for name, found in runs.run(law, at)._asdict().items():
        np.testing.assert_allclose(found, getattr(alone, name), rtol=1e-9, atol=1e-10)


@pytest.mark.slow
def test_run_that_is_lost_is_no_candidate() -> None:
    case, law = Case("z1"), LAWS["computed torque + integral, differences"]
    hardware = rbi.Hardware(encoder_bits=19, **USUAL)
    runs = LinearRuns(case, hardware, 2.5)
    found = evaluated(case.plant(), runs.t, *runs.run(law, (1000.0, 1e4)))
    assert found == {"error": np.inf, "variation": np.inf}


@pytest.mark.slow
def test_impedance_on_usual_hardware_is_the_target_within_a_tenth() -> None:
    for found in interaction.shown().values():
        assert max(found.values()) < 0.1


@pytest.mark.slow
def test_contact_with_a_stiff_wall_on_usual_hardware_does_not_bounce() -> None:
    rows = interaction.touched()
    alone = rows.pop("the target alone")
    assert alone["contacts"] == 1
    for found in rows.values():
        assert found["contacts"] == 1
        assert found["peak"] == pytest.approx(alone["peak"], rel=0.1)
        assert found["steady"] == pytest.approx(alone["steady"], rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_mujoco_as_the_plant_gives_the_same_error_and_variation(name: str) -> None:
    pytest.importorskip("mujoco")
    from benchmarks.control.hardware.engines import on_both  # noqa: PLC0415 (needs MuJoCo)

    found = on_both(name)
    for figure in ("error", "variation"):
        assert found["MuJoCo"][figure] == pytest.approx(found["Pinocchio"][figure], rel=0.15)
