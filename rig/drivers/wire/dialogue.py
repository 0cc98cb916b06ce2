"""The host's half of the commands: every request is repeated until it is answered."""

from collections import deque
from collections.abc import Callable

from rig.errors import DaqEmergencyStop, DaqError, DaqProtocol, DaqRefused, DaqTimeout, DaqWatchdog
from rig.wire.link import Link
from rig.wire.messages import (
    Answer,
    Command,
    DeviceFlag,
    DeviceState,
    Heartbeat,
    Parameter,
    Readback,
    Request,
    Rows,
    Samples,
    State,
    Status,
)
from rig.wire.parameter_words import NAME_WORDS, as_float, as_text


def latched_text(latched: DeviceFlag) -> str:
    """What has latched, in words; empty if nothing has."""
    names = {DeviceFlag.EMERGENCY_STOP: "emergency stop", DeviceFlag.WATCHDOG: "watchdog"}
    said = " and ".join(name for flag, name in names.items() if latched & flag)
    return f"the device's {said} had latched" if said else ""


def stopped(name: str, flags: int, text: str) -> DaqError:
    """The error for what has latched: the emergency stop goes before the watchdog. ``name`` is that of the port."""
    kind = DaqEmergencyStop if flags & DeviceFlag.EMERGENCY_STOP else DaqWatchdog
    return kind(f"{name}: {text}")


TRIES = 5  # requests before a device counts as silent; chosen
ANSWER_S = 0.1  # s that an answer may take; chosen
DOUBLED_ANSWERS = 8  # from this many on two devices answer; the wire itself may repeat a single frame
WAITING_BLOCKS = 4096  # messages that are kept while an answer is awaited; chosen: seconds of a stream
REMEMBERED_ANSWERS = 254  # all numbers but the next: a second device may answer long after the first


