"""Compiled kernels (numba): routes, drawing onto grids, lines of sight."""
