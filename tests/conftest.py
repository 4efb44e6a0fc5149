from __future__ import annotations

import logging

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import settings

from rbimpedance._numba import COMPILING

# Tests read what a command says; on a new machine this would be among it.
logging.getLogger("rbimpedance").addFilter(lambda record: record.msg != COMPILING)

mpl.use("Agg")  # no display in a test run

# Same examples on every run, and no verdict that depends on the machine's speed.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="all tests, those marked slow among them")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--slow"):
        return
    slow = [item for item in items if item.get_closest_marker("slow")]
    config.hook.pytest_deselected(items=slow)
    items[:] = [item for item in items if not item.get_closest_marker("slow")]


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(9263699)
