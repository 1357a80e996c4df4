"""Questions of two cubes that meet."""
