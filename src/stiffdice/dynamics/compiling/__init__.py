"""Numba: what it compiles, in which processes, and where that is kept."""
