"""Who plays the episodes: processes of this machine, or the workers of a dask cluster."""

import signal
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing import get_context

from care_sim.errors import InvalidInput, MissingExtra

ExecutorFactory = Callable[[int], Executor]
"""Makes an executor of so many workers; any executor of `concurrent.futures` will do."""


def processes(workers: int) -> Executor:
    """Worker processes on this machine, forked from a clean server that has imported the simulator."""
    context = get_context("forkserver")
    context.set_forkserver_preload(["care_sim.study.episode", "care_sim.envs.closed_loop"])
    # An interrupt is the main process's to handle.
    return ProcessPoolExecutor(workers, context, signal.signal, (signal.SIGINT, signal.SIG_IGN))


def cluster(address: str) -> ExecutorFactory:
    """The workers behind a dask scheduler, which need this package too.

    Raises MissingExtra without dask, InvalidInput when nobody answers at `address`.
    """
    try:
        from dask.distributed import Client
    except ImportError as error:
        raise MissingExtra("a cluster needs the extra 'cluster': pip install 'care-sim[cluster]'") from error
    try:
        client = Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        raise InvalidInput(f"no dask scheduler answers at {address}; one looks like tcp://HOST:8786") from error
    return lambda _workers: client.get_executor(pure=False)
