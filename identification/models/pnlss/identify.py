"""Identify a nonlinear state-space model from experiments in one call.

Best linear approximation -> subspace -> weighted fit over frequency -> states of variance one -> fit of all parameters over
time: the method of Paduart et al., Automatica 46, 2010, and of Scheel et al., Section 3.3.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from identification.channels import Channel
from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment
from identification.fitting.result import FitProgress
from identification.linear.subspace import StateSpace
from identification.models.pnlss.compared_starts import STARTS, best_of_starts, interrupted
from identification.models.pnlss.features import Features
from identification.models.pnlss.fitting.checks import check_enough, check_signals
from identification.models.pnlss.fitting.fit import fit_pnlss
from identification.models.pnlss.fitting.result import FitSettings, PnlssFit
from identification.models.pnlss.linear_model import linear_pnlss, varying_inputs
from identification.models.pnlss.model import PnlssModel
from identification.models.pnlss.saturating_starts import saturating_starts

Variables = Literal["all", "states"] | Sequence[int]


def identify_pnlss(
    experiments: Sequence[Experiment],
    *,
    states: int,
    degrees: Iterable[int] | None = None,
    output_degrees: Iterable[int] | None = None,
    variables: Variables = "all",
    saturating: int | tuple[int, int] = 0,
    function: str = "tanh",
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

    Raises `IdentificationError` if the experiments cannot be used or do not support this number of states; see
    `best_linear_responses`, `fit_pnlss`.

    Parameters
    ----------
    experiments
        Training data; its periodic experiments give the linear start, or all if none is periodic.
    states
        Number of states: two per mode of vibration, and more for elements with memory (friction, hysteresis).
    degrees, output_degrees
        Degrees of the monomials in the state and the output equation; ``()`` for no monomials. If ``degrees`` is None: 2 and
        3, or no monomials if there are saturating features. If ``output_degrees`` is None: as ``degrees``. With saturating
        features alone the nonlinear contribution is bounded, and the model stays bounded if its linear part is stable.
    variables
        Variables of the monomials: ``all`` states and the inputs that vary, ``states`` alone, or indices of variables (states
        first).
    saturating
        Number of saturating features in the state equation, or numbers in the state and the output equation; 10 to 15 suffice
        for a hysteresis. If one number is given, the output equation has as many, unless all outputs are displacements or
        velocities, on which forces do not act instantaneously.
    function
        Function of the saturating features: ``tanh``, ``square``, ``cube``, or ``"module:name"`` of your own (`Features`).
    state_features, output_features
        User-defined features, in place of those that the settings above describe; their coefficients begin at zero.
    validation
        Data that selects the iterate and is not used for training.
    linear
        Initial linear model, whose states are kept. None: a model fitted to the best linear approximation of the periodic
        experiments, or to a regression (`identification.linear.auto_regression`) if none is periodic, with uncorrelated states
        of variance one.
    band_hz
        Band of the best linear approximation; None for all excited lines.
    settings
        Settings of the fit over time; None for the defaults.
    seed
        Seed of the random directions from which saturating features take their starts. Twelve starts are proposed, four are
        begun to fit, and the better half continues after each of 10 and 30 iterations.
    progress
        Called after every iteration of the fit over time, and of the fits of compared starts (`FitProgress.stage`).

    Returns
    -------
    PnlssFit
        The notes of its model give the errors of the linear start over frequency and over time, and those of the nonlinear
        model. Ctrl-C returns the best fit so far, marked ``interrupted``; before there is a fit it raises KeyboardInterrupt.
    """
    chosen = FitSettings() if settings is None else settings
    if not isinstance(states, int | np.integer) or states < 1:
        raise IdentificationError(field="states", value=states, allowed="at least 1, whole")
    check_signals(experiments)
    inputs, outputs = experiments[0].input_channels, experiments[0].output_channels
    counts = _saturating(saturating, outputs)
    of = _chosen(variables, states, varying_inputs(experiments))
    powers = tuple((() if any(counts) else (2, 3)) if degrees is None else degrees)
    of_output = powers if output_degrees is None else tuple(output_degrees)
    given = (state_features, output_features)
    phi, chi = (
        Features.monomials(states, len(inputs), which, of=of) if own is None else own
        for own, which in zip(given, (powers, of_output), strict=True)
    )
    if any(own is not None and count for own, count in zip(given, counts, strict=True)):
        raise IdentificationError(
            "beside features of one's own", field="saturating", hint="put saturating ones among those"
        )
    check_enough(experiments, _parameters(states, len(inputs), len(outputs), phi, chi, counts))
    begin = linear_pnlss(experiments, states=states, linear=linear, band_hz=band_hz)
    if any(counts):
        random = np.random.default_rng(seed)
        starts = saturating_starts(begin, experiments, phi, chi, counts, random, STARTS, function)
        data: dict[str, Any] = {"validation": validation, "settings": chosen, "progress": progress}
        start, found = best_of_starts(starts, experiments, **data)
        if not found.interrupted:
            try:
                found = fit_pnlss(start, experiments, resume=found, **data)
            except KeyboardInterrupt:  # before its first iteration
                found = interrupted(found)
    else:
        start = begin.with_features(phi, chi)
        found = fit_pnlss(start, experiments, validation=validation, settings=chosen, progress=progress)
    return _with_scores(found, begin, experiments)


