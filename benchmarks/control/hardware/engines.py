"""The same hardware, proposal and motion with the links moved by Pinocchio and by MuJoCo."""

from __future__ import annotations

from functools import partial
from typing import Any

import rbimpedance as rbi

from .cases import USUAL, Case, ours, run
from .linear_laws import TARGET

ENGINES: dict[str, Any] = {
    "Pinocchio": lambda arm: arm,
    "MuJoCo": partial(rbi.MujocoPlant, limits=False),
}
"""Dry friction sticks in both; at rest it does not rise in MuJoCo's, so it does not in either here."""


def on_both(name: str) -> dict[str, Any]:
    """Error and torque variation of our proposal on 19 bits, by engine."""
    case, hardware = Case(name), rbi.Hardware(encoder_bits=19, **(USUAL | {"stribeck": 0.0}))
    law = rbi.QuantizedEncoders.for_(hardware, ours(case, hardware).controller(TARGET))
    return {
        word: run(case, law, hardware, case.motion(), engine=engine)
        for word, engine in ENGINES.items()
    }
