"""How fast it all is: `make bench`. A benchmark is a module with `cases(effort)`; one line registers it.

They are named, not imported: `python -m benchmarks --help` must not wait for what they need.
"""

from __future__ import annotations

# In the order in which they take their turns in a round, and in which they are told.
BENCHMARKS: dict[str, str] = {
    "roof": "benchmarks.roof",
    "listing": "benchmarks.listing",
    "ensemble": "benchmarks.ensemble",
    "octave": "benchmarks.octave",
    "engines": "benchmarks.engines",
    "landing": "benchmarks.landing",
    "pair": "benchmarks.pair",
    "skipping": "benchmarks.skipping",
    "cold": "benchmarks.cold",
    "jobs": "benchmarks.jobs",
}
