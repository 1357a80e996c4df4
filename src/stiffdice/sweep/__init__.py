"""Sweeps: grid, partition into jobs, collection, stability limits."""
