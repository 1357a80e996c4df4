"""Which scheme and how many steps a scene needs for an error."""
