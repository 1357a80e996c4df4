"""Figures of two cubes that meet."""
