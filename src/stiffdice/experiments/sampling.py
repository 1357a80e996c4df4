"""Where runs are at given times, to compare them."""

from __future__ import annotations

import numpy as np

from stiffdice.dynamics.state import STATE, States
from stiffdice.errors import InputError
from stiffdice.simulation.run import Run


def states_of(run: Run, parts: int) -> States:
    """Return the states of a run at the launch and after equal parts of the duration, shape (parts + 1,).

    Those after the run's end are not-a-number. Raises InputError for a run that has no states at these times.
    """
    found = run.trajectory
    if found is None or run.steps % parts or (len(found.step) > 1 and run.steps // parts % found.step[1]):
        raise InputError(f"run: has no states after {parts} equal parts of the duration")
    states = np.full(parts + 1, np.nan, STATE)
    known = found.state[found.step % (run.steps // parts) == 0]
    states[: len(known)] = known
    return states
