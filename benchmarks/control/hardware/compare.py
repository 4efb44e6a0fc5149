"""What each law makes of usual hardware.

    python -m benchmarks.control.hardware.compare [--arms panda ...] [--only laws] [--bits 17 19 24]

Writes docs/figures/hardware_laws.json, two figures, and the tables about it in docs/hardware-limits.md. Every linear
law is tuned per arm and encoder in some 50 runs for the least error at no more than twice the torque variation of
perfect sensing; ours is what `propose_gains` proposes. `--only` measures some parts, `--bits` tunes the linear laws for
these encoders.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import rbimpedance as rbi
from benchmarks import pages
from benchmarks.arms import ARMS
from benchmarks.progress import bar

from . import compare_figures, compare_page
from .cases import (
    BITS,
    CAP,
    COULOMB,
    SHORT,
    USUAL,
    Case,
    evaluated,
    needed,
    our_run,
    ours,
    run,
    simulated,
)
from .engines import on_both
from .interaction import shown, touched
from .linear_compiled import LinearRuns
from .linear_laws import FINER, LAWS, TARGET, Law, Settings, around

ROTORS = (0.1, 0.5)
SPRINGS: dict[str, Any] = {
    "joint_stiffness": 1e4,
    "torque_sensor": 0.02,
    "torque_bandwidth": 600.0,
    "torque_lag": 3e-4,
    "encoder_side": "link",
}
"""What is different on elastic joints: the lag is that of the current loop inside the torque loop."""

RANGES: dict[str, dict[str, Any]] = {
    "lag 1 ms": {"torque_lag": 1e-3},
    "lag 3 ms, 2 ticks": {"torque_lag": 3e-3, "delay": 2},
    "lag 5 ms, 4 ticks": {"torque_lag": 5e-3, "delay": 4},
    "16 bits": {"encoder_bits": 16},
    "18 bits": {"encoder_bits": 18},
    "20 bits": {"encoder_bits": 20},
    "22 bits": {"encoder_bits": 22},
    "no ripple": {"ripple": 0.0},
    "ripple 5 %": {"ripple": 0.05},
    "no friction": {"coulomb": 0.0},
    "friction 5 N·m": {"coulomb": 5.0},
    "friction 10 N·m": {"coulomb": 10.0},
}
"""Changes of the usual hardware with 19 bits, one at a time."""
MAP_BITS, MAP_LAGS = (16, 18, 20, 22, 24), (1e-3, 2e-3, 3e-3, 5e-3)  # s
DRAWN = "panda"
"""The arm of the figures, of the impedance that is shown, and of the wall."""
PARTS = ("ours", "standing", "laws", "springs", "ranges", "map", "engines", "impedance")


def tuned(runs: LinearRuns, law: Law, cap: float) -> dict[str, Any]:
    """The settings with the least error among the quiet ones, or the quietest: of a grid, then around the best of it.

    Args:
        runs: Arm and hardware.
        law: The law.
        cap: Largest torque variation of a quiet one [N·m/s].
    """
    found = list[dict[str, Any]]()

    def measured(at: Settings) -> dict[str, Any]:
        log = runs.run(law, at)
        return evaluated(runs.engine.arm, runs.t, *log) | {"settings": at}

    def best() -> dict[str, Any]:
        quiet = [each for each in found if each["variation"] <= cap]
        if quiet:
            return min(quiet, key=lambda each: each["error"])
        return min(found, key=lambda each: each["variation"])

    found += [measured(at) for at in law.grid]
    for factor in FINER:
        found += [measured(at) for at in around(best()["settings"], factor)]
    return best()


def laws(name: str, bits: int, need: float, said: Callable[[], None]) -> dict[str, Any]:
    """Every law on one arm with one encoder."""
    case, hardware = Case(name), rbi.Hardware(encoder_bits=bits, **USUAL)
    found: dict[str, Any] = {}
    usual = rbi.QuantizedEncoders.for_(hardware, rbi.ImpedanceController(case.model(), TARGET))
    found["default, differences"] = run(case, usual, hardware, case.motion())
    runs = LinearRuns(case, hardware)
    for label, law in LAWS.items():
        found[label] = tuned(runs, law, CAP * need)
        said()
    return found


def ranges(name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Ours over the range of usual hardware."""
    for label, changes in RANGES.items():
        case = Case(name, changes.get("coulomb", COULOMB))
        more = {key: value for key, value in changes.items() if key != "coulomb"}
        hardware = rbi.Hardware(**({"encoder_bits": 19, **USUAL} | more))
        yield label, our_run(case, hardware) | {"need": needed(case, float(hardware.ripple))}


