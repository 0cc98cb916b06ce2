"""Experimental modal analysis in one call: from frequency responses to mass-normalised modes with standard errors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from identification.channels import find_role
from identification.errors import IdentificationError
from identification.linear.accelerance import (
    WeightedResponses,
    Weighting,
    first_weighting,
    motion_factors,
    weighted_accelerance,
)
from identification.linear.errors_in_variables import DrivenResponses, driven_responses, is_driven, over_force
from identification.linear.modal_parameters import accepted, as_linear_modes, drive_of, modal_notes
from identification.linear.model_errors import (
    is_mostly_distortion,
    systematic_misfit,
    with_common_distortion,
    with_line_scatter,
    with_model_error,
    with_repeated_error,
)
from identification.linear.modes import LinearModes
from identification.linear.rational_fractions import ModalFit, fit_modes, modal_basis
from identification.linear.response_matrix import FrequencyResponseMatrix
from identification.linear.stabilisation import StabilisationDiagram, diagram as stability
from identification.linear.starts import poles_of, searched, start_of
from identification.validation import shaped_array
from vibrolock.arrays import Complex, Float
from vibrolock.results import Result

_NEEDED = 2.0
"""A pole must be a mode if the misfit without it grows by this factor, whatever number of modes was requested."""
_ROUNDS = 20
"""Rounds of weighting and fit, at most. Chosen."""
_AT_REST_STD = 0.01
"""The iteration ends once no pole moves by more than this share of its standard error."""


@dataclass(frozen=True, eq=False)
class ModalAnalysis(Result):
    """Result of a linear modal analysis.

    Parameters
    ----------
    modes
        The modal model.
    responses
        The responses to which the modes were fitted; None if the modes come from elsewhere.
    stabilisation
        The diagram in which the modes were found; None if starting values were given.
    """

    modes: LinearModes
    responses: FrequencyResponseMatrix | None = None
    stabilisation: StabilisationDiagram | None = None


def linear_modes(
    responses: FrequencyResponseMatrix,
    *,
    modes: int | Sequence[float] | LinearModes | None = None,
    lowest_hz: float | None = None,
    highest_hz: float | None = None,
    complex_residues: bool = False,
    weighting: Weighting = "auto",
    orders: Sequence[int] | None = None,
    diagram: StabilisationDiagram | None = None,
    error: Complex | None = None,
) -> LinearModes:
    """Identify linear modes from the frequency responses of all motions to a single drive force.

    A frequency-domain subspace method of rising order gives the initial poles (`stabilisation`). A weighted least-squares fit
    of a modal model with residual terms gives the result. Shapes are mass-normalised by the residue at the drive point;
    without a drive point frequencies and damping are the same, and the largest shape of each mode is 1.

    Raises `IdentificationError` without exactly one force, with several drive channels, with too few lines, or where no
    mode is found.

    Parameters
    ----------
    responses
        Motions over the force, one of them of role ``drive`` for mass-normalised shapes, preferably estimated with the voltage
        as instrument. Better still are force and motions over the voltage (``best_linear_approximation(...,
        inputs=("voltage",), outputs=("force", ...))``): their noise is weighted correctly even where it exceeds the force
        (`errors_in_variables`).
    modes
        None: all poles that are stable in the stabilisation diagram, less those that the fit rejects as modes. A number: that
        many of the most prominent modes. Frequencies (Hz): one mode near each. Modes of another level: the fit starts from
        their poles.
    lowest_hz, highest_hz
        Band of the fit; all lines if None.
    complex_residues
        Fit residues as complex numbers, for damping that couples modes. Normal modes have half as many unknowns and smaller
        standard errors where damping is light; ``phase_collinearity`` shows whether they suffice.
    weighting
        Covariance that weights the lines: ``total`` (with nonlinear distortion; from the scatter of neighbouring lines if the
        responses have none), ``noise`` or ``relative`` (errors of equal relative size). ``auto`` takes the total covariance
        if known, else that of noise, unless the misfit is more than noise explains: then the scatter of lines. Where this
        gives other poles than relative weights, ``auto`` takes the latter (`model_errors`).
    orders
        Orders of the stabilisation diagram.
    diagram
        The stabilisation diagram of these responses, if it is known already.
    error
        complex[n_lines, n_outputs, n_inputs], error of ``responses.value`` that every record has, such as images of the held
        output. What it does to the modes is a standard error of each, besides the random one; it is not corrected.
    """
    drive_of(responses.outputs)
    free, scatter = weighting == "auto", weighting == "total" and responses.total_covariance is None
    weighting, normal = first_weighting(responses, weighting), not complex_residues
    driven = is_driven(responses)
    if not driven and (len(responses.inputs) != 1 or responses.inputs[0].role != "force"):
        names = ", ".join(f"{channel.name} ({channel.role})" for channel in responses.inputs)
        raise IdentificationError(
            f"are {names}; modes need the responses to one force, or that force among the outputs",
            field="inputs",
        )
    selected = responses.select(
        lowest_hz=0.0 if lowest_hz is None else lowest_hz, highest_hz=np.inf if highest_hz is None else highest_hz
    )
    joint = driven_responses(selected, weighting) if driven else None
    band = over_force(selected) if driven else selected
    data = joint.first_guess() if joint else weighted_accelerance(band, "relative" if driven else weighting)
    if isinstance(modes, int) and modes < 1:
        raise IdentificationError(field="modes", value=modes, allowed="at least 1")
    if isinstance(modes, LinearModes):
        fit, notes = _without_spurious(data, band, poles_of(modes, data), normal=normal, modes=None)
    else:
        stable = stability(data, orders) if diagram is None else diagram
        fit, notes = _begun(stable, data, band, normal=normal, modes=modes)
    if joint is not None:
        fit, data = _most_likely(joint, fit, normal=normal)
    if scatter or (free and data.kind != "total" and fit.misfit > _NEEDED):
        fit, data = with_line_scatter(data, fit, normal=normal)
    noise = _weighted_by("noise", selected, fit, normal=normal)
    total = data if data.kind in ("total", "line scatter") else _weighted_by("total", selected, fit, normal=normal)
    if total is not None and is_mostly_distortion(total, noise, fit):
        if total is not data:  # other weights were asked for, the errors are the same
            data = replace(data, covariance=total.covariance)
            fit = fit_modes(data, fit.poles, normal=normal)
        fit, data, moved = with_model_error(data, fit, total, noise, normal=normal, free=free)
        fit, notes = with_common_distortion(fit), notes + moved
    if error is not None:
        wrong = _as_accelerance(responses, error, selected, fit, normal=normal)
        fit = with_repeated_error(data, fit, wrong, normal=normal)
    notes = [*notes, *systematic_misfit(data, fit, normal=normal)]
    result = as_linear_modes(fit, band, data, normal=normal)
    return replace(result, notes=(*band.notes, *notes, *modal_notes(result, data, fit.converged)))


def _begun(
    stable: StabilisationDiagram,
    data: WeightedResponses,
    band: FrequencyResponseMatrix,
    *,
    normal: bool,
    modes: int | Sequence[float] | None,
) -> tuple[ModalFit, list[str]]:
    """Return the fit that starts from the diagram, and notes; if none of its poles is a mode, from the pole of a search."""
    start, notes = start_of(stable, data, None if modes is None or isinstance(modes, int) else modes)
    try:
        fit, rejected = _without_spurious(data, band, start, normal=normal, modes=modes)
    except IdentificationError:
        if modes is not None or (other := searched(data)) is None:
            raise
        start, notes = other
        fit, rejected = _without_spurious(data, band, start, normal=normal, modes=modes)
    return fit, [*notes, *rejected]


def _as_accelerance(
    responses: FrequencyResponseMatrix,
    error: Complex,
    selected: FrequencyResponseMatrix,
    fit: ModalFit,
    *,
    normal: bool,
) -> Complex:
    """complex[n_lines, n_outputs]: error of what is fitted, from that of ``responses.value``, about the model of ``fit``."""
    error = shaped_array("error", error, np.complex128, responses.value.shape)
    lines = np.isin(responses.frequency_hz, selected.frequency_hz)
    shape = (selected.frequency_hz.size, -1)
    wrong = error[lines].reshape(shape) * motion_factors(selected)
    if not is_driven(selected):
        return wrong
    force = find_role(selected.outputs, "force")
    model = modal_basis(selected.s, fit.poles, normal) @ fit.terms.T
    motions = np.delete(wrong, force, axis=1)
    return np.asarray((motions - model * wrong[:, [force]]) / selected.value[:, [force], 0])


def _weighted_by(
    kind: Literal["noise", "total"], responses: FrequencyResponseMatrix, fit: ModalFit, *, normal: bool
) -> WeightedResponses | None:
    """Return responses with their covariance of a kind, about the model of ``fit`` if they are over a voltage."""
    if getattr(responses, f"{kind}_covariance") is None:
        return None
    if not is_driven(responses):
        found = weighted_accelerance(responses, kind)
        return None if found.covariance is None else found
    driven = driven_responses(responses, kind)
    return None if driven is None else driven.around(modal_basis(driven.s, fit.poles, normal) @ fit.terms.T)


def _most_likely(joint: DrivenResponses, fit: ModalFit, *, normal: bool) -> tuple[ModalFit, WeightedResponses]:
    """Return the maximum-likelihood fit near ``fit``: repeat fits to the linearised problem until no pole moves."""
    for _ in range(_ROUNDS):
        before = fit
        basis = modal_basis(joint.s, fit.poles, normal)
        data = joint.around(basis @ fit.terms.T)
        fit = fit_modes(data, fit.poles, normal=normal)
        std = np.sqrt(np.maximum(np.diag(fit.covariance)[: fit.poles.size - 1], 1e-300))
        if np.all(np.abs(fit.poles - before.poles)[:-1] < _AT_REST_STD * std):
            return fit, data
    return replace(fit, converged=False), data


def _without_spurious(
    data: WeightedResponses,
    band: FrequencyResponseMatrix,
    poles: Float,
    *,
    normal: bool,
    modes: int | Sequence[float] | None,
) -> tuple[ModalFit, list[str]]:
    """Fit, drop poles that are not modes (or the least prominent if a number was requested), and repeat until all are modes."""
    notes: list[str] = []
    drive, whole = drive_of(band.outputs), np.inf
    while True:
        fit = fit_modes(data, poles, normal=normal)
        if fit.residual > _NEEDED * max(whole, 1.0):
            raise IdentificationError(
                f"{modes} wanted, but {notes[-1]} raises the misfit from {whole:.2g} to {fit.residual:.2g}: it "
                "is a mode; ask for more modes, or for those of a narrower band",
                field="modes",
            )
        reasons, prominence = accepted(fit, data, drive, normal=normal)
        count = prominence.size
        out = {index: reason for index, reason in enumerate(reasons) if reason}
        if not out and isinstance(modes, int) and count > modes:
            out = {int(np.argmin(prominence)): "is the least prominent"}
            whole = min(whole, fit.residual)
        names = [f"pole at {fit.omega[index] / (2 * np.pi):.5g} Hz {reason}" for index, reason in out.items()]
        if (out and not (modes is None or isinstance(modes, int))) or len(out) == count:
            reversed_ = any("residue of -" in name for name in names)
            hint = ", or the polarity of force or drive channel is reversed" if reversed_ else ""
            raise IdentificationError(
                "; ".join(names), field="modes", hint=f"no mode there that can be normalised{hint}"
            )
        if not out:
            if isinstance(modes, int) and count < modes:
                found = ", ".join(f"{f:.5g}" for f in np.sort(fit.omega) / (2 * np.pi))
                raise IdentificationError(
                    f"{modes} wanted, {count} found ({found} Hz); give starting frequencies for the others",
                    field="modes",
                )
            return fit, notes
        notes += [f"left out: {name}" for name in names]
        kept = np.array([index for index in range(count) if index not in out])
        poles = np.concatenate([fit.omega[kept], fit.zeta[kept]])
