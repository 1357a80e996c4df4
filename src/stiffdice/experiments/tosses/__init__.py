"""Measured tosses of a real cube, and the simulator beside them."""
