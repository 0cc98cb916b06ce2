"""Two devices behind one address, of which one is slower: a link that answers twice, without any wire."""

from collections import deque

import pytest

from rig.drivers.wire.dialogue import Dialogue
from rig.errors import DaqProtocol
from rig.wire.messages import Answer, Command, Request, Status
from tests.refused import refused


class Twice:
    """Answers at once, and again with another value after so many further requests."""

    name = "link"

    def __init__(self, behind: int, other: int) -> None:
        self.behind, self.other = behind, other
        self.counters: dict[str, int] = {}
        self.waiting: deque[Answer] = deque()
        self.late: deque[Answer] = deque()

    def send(self, request: Request) -> None:
        if len(self.late) == self.behind:
            self.waiting.append(self.late.popleft())
        answer = Answer(request.number, Status.DONE, request.parameter, request.item, 7)
        self.waiting.append(answer)
        self.late.append(answer._replace(value=self.other))

    def receive(self, timeout_s: float) -> Answer | None:
        return self.waiting.popleft() if self.waiting else None


def dialogue(behind: int, other: int) -> Dialogue:
    return Dialogue(Twice(behind, other), lambda: 0.0)  # type: ignore[arg-type]


def asked(host: Dialogue, count: int) -> list[int]:
    return [host.ask(Command.GET, 1, item).value for item in range(count)]


@pytest.mark.parametrize("behind", [1, 3, 10, 200])
def test_a_device_that_is_some_requests_behind_the_other_is_noticed(behind):
    host = dialogue(behind, other=8)
    with refused(DaqProtocol, "two-devices"):
        asked(host, behind + 2)


def test_answers_that_a_wire_repeats_now_and_then_are_no_second_device():
    host = dialogue(3, other=7)
    assert asked(host, 7) == [7] * 7
    assert host.stray_answers == 4


def test_a_late_answer_to_a_request_that_was_repeated_is_no_second_device():
    class Slow(Twice):
        """Answers to the first request once it is sent again, and then to both with what it reads meanwhile."""

        def send(self, request: Request) -> None:
            answer = Answer(request.number, Status.DONE, request.parameter, request.item, 7)
            self.late.append(answer)
            if len(self.late) == 2:
                self.waiting.extend((answer, answer._replace(value=8)))
            elif len(self.late) > 2:
                self.waiting.append(answer)

    host = Dialogue(Slow(0, 0), lambda: 0.0)  # type: ignore[arg-type]
    assert asked(host, 3) == [7] * 3
    assert host.stray_answers == host.retries == 1
