"""Whether the numbers in a result can be true."""
