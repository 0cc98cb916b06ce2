"""A device's parameters: what it tells, and what may be set to what."""

from rig.emulator.description import SETTINGS, Words
from rig.emulator.faults import Faults
from rig.wire.messages import Parameter, Status
from rig.wire.parameter_words import NAME_WORDS, text_words

__all__ = ["Parameters"]


class Parameters:
    """The words of a device, as it tells them: with the lies of ``faults``."""

    def __init__(self, words: Words, faults: Faults) -> None:
        self.words = dict(words)
        if faults.version is not None:
            for parameter in (Parameter.LOWEST_VERSION, Parameter.HIGHEST_VERSION):
                self.words[parameter, 0] = faults.version
        for channel, name in enumerate(faults.channel_names or ()):
            for number, word in enumerate(text_words(name)):
                self.words[Parameter.CHANNEL_NAME, NAME_WORDS * channel + number] = word

    def value(self, parameter: Parameter) -> int:
        """The value of a parameter in force."""
        return self.words[parameter, 0]

    def get(self, parameter: int, item: int) -> tuple[Status, int]:
        """Answer to GET."""
        if parameter == Parameter.PING:
            return Status.DONE, 0
        word = self.words.get((parameter, item))
        return (Status.UNKNOWN, 0) if word is None else (Status.DONE, word)

    def set(self, parameter: int, item: int, value: int) -> tuple[Status, int]:
        """Answer to SET, carried out where the value is allowed."""
        bounds = {int(one): both for one, both in SETTINGS.items()}.get(parameter)
        if bounds is None or item:
            return Status.UNKNOWN, 0
        lowest = self.value(bounds[0]) if bounds[0] else int(parameter != Parameter.RAMP_US)
        nearest = min(max(value, lowest), self.value(bounds[1]))
        if nearest != value:
            return Status.NOT_ALLOWED, nearest
        self.words[parameter, 0] = value
        return Status.DONE, value
