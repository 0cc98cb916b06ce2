"""Processes that begin as copies of this one: they have loaded what it has loaded, and need nothing sent but numbers.

Linux only. A process that is forked while other threads run must not need a lock that one of them holds: what is called here
computes, and neither prints nor writes.
"""

import ctypes
import multiprocessing
import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from typing import TypeVar, cast

from vibrolock.one_thread import one_thread

Item = TypeVar("Item")
Result = TypeVar("Result")

AVAILABLE = sys.platform == "linux"
"""Whether this system has such processes."""
_DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG of <sys/prctl.h>
_function: Callable[..., object] | None = None
"""What a forked process computes."""


def forked(function: Callable[[Item], Result], items: Sequence[Item], processes: int) -> Iterator[Result]:
    """Yield ``function(item)`` of every item in their order, computed in forked processes; raises what ``function`` raises.

    ``function`` is not sent; items and results are. If the iterator is closed early, items that have not begun are dropped, and
    those that have begun are ended.
    """
    pool = ProcessPoolExecutor(
        min(processes, len(items)) or 1, multiprocessing.get_context("fork"), _begin, (function, os.getpid())
    )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of a fork beside other threads
            futures = [cast("Future[Result]", pool.submit(_call, item)) for item in items]
        futures.reverse()
        while futures:
            yield futures.pop().result()
    except BaseException:  # nobody waits for what is under way
        for process in [*pool._processes.values()]:  # all: one that dies may leave a lock taken for which another waits
            process.kill()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _begin(function: Callable[..., object], parent: int) -> None:
    """Make a forked process one that its parent alone ends, and that uses one thread."""
    global _function
    _function = function
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_DFL)
    ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, ctypes.c_ulong(signal.SIGKILL), *[ctypes.c_ulong(0)] * 3)
    if os.getppid() != parent:  # it ended before
        os._exit(1)
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    one_thread().__enter__()


def _call(item: Item) -> object:
    assert _function is not None
    return _function(item)
