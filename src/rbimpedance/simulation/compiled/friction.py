"""The impulses of dry friction, compiled."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from numba import types

from ..._numba.compile import kernel
from ...robot.compiled.dynamics import OWN_MATRIX, OWN_VECTOR
from ..plants.dry_friction import rub


@functools.cache
def rub_kernel() -> Callable[..., Any]:
    """Compile `rub`, or load it from the disk."""
    vectors = (OWN_VECTOR,) * 3
    return kernel(rub, (OWN_VECTOR, OWN_MATRIX, *vectors, types.float64, types.int64))
