"""The tables of the benchmark by their short names."""

from __future__ import annotations

from collections.abc import Callable

from .cost_tables import memory, start_up
from .loop_tables import batch, loop, paced
from .report import Section
from .setting import Setting
from .tick_tables import arms, laws, phases, scaling, tick

SECTIONS: dict[str, Callable[[Setting], Section]] = {
    "tick": tick,
    "phases": phases,
    "laws": laws,
    "arms": arms,
    "paced": paced,
    "loop": loop,
    "batch": batch,
    "scaling": scaling,
    "start-up": start_up,
    "memory": memory,
}
"""In the order of the report."""
