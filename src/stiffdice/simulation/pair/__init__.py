"""A run of two boxes: its loop, its energies, its verdict, its file."""
