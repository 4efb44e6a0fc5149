"""The tick as Numba kernels: what is packed, the kernels, and which of them a controller calls."""
