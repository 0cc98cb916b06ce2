"""Answers of a structured model to what is asked of any dynamic model."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike

from identification.channels import MOTION_ORDER
from identification.exciter_coupling.exciter import Exciter
from identification.harmonic_balance.basis import Basis
from identification.harmonic_balance.drives import Drive
from identification.harmonic_balance.states import SteadyStates, largest_use, motion_rows
from identification.models.balanced_model import BalancedModel
from identification.models.dynamic_model import Limit, SteadyRequest
from identification.models.structured.balance import StructuredBalance
from identification.models.structured.coupled import coupled_run
from identification.models.structured.extrapolation import judged_by_input, with_what_is_open
from identification.models.structured.fit import StructuredFit, drawn
from identification.models.structured.model import Motion, StructuredModel
from identification.prediction.steady_prediction import ResponseBand, SteadyPrediction
from vibrolock.arrays import Complex, Float

_SAMPLES = 32
"""Samples of a period per harmonic. Chosen: dampers and springs have bends."""
_LEAST_SAMPLES = 256
"""Samples of a period at least. Chosen."""
_GUESSED = 0.5
"""Default lowest frequency of a run with an exciter, relative to the resonance of small vibrations. Chosen."""


class StructuredDynamics(BalancedModel):
    """A structured model, or a fit of one, which gives its covariance as well."""

    kind = "structured model"
    options = frozenset({"exciter", "support", "samples", "voltage_v", "band_hz", "stability"})
    highest_hz = np.inf

    def __init__(self, found: StructuredModel | StructuredFit) -> None:
        self.fit = found if isinstance(found, StructuredFit) else None
        self.driven = self.model = found.model if isinstance(found, StructuredFit) else found

    def samples_for(self, harmonics: int) -> int:
        """Return enough samples for laws with bends."""
        return max(_SAMPLES * harmonics, _LEAST_SAMPLES)

    def equations(self, drive: Drive, basis: Basis, held: Float, request: SteadyRequest) -> StructuredBalance:
        """Return the balance of the continuous equation of motion; by default the support acts if there is an exciter."""
        supported = request.exciter is not None if request.support is None else request.support
        return StructuredBalance(self.model, drive, basis, supported)

    def resonance_hz(self, near_hz: float | None = None) -> float:
        """Frequency of a mode of small vibrations: the nearest one, or that which moves most at the first input."""
        at_rest = self.model.linearised()
        if near_hz is not None:
            return float(at_rest.frequency_hz[np.argmin(np.abs(at_rest.frequency_hz - near_hz))])
        compliance = at_rest.input_shapes[:, 0] ** 2 / (at_rest.damping_ratio * at_rest.omega**2)
        return float(at_rest.frequency_hz[int(np.argmax(compliance))])

    def range_notes(self, points: SteadyStates) -> list[str]:
        """Return a note on elements that move further than in the training data."""
        largest = float(np.max(largest_use(points.state_use), initial=0.0))
        known = all(element.largest for element in self.model.elements)
        of = "the training data" if known else "the reach of their laws"
        return [f"elements reach {largest:.2f} times {of}: extrapolated"] if largest > 1.0 else []

    def frequency_response(
        self, request: SteadyRequest, band_hz: tuple[float | None, float | None]
    ) -> SteadyPrediction:
        """Return the fundamentals, with the range use of the force where that is larger."""
        return judged_by_input(self.model, super().frequency_response(request, band_hz))

    def linear_response(self, frequency_hz: Float) -> Complex:
        """Return the sum over the modes of small vibrations, and the residual of the modes above."""
        at_rest, rows = self.model.linearised(), motion_rows(self.model.outputs)
        omega = 2.0 * np.pi * np.asarray(frequency_hz)[:, None]
        stiffness = at_rest.omega**2 - omega**2 + 2j * omega * at_rest.damping_ratio * at_rest.omega
        order = np.array([MOTION_ORDER[at_rest.outputs[row].motion] for row in rows])
        through = at_rest.direct[rows, 0] / (1j * omega) ** order
        return np.asarray((at_rest.input_shapes[:, 0] / stiffness) @ at_rest.output_shapes[rows].T + through)

    def validity(self) -> tuple[Limit, ...]:
        """Return the largest displacement of each element, or the reach of its laws."""
        elements = enumerate(self.model.elements)
        return tuple(Limit(f"element {k + 1}", float(e.largest or e.reach) * e.scale_m, "m") for k, e in elements)

    def coupled_run(self, exciter: Exciter, voltage_v: ArrayLike, lowest_hz: float | None) -> Motion:
        """Return the run with the exciter, whose reaction is exact above half the resonance by default."""
        return coupled_run(self.model, exciter, voltage_v, lowest_hz, lambda: _GUESSED * self.resonance_hz())

    def draws(self, count: int, seed: int) -> Iterator["StructuredDynamics"]:
        """Yield models about that of the fit."""
        if self.fit is None:
            raise self.cannot("be drawn without its fit", "give the StructuredFit")
        for model in drawn(self.fit, count, seed):
            yield StructuredDynamics(model)

    def with_what_is_open(
        self, band: ResponseBand, response: SteadyPrediction, respond: Callable[[object], SteadyPrediction]
    ) -> ResponseBand:
        """Return a band that also holds laws that the training data do not tell from those of the fit."""
        return band if self.fit is None else with_what_is_open(self.fit, band, response, respond)
