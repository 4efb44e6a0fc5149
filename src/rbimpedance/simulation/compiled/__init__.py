"""The closed loop as Numba kernels: plant, environment, log, and the loop over a block of ticks."""
