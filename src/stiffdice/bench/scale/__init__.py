"""How a sweep grows with its number of runs: real sweeps through the real workflow, measured by what they leave.

`workflow/million.py` is the command; docs/scale.md says what each number means.
"""
