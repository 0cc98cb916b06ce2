"""From experiments to a nonlinear state-space model in one call.

Best linear approximation -> subspace -> weighted fit over frequency -> states of variance one -> fit of all parameters over
time: the way of Paduart et al., Automatica 46, 2010, and of Scheel et al., Section 3.3.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.linear.state_space_fit import spectral_radius
from identification.linear.subspace import StateSpace
from identification.pnlss.best_linear import best_linear_responses
from identification.pnlss.experiment import Experiment, same_channels
from identification.pnlss.features import Features
from identification.pnlss.fitting.fit import fit_pnlss
from identification.pnlss.fitting.result import PnlssFit
from identification.pnlss.fitting.settings import FitProgress, FitSettings
from identification.pnlss.linear_start import linear_start, with_independent_states
from identification.pnlss.model import PnlssModel

__all__ = ["identify_pnlss", "linear_pnlss"]

Float = NDArray[np.float64]
Variables = Literal["all", "states"] | Sequence[int]


def identify_pnlss(
    experiments: Sequence[Experiment],
    *,
    states: int,
    degrees: Iterable[int] = (2, 3),
    output_degrees: Iterable[int] | None = None,
    variables: Variables = "all",
    saturating: int = 0,
    state_features: Features | None = None,
    output_features: Features | None = None,
    validation: Sequence[Experiment] = (),
    linear: StateSpace | PnlssModel | None = None,
    band_hz: tuple[float, float] | None = None,
    settings: FitSettings | None = None,
    seed: int = 0,
    progress: Callable[[FitProgress], None] | None = None,
) -> PnlssFit:
    """Identify a nonlinear state-space model.

    Parameters
    ----------
    experiments
        Training data; what is periodic among it gives the linear start.
    states
        Number of states: two per mode of vibration.
    degrees, output_degrees
        Degrees of the monomials in the state and the output equation; of the outputs as of the states if None, ``()`` for
        none.
    variables
        What the monomials are made of: ``all`` states and inputs, ``states`` alone, or the numbers of some (states first).
    saturating
        Number of saturating features beside the monomials of the state equation.
    state_features, output_features
        Features of one's own, instead of those that the settings above describe.
    validation
        Data that is not trained on and chooses the iterate.
    linear
        A linear model to begin from, its states kept as they are. None: from the best linear approximation of the periodic
        experiments, in states of variance one that are uncorrelated.
    band_hz
        Band of the best linear approximation; None for all excited lines.
    settings
        Of the fit over time.
    seed
        Of the random directions that saturating features begin with.
    progress
        Called after every iteration of the fit over time.

    Raises
    ------
    IdentificationError
        Where the experiments cannot be used, or do not support so many states; see `best_linear_responses`, `fit_pnlss`.
    """
    begin = linear_pnlss(experiments, states=states, linear=linear, band_hz=band_hz)
    chosen = _chosen(variables, states, len(begin.inputs))
    phi = (
        Features.monomials(states, len(begin.inputs), degrees, of=chosen) if state_features is None else state_features
    )
    if output_features is not None:
        chi = output_features
    else:
        chi = Features.monomials(
            states, len(begin.inputs), degrees if output_degrees is None else output_degrees, of=chosen
        )
    start = begin.with_features(phi, chi)
    found = fit_pnlss(start, experiments, validation=validation, settings=settings or FitSettings(), progress=progress)
    return found


def linear_pnlss(
    experiments: Sequence[Experiment],
    *,
    states: int,
    linear: StateSpace | PnlssModel | None = None,
    band_hz: tuple[float, float] | None = None,
) -> PnlssModel:
    """The linear model that a fit begins from, with notes on how near it comes.

    Parameters and errors are those of `identify_pnlss`.
    """
    same_channels(experiments)
    first = experiments[0]
    if linear is not None:
        return _given(linear, first, states)
    responses = best_linear_responses(experiments, band_hz=band_hz)
    found = linear_start(responses, states, sample_rate_hz=first.sample_rate_hz)
    low, high = responses.frequency_hz[[0, -1]]
    note = (
        f"linear start: {responses.frequency_hz.size} lines in {low:g} to {high:g} Hz fitted to {100 * found.error.max():.2g} % "
        f"with {found.weighting} weights"
    )
    model = PnlssModel.linear(
        found.model,
        sample_rate_hz=first.sample_rate_hz,
        inputs=first.input_channels,
        outputs=first.output_channels,
        specimen=first.specimen,
        notes=(*responses.notes, note),
    )
    return with_independent_states(model, experiments)


def _given(linear: StateSpace | PnlssModel, first: Experiment, states: int) -> PnlssModel:
    """A linear model from outside, checked."""
    matrices = linear.linear_part if isinstance(linear, PnlssModel) else linear
    n, m, outputs = states, len(first.input_channels), len(first.output_channels)
    for name, part, shape in zip("abcd", matrices, ((n, n), (n, m), (outputs, n), (outputs, m)), strict=True):
        if np.shape(part) != shape:
            raise IdentificationError(f"linear: {name} has shape {np.shape(part)}, needs {shape}")
    if isinstance(linear, PnlssModel) and abs(linear.sample_rate_hz / first.sample_rate_hz - 1.0) > 1e-9:
        raise IdentificationError(
            f"linear: is of {linear.sample_rate_hz:g} Hz, the experiments of {first.sample_rate_hz:g} Hz"
        )
    if (radius := spectral_radius(matrices.a)) >= 1.0:
        raise IdentificationError(f"linear: has an eigenvalue of magnitude {radius:.6g}, allowed is below 1 (stable)")
    return PnlssModel.linear(
        matrices,
        sample_rate_hz=first.sample_rate_hz,
        inputs=first.input_channels,
        outputs=first.output_channels,
        specimen=first.specimen,
        notes=linear.notes if isinstance(linear, PnlssModel) else (),
    )


def _chosen(variables: Variables, states: int, inputs: int) -> list[int]:
    if variables == "all":
        return list(range(states + inputs))
    if variables == "states":
        return list(range(states))
    if isinstance(variables, str):
        raise IdentificationError(f"variables: is '{variables}', allowed are all, states, or numbers of variables")
    return list(variables)
