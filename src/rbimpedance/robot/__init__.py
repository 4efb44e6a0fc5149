"""The arm: loading any description, its checked model, its dynamics.

May use: `_common`, `_numba` and Pinocchio.
"""
