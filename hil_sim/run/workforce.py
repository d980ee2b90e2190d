"""Who does the work: this process, processes on this machine, or a Dask cluster."""

from __future__ import annotations

import importlib
import multiprocessing
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from typing import Any, TypeVar

from bms.errors import InputError
from bms.imports import left_out

T = TypeVar("T")
_CONNECT_TIMEOUT_S = 10.0


@dataclass(frozen=True)
class Workforce:
    """An executor, and how many pieces it should have at hand."""

    executor: Executor
    pieces_at_hand: int


class InlineExecutor(Executor):
    """Does each piece at once in the caller's own thread."""

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """The finished future of a call; an interrupt passes through."""
        future: Future[T] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


class WorkerPool(ProcessPoolExecutor):
    """Processes on this machine that leave Ctrl-C to their parent from their first moment on.

    Each is a new interpreter: a copy of this one could hold a lock of the progress bar.
    """

    def __init__(self, jobs: int) -> None:
        super().__init__(jobs, multiprocessing.get_context("spawn"), _load_python_can)
        resource_tracker.ensure_running()  # it would unblock the signal when it is started below

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """The future of a call; a process that is started for it inherits the blocked signal."""
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return super().submit(fn, *args, **kwargs)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _load_python_can() -> None:
    """As the command line does, which has started the process: without what it loads for MF4."""
    with left_out("asammdf"):
        importlib.import_module("can")


@contextmanager
def local_workforce(jobs: int) -> Iterator[Workforce]:
    """Processes on this machine; a single job runs in this one.

    Raises InputError when the system ends one of them.
    """
    if jobs == 1:
        yield Workforce(InlineExecutor(), 1)
        return
    with WorkerPool(jobs) as executor:
        try:
            yield Workforce(executor, 2 * jobs)
        except BrokenProcessPool:
            raise InputError(
                "a process of this command was ended by the system, perhaps for lack of memory; "
                "lower --jobs"
            ) from None


@contextmanager
def dask_workforce(address: str) -> Iterator[Workforce]:
    """Workers of a Dask cluster by the address of its scheduler, such as tcp://host:8786.

    The workers need this package. Raises InputError when Dask is not installed or nobody answers.
    """
    try:
        from distributed import Client  # noqa: PLC0415 (an optional extra)
    except ImportError:
        raise InputError(
            "--scheduler: dask.distributed is not installed; pip install 'kan-rcbf-bms[dask]'"
        ) from None
    make_client: Any = Client
    try:
        client = make_client(address, timeout=_CONNECT_TIMEOUT_S)
    except (OSError, ValueError) as error:
        raise InputError(
            f"--scheduler {address}: no scheduler answers ({' '.join(str(error).split())}); "
            "start 'dask scheduler' and 'dask worker' first"
        ) from None
    with client:
        threads = max(1, sum(client.nthreads().values()))
        with client.get_executor() as executor:
            yield Workforce(executor, 2 * threads)
