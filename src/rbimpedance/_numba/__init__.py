"""How kernels are compiled, cached on disk and called from Python.

May use: `_common`. Numba is imported here and in the `compiled` packages only, and only when a kernel is needed.
"""

from __future__ import annotations

import functools
import logging

COMPILING = "compiling: on a new machine that takes up to a minute, later a second or two"


@functools.cache
def warn_once(sentence: str) -> None:
    """Log a warning about compiled code, unless the same has been logged before."""
    logging.getLogger("rbimpedance").warning(sentence)
