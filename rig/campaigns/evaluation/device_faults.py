"""What late outputs and lost samples have to do with a point that failed, in words."""

from typing import NamedTuple

import numpy as np

from rig.tick.sequencer.repetition import LARGEST_CONTINUED, LARGEST_LOST

DISTURBED = "the settle rule was broken while recording"
TOO_LATE, LOST = "outputs came too late", "samples were lost in transmission"
REMEDY = "`rig doctor --daq` recommends a queue and block that are long enough"


class DeviceFaults(NamedTuple):
    """Samples with faults of the device among those of a record."""

    held: int = 0
    """With an output that was held."""
    continued: int = 0
    """With an output with which the device went on by itself."""
    lost: int = 0
    samples: int = 0
    """All samples."""

    @classmethod
    def of(cls, entry: np.void) -> "DeviceFaults":
        """Return those of an outcome of the sequencer."""
        held, continued, lost = (int(entry[name]) for name in ("held", "continued", "lost"))
        return cls(held, continued, lost, int(entry["end_sample"]) - int(entry["first_sample"]))

    def text(self, *, final: bool = True) -> str:
        """Return what the device says of the samples: how many outputs were held or continued, how many lost; empty if none.

        ``final``: the point is not measured again, so what helps is named.
        """
        late = [f"{name} in {count}" for name, count in (("held", self.held), ("continued", self.continued)) if count]
        told = [f"{TOO_LATE}: {' and '.join(late)} samples of {self.samples}"] if late else []
        told += [f"{self.lost} of {self.samples} {LOST}"] if self.lost else []
        return ", ".join([*told, REMEDY] if final and told else told)

    @property
    def spoil(self) -> bool:
        """Whether they alone explain that a record was disturbed: a held output, or too many continued or lost ones."""
        continued, lost = LARGEST_CONTINUED * self.samples, LARGEST_LOST * self.samples
        return self.held > 0 or self.continued > continued or self.lost > lost


def why_disturbed(faults: DeviceFaults, course: str = "", *, final: bool = True) -> str:
    """Return why the settle rule was broken in a record: the ``faults`` of the device if they explain it.

    ``course``: how far off phase and amplitude were, in brackets. ``final``: as of `DeviceFaults.text`.
    """
    said = faults.text(final=final)
    return said + course if faults.spoil else DISTURBED + course + (f"; {said}" if said else "")


def pages_on(reason: str) -> list[str]:
    """Return the pages on late outputs and lost samples that explain the reason why a point was not accepted."""
    return [page for text, page in ((TOO_LATE, "held-outputs"), (LOST, "samples-lost")) if text in reason]
