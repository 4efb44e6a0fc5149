"""The log of compiled runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rbimpedance.control.compiled import block, hardware_tables
from rbimpedance.control.telemetry import CHANNELS
from rbimpedance.simulation.closed_loop import empty_channels
from rbimpedance.simulation.compiled.driven import driven_log
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


@pytest.mark.parametrize("channel", LOGGED, ids=lambda channel: str(channel.name))
def test_every_channel_that_is_no_flag_has_a_compiled_writer_for_runs_on_hardware(
    channel: Any,
) -> None:
    channels = empty_channels(3, 2, 2)
    written = _arrays(tuple(driven_log(channels)))
    assert channel.is_flag or any(each is channels[channel.name] for each in written)


def test_a_tick_on_hardware_has_the_rows_that_a_block_has_as_columns() -> None:
    rows = [getattr(hardware_tables, f"OUT_{name.upper()}") for name in block.OUTPUT]
    columns = [getattr(block, name.upper()) for name in block.OUTPUT]
    assert rows == columns == list(range(len(block.OUTPUT)))