def springs(name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Ours on springs of 1e4 N·m/rad with an inner torque loop; short runs, since they are made in Python."""
    for rotor in ROTORS:
        case = Case(name, rotor=rotor)
        hardware = rbi.Hardware(**({"encoder_bits": 19, **USUAL} | SPRINGS))
        need = needed(case, USUAL["ripple"], SHORT)
        yield str(rotor), our_run(case, hardware, SHORT) | {"need": need}


def error_map(name: str) -> dict[str, Any]:
    """Ours over bits and lag; infinite where it is refused."""
    case = Case(name)
    errors = [
        [
            our_run(case, rbi.Hardware(**(USUAL | {"encoder_bits": b, "torque_lag": lag}))).get(
                "error", np.inf
            )
            for lag in MAP_LAGS
        ]
        for b in MAP_BITS
    ]
    return {"bits": MAP_BITS, "lags": MAP_LAGS, "errors": errors}


def before_and_after(name: str) -> dict[str, rbi.SimulationResult]:
    """Runs on 19 bits: the default law on differences, and ours."""
    case, hardware = Case(name), rbi.Hardware(encoder_bits=19, **USUAL)
    laws: dict[str, Any] = {
        "default, differences": rbi.ImpedanceController(case.model(), TARGET),
        "ours": ours(case, hardware).controller(TARGET),
    }
    return {
        label: simulated(case, rbi.QuantizedEncoders.for_(hardware, law), hardware, case.motion())
        for label, law in laws.items()
    }


def standing(name: str) -> dict[str, Any]:
    """At rest on 17 bits, with friction that rises by half and not by the fifth that the gains were made for."""
    case, hardware = Case(name), rbi.Hardware(**({"encoder_bits": 17, **USUAL}))
    law = rbi.QuantizedEncoders.for_(hardware, ours(case, hardware).controller(TARGET))
    return run(case, law, hardware.but(stribeck=0.5), case.still(), None)


def one_arm(
    name: str, bits: Sequence[int], parts: set[str], said: Callable[[], None]
) -> dict[str, Any]:
    """Everything of one arm."""
    found: dict[str, Any] = {"need": needed(Case(name), USUAL["ripple"])}
    if "ours" in parts:
        found["ours"] = {
            str(b): our_run(Case(name), rbi.Hardware(encoder_bits=b, **USUAL)) for b in BITS
        }
    if "standing" in parts:
        found["standing"] = standing(name)
    if "laws" in parts:
        found["laws"] = {str(b): laws(name, b, found["need"], said) for b in bits}
    if "springs" in parts:
        found["springs"] = dict(springs(name))
    if "ranges" in parts:
        found["ranges"] = dict(ranges(name))
    if "map" in parts:
        found["map"] = error_map(name)
    if "engines" in parts:
        found["engines"] = on_both(name)
    if "impedance" in parts and name == DRAWN:
        found |= {"impedance": shown(), "wall": touched()}
    return found


def main() -> None:
    """Measure, write, tabulate."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--arms", nargs="*", choices=ARMS, default=list(ARMS))
    parser.add_argument("--bits", nargs="*", type=int, default=[*BITS], help="of the linear laws")
    parser.add_argument("--only", nargs="*", choices=PARTS, default=list(PARTS))
    parser.add_argument("--out", type=Path, default=pages.FIGURES)
    parser.add_argument("--docs", type=Path, default=pages.DOCS, help="folder of the page")
    parser.add_argument("--draw", action="store_true", help="only tabulate what is there")
    asked = parser.parse_args()
    logging.getLogger("rbimpedance").setLevel(logging.ERROR)
    path = asked.out / "hardware_laws.json"
    rows = json.loads(path.read_text("utf-8")) if path.exists() else {}
    searches = len(asked.bits) * len(LAWS)
    if not asked.draw:
        with bar() as progress:
            task = progress.add_task("searches", total=searches * len(asked.arms))
            for name in asked.arms:
                found = one_arm(name, asked.bits, set(asked.only), lambda: progress.advance(task))
                before = rows.get(name, {})
                rows[name] = before | pages.plain(found)
                if "laws" in found:  # those of other encoders stay
                    rows[name]["laws"] = before.get("laws", {}) | pages.plain(found["laws"])
                rows = {each: rows[each] for each in ARMS if each in rows}
                path.write_text(json.dumps(rows, indent=1) + "\n", "utf-8")
    if not asked.draw and "map" in asked.only and DRAWN in asked.arms:
        compare_figures.draw_map(DRAWN, rows[DRAWN]["map"], asked.out)
        compare_figures.draw_noise(before_and_after(DRAWN), asked.out)
    pages.rewrite(asked.docs / "hardware-limits.md", compare_page.tables(rows))


if __name__ == "__main__":
    main()
