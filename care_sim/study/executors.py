"""Executors of tasks: processes of this machine, or the workers of a dask cluster.

`care_sim.study.runner` handles the tasks of a dead worker.
"""

import asyncio
import logging
from collections.abc import Callable, Iterator
from concurrent.futures import (
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context
from multiprocessing.context import BaseContext
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from care_sim.base.errors import InvalidInput, one_line
from care_sim.base.extras import missing_extra
from care_sim.base.limits import check_workers
from care_sim.base.processes import end_group_with_work, end_with_parent, starting

if TYPE_CHECKING:
    from dask.distributed import Client

_ANSWER_TIMEOUT_S = 10.0
"""Time limit for a scheduler's answer."""
P = ParamSpec("P")
T = TypeVar("T")

ExecutorFactory = Callable[[int], Executor]
"""Makes an executor with this many workers; any executor of `concurrent.futures` will do."""


class ClusterLost(OSError):
    """The scheduler of a cluster is gone in mid-run."""


def processes(workers: int) -> Executor:
    """Return worker processes on this machine, forked from a clean server that has imported the
    simulator. They and the server end with this process. Raises LimitReached if too few can be
    started.
    """
    check_workers(workers)
    # A fork of this process would carry its threads' locks along, and a spawned one would import
    # everything again. The fork server imports once and has no threads.
    context = get_context("forkserver")
    context.set_forkserver_preload(
        [
            "care_sim.study.episode_play",
            "care_sim.envs.closed_loop",
            "care_sim.world.lane_driver",
            "care_sim.study.scene_play",
            "scipy.optimize",
            "scipy.spatial.transform",
        ]
    )
    return Processes(workers, context)


def cluster(address: str) -> ExecutorFactory:
    """Return the workers behind a dask scheduler, which also need this package. The scheduler
    decides their number.

    Raises MissingExtra without dask, InvalidInput when nobody answers at `address`.
    """
    _connect(address).close()
    return lambda _workers: ClusterExecutor(_connect(address))


def parallel_batches(executor: Executor, workers: int) -> int:
    """Return the number of parallel batches: `workers`, or the current threads of a cluster."""
    return executor.threads() if isinstance(executor, ClusterExecutor) else workers


class Processes(ProcessPoolExecutor):
    """A pool of processes that leave interrupts to this one and end with it, or after their last
    task, whatever threads and processes a policy has started.
    """

    def __init__(self, workers: int, context: BaseContext):
        # Imported here because the room of policies loads SciPy and Numba, and options of commands
        # name the number of workers.
        from care_sim.policies.isolation import are_isolated

        with starting():
            super().__init__(workers, context, _begin, (are_isolated(),))

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Submit a call."""
        with starting():
            return super().submit(fn, *args, **kwargs)

    def end_at_once(self) -> None:
        """End the processes at once, for work of which no part is kept."""
        for process in list(self._processes.values()):
            process.kill()


def _begin(isolates: bool) -> None:
    """Prepare a worker process, which `isolates` foreign policies as its starter does."""
    end_with_parent()
    end_group_with_work()
    if isolates:
        from care_sim.policies.isolation import isolate_policies

        isolate_policies()


class ClusterExecutor(Executor):
    """Dask's own executor, with the errors of `concurrent.futures`.

    Dask runs the tasks of a killed worker again elsewhere. A task whose workers keep dying ends in
    BrokenExecutor; when the scheduler is gone, all end in ClusterLost.
    """

    def __init__(self, client: "Client"):
        self._client = client
        self._address: str = client.scheduler.address
        self._executor = client.get_executor(pure=False)

    def threads(self) -> int:
        """Threads of all workers that are connected now. Raises ClusterLost."""
        with self._lost_on_error():
            return sum(self._client.nthreads().values())

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Submit a call. Raises ClusterLost."""
        ours: Future[T] = Future()
        with self._lost_on_error():
            self._executor.submit(fn, *args, **kwargs).add_done_callback(
                partial(self._hand_on, ours)
            )
        return ours

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave the cluster; what has not ended is cancelled."""
        self._client.close()

    @contextmanager
    def _lost_on_error(self) -> Iterator[None]:
        """Turn any error of a client without its scheduler into ClusterLost."""
        try:
            yield
        except Exception as error:
            raise self._lost() from error

    def _hand_on(self, ours: Future[Any], theirs: Future[Any]) -> None:
        # Dask cancels what a client waits for when its scheduler is gone.
        error = self._lost() if theirs.cancelled() else theirs.exception()
        if error is None:
            ours.set_result(theirs.result())
        else:
            from dask.distributed import KilledWorker

            died = isinstance(error, KilledWorker)
            ours.set_exception(BrokenExecutor(str(error)) if died else error)

    def _lost(self) -> ClusterLost:
        return ClusterLost(
            f"the dask scheduler at {self._address} is gone; "
            "what is finished is kept, the same command goes on from there"
        )


def _connect(address: str) -> "Client":
    try:
        from dask.distributed import Client
    except ImportError as error:
        raise missing_extra("a cluster", "cluster", error) from error
    # They print tracebacks of the trouble that is reported in one line below.
    for logger in ("distributed", "distributed.client"):
        logging.getLogger(logger).setLevel(logging.CRITICAL)
    try:
        # In a thread of its own: a caller that is itself asynchronous has a running loop in this
        # one.
        with ThreadPoolExecutor(1) as aside:
            aside.submit(asyncio.run, _try_connection(address)).result()
        return Client(address, timeout=_ANSWER_TIMEOUT_S)
    except (
        Exception
    ) as error:  # of each protocol its own, those of libraries that are not there among them
        told = one_line(str(address))
        raise InvalidInput(
            f"no dask scheduler answers at {told}; one looks like tcp://HOST:8786"
        ) from error


async def _try_connection(address: str) -> None:
    """Raise connection errors before there is a client: a failed client leaves a thread that cannot
    be ended.
    """
    from dask.distributed import Security
    from distributed.comm import connect

    comm = await connect(
        address, timeout=_ANSWER_TIMEOUT_S, **Security().get_connection_args("client")
    )
    await comm.close()
