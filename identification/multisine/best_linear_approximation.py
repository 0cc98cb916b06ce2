"""Best linear approximation and coherence from periodic spectra.

`identification.multisine.estimators` has the equations of the approximation and its covariance.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.errors import IdentificationError
from identification.linear.response_matrix import FrequencyResponseMatrix
from identification.multisine.estimators import Estimator, chosen, estimated_responses
from identification.multisine.spectra import PeriodicSpectra
from vibrolock.arrays import Float

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
    """Estimate the frequency responses at the excited lines, with the noise and total covariance over all paths.

    Raises `IdentificationError` if channels are missing or named twice, realisations do not fill whole blocks, an
    input or its instrument has no power at a line, or inputs are linearly dependent.

    Parameters
    ----------
    spectra
        Recorded spectra. With several inputs, consecutive groups of ``len(inputs)`` realisations are the experiments of one
        block (`MultisineDesign.orthogonal_realisation`). Blocks are independent; the total covariance is unbiased for
        orthogonal blocks.
    outputs, inputs
        Names of channels. None: all motions as outputs, all forces as inputs.
    estimator
        ``instrument``, ``H1`` or ``H2`` (one input).
    instruments
        Channels that serve as the instruments Z for the estimator ``instrument``, as many as inputs.
    specimen
        Name for the result.
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
    """Return the share of the output's power that is linear in the inputs; every period of every realisation is one record.

    ``S_yU S_UU^-1 S_Uy / S_yy`` (Bendat and Piersol, *Random Data*, 4th ed., section 7.3): ordinary with one input, multiple
    with several. Both noise and distortion reduce it below 1. Few records bias it upwards: n records of pure noise give
    ``n_inputs / n`` on average.

    Returns the coherence at the excited lines, float[n_excited], in [0, 1].

    Raises `IdentificationError` if channels are missing, there are not more records than inputs, lines have no power,
    or inputs are linearly dependent.

    Parameters
    ----------
    spectra
        Recorded spectra.
    output
        Name of a channel.
    inputs
        Name or names of channels; None for all forces.
    """
    rows = chosen("inputs", spectra.channels, inputs, ("force",))
    lines = spectra.spectra[..., spectra.excited].reshape(-1, len(spectra.channels), int(spectra.excited.sum()))
    if lines.shape[0] <= len(rows):
        reason = f"make {lines.shape[0]} records, a coherence with {len(rows)} inputs needs more than that"
        raise IdentificationError(reason, field="periods, realisations")
    y, u = lines[:, spectra.index(output)], lines[:, rows]
    sizes = np.sqrt(np.sum(np.abs(lines) ** 2, axis=0))[[spectra.index(output), *rows]]
    if np.any(sizes == 0.0):
        where = spectra.frequency_hz[spectra.excited][int(np.argmax(np.any(sizes == 0.0, axis=0)))]
        raise IdentificationError(f"have no power at {where:g} Hz, an excited line", field=f"{output}, inputs")
    y, u = y / sizes[0], u / sizes[1:]
    powers = np.einsum("rik,rjk->kij", u, np.conj(u))
    cross = np.einsum("rk,rik->ki", y, np.conj(u))
    dependent = np.linalg.eigvalsh(powers)[:, 0] < _DEPENDENT
    if np.any(dependent):
        where = spectra.frequency_hz[spectra.excited][int(np.argmax(dependent))]
        reason = f"depend on each other at {where:g} Hz, their shares cannot be separated"
        raise IdentificationError(reason, field="inputs")
    found = np.einsum("ki,kij,kj->k", cross, np.linalg.inv(powers), np.conj(cross)).real
    return np.asarray(np.clip(found, 0.0, 1.0))
