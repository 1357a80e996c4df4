"""Accuracy against cost, by scheme and solver."""
