"""Snakemake, looking at the queue every second: its plugin for Slurm waits ten seconds longer after each look."""

from __future__ import annotations

import asyncio
import sys

from snakemake.cli import main
from snakemake_interface_executor_plugins.executors.remote import RemoteExecutor


async def sleep(_: RemoteExecutor) -> None:
    """Wait until the next look."""
    await asyncio.sleep(1)


RemoteExecutor.sleep = sleep
main(sys.argv[1:])
