"""What held outputs and lost samples have to do with a point that failed, in words."""

__all__ = ["DISTURBED", "faults_text", "pages_on", "why_disturbed"]

DISTURBED = "the settle rule was broken while recording"
TOO_LATE, LOST = "outputs came too late", "samples were lost on their way"
REMEDY = "`rig doctor --daq` recommends a queue and block that are long enough"
SPOILING_LOST = 0.05  # of the samples; with fewer lost the detector goes on undisturbed


def faults_text(held: int, lost: int, samples: int, *, final: bool = True) -> str:
    """Return what the device says of ``samples`` samples: how many outputs were held, how many were lost; empty if none.

    ``final``: the point is not measured again, so what helps is named.
    """
    told = [f"{TOO_LATE}: held in {held} samples of {samples}"] if held else []
    told += [f"{lost} of {samples} {LOST}"] if lost else []
    return ", ".join([*told, REMEDY] if final and told else told)


def why_disturbed(held: int, lost: int, samples: int, course: str = "", *, final: bool = True) -> str:
    """Return why the settle rule was broken while ``samples`` samples were recorded.

    A held output, or more than 5 % of lost samples, is the reason; without them there is no other than the rule itself.
    ``course``: how far off phase and amplitude were, in brackets. ``final``: as of `faults_text`.
    """
    said = faults_text(held, lost, samples, final=final)
    if held or lost > SPOILING_LOST * samples:
        return said + course
    return DISTURBED + course + (f"; {said}" if said else "")


def pages_on(reason: str) -> list[str]:
    """Return the pages on held outputs and lost samples that explain the reason why a point was not accepted."""
    return [page for text, page in ((TOO_LATE, "held-outputs"), (LOST, "samples-lost")) if text in reason]
