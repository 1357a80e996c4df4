"""What counts as stable: one criterion per module."""
