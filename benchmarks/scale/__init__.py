"""How a sweep grows with its number of runs: real sweeps through the real workflow, measured by what they leave.

`python -m benchmarks.scale` is the command; docs/explanation/scale.md says what each number means.
"""
