"""Contact of two boxes: one potential of their overlap, and the forces that follow from it."""
