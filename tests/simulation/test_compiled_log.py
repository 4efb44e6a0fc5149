"""The log of compiled runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rbimpedance.control.telemetry import CHANNELS
from rbimpedance.simulation.compiled.log import journal

LOGGED = [channel for channel in CHANNELS if channel.source != "derived" and channel.name != "t"]


def _arrays(written: Any) -> list[Any]:
    """All arrays of nested tuples."""
    if isinstance(written, np.ndarray):
        return [written]
    return [array for entry in written for array in _arrays(entry)]


@pytest.mark.parametrize("channel", LOGGED, ids=lambda channel: str(channel.name))
def test_every_channel_that_the_loop_logs_has_a_compiled_writer(channel: Any) -> None:
    samples = channel.empty(3, 2, 2)
    assert any(
        np.shares_memory(samples, each) for each in _arrays(tuple(journal({channel.name: samples})))
    ), (
        f"compiled runs would leave '{channel.name}' unwritten: give it a place in simulation/compiled/log.py"
    )