def _parameters(
    states: int, inputs: int, outputs: int, phi: Features, chi: Features, saturating: tuple[int, int]
) -> int:
    """Number of parameters without initial states; counted before the search for a linear start, which takes longer."""
    variables = states + inputs
    inner = sum(saturating) * (variables + 1) + phi.parameters + chi.parameters
    wide, own = (variables + f.count + count for f, count in zip((phi, chi), saturating, strict=True))
    return states * wide + outputs * own + inner


def _saturating(saturating: int | tuple[int, int], outputs: Sequence[Channel]) -> tuple[int, int]:
    if isinstance(saturating, tuple):
        counts = saturating
    else:
        at_once = any(c.role not in ("drive", "response") or c.motion == "acceleration" for c in outputs)
        counts = (saturating, saturating if at_once else 0)
    IdentificationError.raise_if(min(counts) < 0, field="saturating", value=saturating, allowed="0 and above")
    return counts


def _with_scores(found: PnlssFit, begin: PnlssModel, experiments: Sequence[Experiment]) -> PnlssFit:
    """Return the fit with its linear start, and with notes on the errors of both over all training data.

    A failure here must not lose the fit.
    """
    notes = []
    try:
        error = fit_pnlss(begin, experiments, settings=replace(found.settings, iterations=0)).training_error
        notes.append(f"linear model: training error {100 * error:.2g} %")
    except KeyboardInterrupt:
        found = interrupted(found)
    except IdentificationError as why:
        notes.append(f"linear model: no training error ({why})")
    score = f"nonlinear model: training error {100 * found.training_error:.2g} %"
    if not np.isnan(found.validation_error):
        score += f", validation error {100 * found.validation_error:.2g} %"
    score += f", iteration {found.chosen} of {found.history.iterations} ({found.message})"
    notes += [score, *_unstable(found.model)]
    return replace(found, model=replace(found.model, notes=(*found.model.notes, *notes)), linear=begin)


def _unstable(model: PnlssModel) -> list[str]:
    """Return a note if the linear part is unstable: the model may be bounded on one record and unbounded on another."""
    poles = np.linalg.eigvals(model.a)
    worst = complex(poles[int(np.argmax(np.abs(poles)))])
    if abs(worst) < 1.0:
        return []
    hz = abs(np.angle(worst)) * model.sample_rate_hz / (2.0 * np.pi)
    return [
        f"the linear part is unstable: at {hz:.4g} Hz small vibrations grow at a rate of "
        f"{np.log(abs(worst)) * model.sample_rate_hz:.3g} 1/s, and long runs such as sweeps may diverge"
    ]


def _chosen(variables: Variables, states: int, varying: Sequence[int]) -> list[int]:
    if variables == "all":
        return [*range(states), *(states + i for i in varying)]
    if variables == "states":
        return list(range(states))
    if isinstance(variables, str):
        raise IdentificationError(field="variables", value=variables, allowed="all, states, or numbers of variables")
    return list(variables)
