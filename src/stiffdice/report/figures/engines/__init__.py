"""Figures that compare engines."""
