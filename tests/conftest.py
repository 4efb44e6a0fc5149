from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import settings

mpl.use("Agg")  # no display in a test run

# Same examples on every run, and no verdict that depends on the machine's speed.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(9263699)
