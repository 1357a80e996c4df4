"""MuJoCo models that other people wrote: what their contacts are, by their own numbers, and what they do."""
