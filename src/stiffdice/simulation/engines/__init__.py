"""Other integrators and physics engines on our scenes: one adapter per module."""
