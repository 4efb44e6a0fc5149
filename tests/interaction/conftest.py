from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import rbimpedance as rbi

from .. import arms


@pytest.fixture(scope="module")
def arm() -> rbi.ArmModel:
    return arms.spinner()


@pytest.fixture
def q(arm: rbi.ArmModel, rng: np.random.Generator) -> NDArray[np.float64]:
    return arm.random_configuration(rng)
