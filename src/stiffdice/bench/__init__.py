"""How fast it all is: `stiffdice bench`. A benchmark is a module with `cases(effort)`; one line registers it.

They are named, not imported: `stiffdice bench --help` must not wait for what they need.
"""

from __future__ import annotations

# In the order in which they take their turns in a round, and in which they are told.
BENCHMARKS: dict[str, str] = {
    "roof": "stiffdice.bench.roof",
    "listing": "stiffdice.bench.listing",
    "swift": "stiffdice.bench.swift",
    "lanes": "stiffdice.bench.lanes",
    "octave": "stiffdice.bench.octave",
    "engines": "stiffdice.bench.engines",
    "skipping": "stiffdice.bench.skipping",
    "cold": "stiffdice.bench.cold",
    "jobs": "stiffdice.bench.jobs",
}
