"""Best linear approximation from periodic spectra; `identification.multisine.estimators` has the equations."""

from collections.abc import Sequence
from dataclasses import replace

from identification.linear.response_matrix import FrequencyResponseMatrix
from identification.multisine.estimators import Estimator, estimated_responses
from identification.multisine.spectra import PeriodicSpectra

__all__ = ["Estimator", "best_linear_approximation"]


def best_linear_approximation(
    spectra: PeriodicSpectra,
    *,
    outputs: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    estimator: Estimator = "instrument",
    instruments: Sequence[str] = ("voltage",),
    specimen: str = "",
) -> FrequencyResponseMatrix:
    """Frequency responses at the excited lines, their noise and total covariance over all paths.

    Parameters
    ----------
    spectra
        Recorded spectra. With several inputs, every ``len(inputs)`` realisations in turn are the experiments of one block
        (`MultisineDesign.orthogonal_realisation`), and blocks are independent; the total covariance is unbiased for
        orthogonal blocks.
    outputs, inputs
        Names of channels; None for all motions, and for all forces.
    estimator
        ``instrument``, ``H1`` or ``H2`` (one input).
    instruments
        Channels that serve as Z for ``instrument``, as many as inputs.
    specimen
        Name for the result.

    Raises
    ------
    IdentificationError
        On channels that are missing or named twice, realisations that do not fill blocks, lines without power at an input or
        its instrument, inputs that do not move independently.
    """
    found = estimated_responses(
        spectra.channels,
        spectra.frequency_hz[spectra.excited],
        spectra.spectra[..., spectra.excited],
        outputs=outputs,
        inputs=inputs,
        estimator=estimator,
        instruments=instruments,
    )
    return replace(
        found,
        input_rms=tuple(spectra.rms(channel.name) for channel in found.inputs),
        specimen=specimen,
        notes=(*spectra.notes, *found.notes),
    )
