"""How far predictions are from what was measured, or computed by other means: one row per response or sweep."""

from collections.abc import Iterable
from dataclasses import dataclass

from identification.errors import IdentificationError
from identification.prediction.properties import FLAGGED_BEYOND

__all__ = ["PredictionError", "error_table"]


@dataclass(frozen=True)
class PredictionError:
    """Errors of one predicted response or sweep; every error is relative: predicted over reference, minus one.

    Parameters
    ----------
    name
        What was predicted.
    peak_error, peak_frequency_error
        Of the largest amplitude, and of the frequency at which it occurs.
    envelope_error
        RMS of the difference of the amplitudes over the common part of both, over the reference's largest amplitude.
    range_use
        Largest modal amplitude of the prediction over the largest that the model was identified with.
    notes
        What a user should know about this comparison, one line each.
    """

    name: str
    peak_error: float
    peak_frequency_error: float
    envelope_error: float
    range_use: float
    notes: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """Whether the model was asked about what it was identified with."""
        if self.range_use <= 1.0:
            return "inside the identified range"
        return "extrapolated" if self.range_use <= FLAGGED_BEYOND else "extrapolated far"

    def row(self) -> dict[str, float | str | list[str]]:
        """The errors by name, verdict included: ready for JSON."""
        return {
            "name": self.name,
            "peak_error": self.peak_error,
            "peak_frequency_error": self.peak_frequency_error,
            "envelope_error": self.envelope_error,
            "range_use": self.range_use,
            "verdict": self.verdict,
            "notes": list(self.notes),
        }


def error_table(errors: Iterable[PredictionError]) -> str:
    """Plain-text table, one line per prediction, errors in percent; raises `IdentificationError` if there are none."""
    rows = list(errors)
    if not rows:
        raise IdentificationError("errors: is empty, needs at least one comparison")
    width = max(len("prediction"), *(len(row.name) for row in rows))
    lines = [f"{'prediction':{width}}   peak %  frequency %  envelope %  range use  verdict"]
    for row in rows:
        lines.append(
            f"{row.name:{width}}  {100 * row.peak_error:+7.2f}  {100 * row.peak_frequency_error:+11.3f}  "
            f"{100 * row.envelope_error:10.2f}  {row.range_use:9.2f}  {row.verdict}"
        )
    return "\n".join(lines)
