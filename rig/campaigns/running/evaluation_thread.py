"""Points are evaluated in a thread beside the loop, so that a long evaluation does not keep rows waiting.

A loop that waits for its points anyway has them evaluated where they are asked for: no thread has to be woken for it.
"""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import ParamSpec

from rig.campaigns.evaluation.point import Point

Arguments = ParamSpec("Arguments")
Points = list[Point[object]]


class EvaluationThread:
    """Evaluates points one after the other in its own thread, and returns them in the order of the requests.

    With ``beside = False`` it has no thread: a request returns once its points are evaluated.
    """

    def __init__(self, *, beside: bool = True) -> None:
        self._thread = ThreadPoolExecutor(1, "evaluation") if beside else None
        self._asked: deque[Future[Points]] = deque()

    def ask(self, step: Callable[Arguments, Points], *arguments: Arguments.args, **named: Arguments.kwargs) -> None:
        """Request an evaluation of ``arguments``, which must not be changed any more."""
        if self._thread is not None:
            self._asked.append(self._thread.submit(step, *arguments, **named))
            return
        found: Future[Points] = Future()
        try:
            found.set_result(step(*arguments, **named))
        except BaseException as error:  # as of a thread: raised where the points are taken
            found.set_exception(error)
        self._asked.append(found)

    def known(self, point: Point[object]) -> None:
        """Queue a point that needs no evaluation, behind those requested before."""
        self.ask(lambda: [point])

    def __bool__(self) -> bool:
        """Whether requested points have not been taken yet."""
        return bool(self._asked)

    def ready(self) -> bool:
        """Whether the next points are evaluated."""
        return bool(self._asked) and self._asked[0].done()

    def take(self) -> Points:
        """Wait for the next points and return them; raises what their evaluation raised."""
        return self._asked.popleft().result()

    def close(self) -> None:
        """End the thread after its present evaluation."""
        if self._thread is not None:
            self._thread.shutdown(cancel_futures=True)
