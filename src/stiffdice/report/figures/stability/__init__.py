"""Figures of stability limits."""
