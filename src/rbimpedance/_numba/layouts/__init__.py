"""Arguments and results of kernels by the memory layouts of CPython and NumPy, for which Numba takes a microsecond.

docs/how-a-tick-runs.md has what each file saves. `check` compares the layouts with the running interpreter before
anything relies on them; where they differ, NumPy computes the ticks.
"""
