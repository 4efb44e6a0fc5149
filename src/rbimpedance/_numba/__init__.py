"""How kernels are compiled, cached on disk and called from Python.

May use: `_common`. Numba is imported here and in the `compiled` packages only, and only when a kernel is asked for.
"""
