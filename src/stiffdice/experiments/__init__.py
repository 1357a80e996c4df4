"""Questions asked of the simulator itself, each of one kind of motion made for it."""
