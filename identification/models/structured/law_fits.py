"""Fits among which a law is chosen: regressions, short fits and full ones of one element."""

from collections.abc import Sequence

from identification.models.structured.candidates import Candidate
from identification.models.structured.element_trials import Scores
from identification.models.structured.model import StructuredModel
from identification.models.structured.progress import FitWatch
from identification.models.structured.stages import ElementFits, Fitted
from identification.models.structured.start import Start


class ModelFits:
    """Fits of models with one element, of which ``watch`` is told (`identification.models.structured.law_choice.LawFits`)."""

    def __init__(self, fits: ElementFits, between: tuple[str, ...], watch: FitWatch) -> None:
        self._fits, self._between, self._watch = fits, between, watch
        self._screening = fits.screening()

    def regressed(self, candidate: Candidate) -> list[Start]:
        """Return starts, the one with the least residual first."""
        return self._fits.starts(candidate.laws, self._between, candidate.held)

    def screened(self, candidate: Candidate, starts: Sequence[StructuredModel]) -> float:
        """Return the error of a short fit from the start whose simulation errs least."""
        self._watch.begin(f"short fit of {candidate.name}", short=True)
        return self._screening.error(self._screening.nearest(starts))

    def fitted(self, candidate: Candidate, starts: Sequence[StructuredModel]) -> Fitted:
        """Return the best of the fits from these starts, up to the first whose residual the noise explains."""
        self._watch.begin_fit(candidate.name)
        return self._fits.begun(starts)

    def scores(self, fit: Fitted) -> Scores:
        """Return how well a model fits the validation data."""
        return self._fits.scores(fit)