class Dialogue:
    """Sends requests over a link and waits for their answers; keeps the stream messages that arrive meanwhile.

    Errors: `DaqTimeout` for a device that has fallen silent, `DaqProtocol` where two devices answer, `DaqRefused` for a
    request that the device refuses, `DaqEmergencyStop` and `DaqWatchdog` if it refuses because one of these has latched.
    """

    def __init__(self, link: Link, clock: Callable[[], float]) -> None:
        self.link = link
        self.clock = clock
        self.early: deque[Samples | Rows | Readback | State | Heartbeat] = deque(maxlen=WAITING_BLOCKS)
        """Stream messages that arrived while an answer was awaited."""
        self.retries = 0
        self.stray_answers = 0
        self._doubled = 0
        self._answered: deque[tuple[Answer, int]] = deque(
            maxlen=REMEMBERED_ANSWERS
        )  # with the number of times each request was sent
        self._number = round(1e6 * clock()) % 255  # most likely not the number that the last host ended with

    def ask(
        self,
        command: Command,
        parameter: int = 0,
        item: int = 0,
        value: int = 0,
        tries: int = TRIES,
        answer_s: float = ANSWER_S,
    ) -> Answer:
        """The device's answer to a request, whatever its status; it is repeated after ``answer_s`` without one."""
        request = self.next_request(command, parameter, item, value)
        for sent in range(1, tries + 1):
            self.link.send(request)
            answer = self._answer_to(request, answer_s)
            if answer is not None:
                self._answered.append((answer, sent))
                return answer
            self.retries += 1
        raise DaqTimeout(
            f"{self.link.name}: no answer to {_said(command, parameter)} in {tries * answer_s:g} s"
            f"{self.damage()}; is the device switched on, and its cable in place?"
        )

    def next_request(self, command: Command, parameter: int = 0, item: int = 0, value: int = 0) -> Request:
        """A request with the next number."""
        self._number = self._number % 255 + 1
        return Request(self._number, command, parameter, item, value)

    def _answer_to(self, request: Request, answer_s: float) -> Answer | None:
        until = self.clock() + answer_s
        while (left := until - self.clock()) > 0.0:
            message = self.link.receive(left)
            if message is None:
                return None
            if isinstance(message, Answer):
                if message[0] == request.number and message[2:4] == request[2:4]:
                    return message
                self.note_stray(message)
            elif isinstance(message, Samples | Rows | Readback | State | Heartbeat):
                self.early.append(message)
        return None

    def forget_beats(self) -> None:
        """Drop the heartbeats that were kept; blocks stay."""
        kept = [message for message in self.early if not isinstance(message, Heartbeat)]
        self.early.clear()
        self.early.extend(kept)

    def forget(self) -> None:
        """Drop all messages received so far: heartbeats of an idle device, blocks meant for an earlier host."""
        for _ in range(WAITING_BLOCKS):
            if self.link.receive(0.0) is None:
                break
        self.early.clear()

    def beat_with(self, wanted: int, longest_s: float) -> int:
        """Wait for a heartbeat with any of the flags ``wanted``; return those it has, or 0 if none comes in time."""
        until = self.clock() + longest_s
        while (left := until - self.clock()) > 0.0:
            message = self.link.receive(left)
            if isinstance(message, Answer):
                self.note_stray(message)
            elif isinstance(message, Heartbeat) and message.flags & wanted:
                return message.flags & wanted
        return 0

    def note_stray(self, answer: Answer) -> None:
        """Count an answer that was not awaited; raise `DaqProtocol` once so many are doubled that two devices must answer."""
        self.stray_answers += 1
        known = next(
            (one for one in self._answered if (one[0].number, one[0][2:4]) == (answer.number, answer[2:4])), None
        )
        if known is None or known[1] > 1:  # one that was sent twice may be answered twice, with what has changed
            return
        if answer == known[0]:
            self._doubled += 1
            if self._doubled < DOUBLED_ANSWERS:
                return
        raise DaqProtocol(
            f"{self.link.name}: two devices answer as one; give each an address of its own, or unplug one of them"
        )

    def damage(self) -> str:
        """Damage that the link has counted, to be appended to an error; empty if there is none."""
        seen = [f"{count} {name.replace('_', ' ')}" for name, count in self.link.counters.items() if count]
        return f" ({', '.join(seen)})" if seen else ""

    def do(
        self, command: Command, parameter: int = 0, item: int = 0, value: int = 0, answer_s: float = ANSWER_S
    ) -> int:
        """Send a request and return the answer's value; raise `DaqRefused` if the device refuses it."""
        answer = self.ask(command, parameter, item, value, answer_s=answer_s)
        if answer.status == Status.LATCHED:
            raise stopped(self.link.name, answer.value, f"{_said(command, parameter, value)}: {why_not(answer)}")
        if answer.status != Status.DONE:
            raise DaqRefused(f"{self.link.name}: {_said(command, parameter, value)}: {why_not(answer)}")
        return answer.value

    def get(self, parameter: Parameter, item: int = 0, default: int | None = None) -> int:
        """A parameter's word; ``default`` where the device does not know it."""
        answer = self.ask(Command.GET, parameter, item)
        if answer.status == Status.UNKNOWN and default is not None:
            return default
        if answer.status != Status.DONE:
            raise DaqProtocol(
                f"{self.link.name}: the device does not tell its {parameter.name} (item {item}): {why_not(answer)}"
            )
        return answer.value

    def get_float(self, parameter: Parameter, item: int = 0) -> float:
        """A parameter that is a float32."""
        return as_float(self.get(parameter, item))

    def get_text(self, parameter: Parameter, channel: int = 0) -> str:
        """A text parameter, read word by word up to its end."""
        words: list[int] = []
        for item in range(NAME_WORDS * channel, NAME_WORDS * (channel + 1)):
            words.append(self.get(parameter, item, 0))
            if not all(words[-1].to_bytes(4, "little")):
                break
        return as_text(words)


def _said(command: Command, parameter: int, value: int | None = None) -> str:
    known = {int(one): one.name for one in Parameter}
    to = f" = {value}" if command is Command.SET and value is not None else ""
    return " ".join(filter(None, (command.name, known.get(parameter, "") if parameter else ""))) + to


def why_not(answer: Answer) -> str:
    """The reason in a status other than DONE, in words."""
    if answer.status == Status.NOT_ALLOWED:
        return f"not allowed, the nearest value is {answer.value}"
    if answer.status == Status.WRONG_STATE:
        names = {int(one): one.name.lower() for one in DeviceState}
        return f"the device is {names.get(answer.value, answer.value)}"
    if answer.status == Status.LATCHED:
        return "the device's watchdog or emergency stop has latched; release it first"
    return "the device does not know it" if answer.status == Status.UNKNOWN else f"status {answer.status}"
