"""Threads of a fit: as many as the linear algebra has, which meanwhile keeps to one."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

from threadpoolctl import ThreadpoolController


@lru_cache(maxsize=1)
def _pools() -> Any:
    """Return the pools of the linear algebra; looking for them takes a millisecond."""
    return ThreadpoolController().select(user_api="blas")


def available_threads() -> int:
    """Return the number of threads of the linear algebra (``OMP_NUM_THREADS``, else one per core); 1 if it cannot be told."""
    return max((int(pool["num_threads"]) for pool in _pools().info()), default=1)


@contextmanager
def threads() -> Iterator[int]:
    """Yield the number of threads to use while the linear algebra keeps to one."""
    count = available_threads()
    with _pools().limit(limits=1):
        yield count
