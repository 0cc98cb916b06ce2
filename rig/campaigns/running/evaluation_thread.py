"""Points are worked out beside the loop, so that no length of record keeps its rows waiting."""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from rig.campaigns.evaluation.point import Point

__all__ = ["EvaluationThread"]

Points = list[Point[Any]]


class EvaluationThread:
    """Evaluates points one after the other in a thread of its own, and returns them in the order of the requests."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, "evaluation")
        self._asked: deque[Future[Points]] = deque()

    def ask(self, step: Callable[..., Points], *arguments: Any) -> None:
        """Have points worked out from ``arguments``, which nobody may change any more."""
        self._asked.append(self._thread.submit(step, *arguments))

    def known(self, point: Point[Any]) -> None:
        """Put in a point that needs no evaluation, behind those asked for before."""
        self.ask(lambda: [point])

    def __bool__(self) -> bool:
        """Whether points are still to come."""
        return bool(self._asked)

    def ready(self) -> bool:
        """Whether the next points are worked out."""
        return bool(self._asked) and self._asked[0].done()

    def take(self) -> Points:
        """The next points, waited for; raises what their evaluation raised."""
        return self._asked.popleft().result()

    def close(self) -> None:
        """End the thread once it has done what it is at."""
        self._thread.shutdown(cancel_futures=True)
