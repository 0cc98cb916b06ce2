"""Linear algebra in one thread. Threads that share small matrices wait for each other, for long where other programs run."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController


@contextmanager
def one_thread() -> Iterator[None]:
    """Let numpy, and scipy if it is loaded, use one thread each for linear algebra. As a decorator: while the function runs."""
    with _libraries("scipy.linalg" in sys.modules).limit(limits=1, user_api="blas"):
        yield


@cache
def _libraries(with_scipy: bool) -> ThreadpoolController:
    return ThreadpoolController()
