"""Recursive dynamics as Numba kernels, over tables that are read out of the Pinocchio model and verified against it."""
