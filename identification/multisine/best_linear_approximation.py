"""Best linear approximation and coherence from periodic spectra.

`identification.multisine.estimators` has the equations of the approximation and its covariance.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.linear.response_matrix import FrequencyResponseMatrix
from identification.multisine.estimators import Estimator, chosen, estimated_responses
from identification.multisine.spectra import PeriodicSpectra

__all__ = ["Estimator", "best_linear_approximation", "coherence"]

Float = NDArray[np.float64]

_DEPENDENT = 1e-9  # smallest singular value of the inputs' powers, scaled to a unit diagonal


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


def coherence(spectra: PeriodicSpectra, output: str, inputs: str | Sequence[str] | None = None) -> Float:
    """Part of the output's power that is linear in the inputs, every period of every realisation counted as one record.

    ``S_yU S_UU^-1 S_Uy / S_yy`` (Bendat and Piersol, *Random Data*, 4th ed., section 7.3): ordinary with one input,
    multiple with several. Neither noise nor distortion leaves it at 1, and few records bring it up: n records of pure noise
    show ``n_inputs / n`` on average.

    Parameters
    ----------
    spectra
        Recorded spectra.
    output
        Name of a channel.
    inputs
        Name or names of channels; None for all forces.

    Returns
    -------
    float[n_excited]
        Coherence at the excited lines, in [0, 1].

    Raises
    ------
    IdentificationError
        On channels that are missing, fewer records than inputs and one, lines without power, inputs that depend on each other.
    """
    rows = chosen("inputs", spectra.channels, inputs, ("force",))
    lines = spectra.spectra[..., spectra.excited].reshape(-1, len(spectra.channels), int(spectra.excited.sum()))
    if lines.shape[0] <= len(rows):
        raise IdentificationError(
            f"periods, realisations: make {lines.shape[0]} records, a coherence with {len(rows)} inputs needs more than that"
        )
    y, u = lines[:, spectra.index(output)], lines[:, rows]
    sizes = np.sqrt(np.sum(np.abs(lines) ** 2, axis=0))[[spectra.index(output), *rows]]
    if np.any(sizes == 0.0):
        where = spectra.frequency_hz[spectra.excited][int(np.argmax(np.any(sizes == 0.0, axis=0)))]
        raise IdentificationError(f"{output}, inputs: have no power at {where:g} Hz, an excited line")
    y, u = y / sizes[0], u / sizes[1:]
    powers = np.einsum("rik,rjk->kij", u, np.conj(u))
    cross = np.einsum("rk,rik->ki", y, np.conj(u))
    dependent = np.linalg.eigvalsh(powers)[:, 0] < _DEPENDENT
    if np.any(dependent):
        where = spectra.frequency_hz[spectra.excited][int(np.argmax(dependent))]
        raise IdentificationError(f"inputs: depend on each other at {where:g} Hz, their shares cannot be separated")
    found = np.einsum("ki,kij,kj->k", cross, np.linalg.inv(powers), np.conj(cross)).real
    return np.asarray(np.clip(found, 0.0, 1.0))
