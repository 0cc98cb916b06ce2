"""Steady vibrations of PNLSS and structured models, compared with stepped sines."""

from dataclasses import replace

import numpy as np

from identification import (
    Exciter,
    FrequencyResponse,
    IdentificationError,
    SteadyPrediction,
    SteadyStates,
    compare,
    frequency_response,
    steady_state,
)
from identification.harmonic_balance import Held
from rig.results.predictions.references import Compared, Reference
from rig.results.simulated.driven_models import DrivenModel, Fixed, level_of

_MARGIN = 0.02
"""Relative margin by which a response is followed beyond the frequencies of a reference."""
_STEPS = 5
"""Number of steps from one point of a reference to the next."""
_ALIKE = 0.01
"""Relative difference of amplitudes below which two vibrations count as the same."""
_HARMONIC = 0.01
"""Second harmonic of a reference's force over its fundamental above which a predicted force without harmonics is noted."""


def default_held(model: DrivenModel, exciter: Exciter | None) -> Held:
    """Return the quantity of the force that the model can hold constant."""
    force_driven = any(channel.role == "force" for channel in model.inputs)
    return "pure-sine" if force_driven and exciter is None else "fundamental"


def compared(model: DrivenModel, fixed: Fixed, reference: Reference, *, whole: bool = False) -> Compared:
    """Predict a reference at its held level if the model can hold it, otherwise at the force of each point, and compare.

    ``fixed`` has the ``exciter``, and ``held_inputs`` if the model has constant ones. At a held level, only the band of the
    reference is predicted, or the ``whole`` band of the model.
    """
    measured, over = reference.measured, reference.over
    held, notes = default_held(model, fixed["exciter"]), []
    low, high = float(measured.frequency_hz.min()), float(measured.frequency_hz.max())
    band_hz = None if whole else ((1.0 - _MARGIN) * low, (1.0 + _MARGIN) * high)
    if measured.controlled == "force" or (measured.controlled == "voltage" and held == "fundamental"):
        level = level_of(measured.level, held if measured.controlled == "force" else "voltage")
        predicted = frequency_response(model, band_hz=band_hz, **level, **fixed)
    else:
        predicted = _point_by_point(model, fixed, held, measured)
        over = "frequency"
        if reference.over_asked and reference.over != over:
            notes.append(f"compared point by point, not over {reference.over}: each point has its own force")
    if held == "pure-sine" and (reference.second_harmonic or 0.0) > _HARMONIC:
        notes.append(
            f"the forces differ: the reference's has F2/F1 = {reference.second_harmonic:.2g} where it responds most, the "
            "predicted one has no harmonics; with an exciter model it has"
        )
    predicted = replace(predicted, notes=(*predicted.notes, *notes))
    return Compared(predicted, measured, compare(predicted, measured, over=over).error)


def _point_by_point(model: DrivenModel, fixed: Fixed, held: Held, measured: FrequencyResponse) -> SteadyPrediction:
    """Predict the vibration at the force of each point.

    If several vibrations are found, the one whose amplitude is nearest to the measured one is taken. The search starts from
    rest, and from the previous point, both directly and in steps; without the steps a steep branch would be lost. Points
    without any vibration are left out.
    """
    states: list[SteadyStates] = []
    several = 0
    near: SteadyStates | None = None
    at = (0.0, 0.0)
    for frequency, force, amplitude in zip(
        measured.frequency_hz.tolist(), np.abs(measured.force).tolist(), measured.amplitude_m.tolist(), strict=True
    ):
        tried: list[SteadyStates] = []
        ways: list[tuple[SteadyStates | None, list[tuple[float, float]]]] = [(None, [(frequency, force)])]
        if near is not None:
            ways.insert(0, (near, [(frequency, force)]))
            ways.insert(0, (near, _between(at, (frequency, force))))
        for start, way in ways:
            try:
                for frequency_hz, force_n in way:
                    start = steady_state(model, frequency_hz, near=start, **level_of(force_n, held), **fixed)
            except IdentificationError:
                continue
            tried += [] if start is None else [start]
        if tried:
            at = (frequency, force)
            found = [abs(complex(one.displacement_m[0, 1, 0])) for one in tried]
            several += max(found) > (1.0 + _ALIKE) * min(found)
            near = tried[int(np.argmin(np.abs(np.array(found) - amplitude)))]
            states.append(near)
    if not states:
        raise IdentificationError(
            f"reference '{measured.label}': the model has no periodic vibration at any of its points"
        )
    stable = np.concatenate([one.stable for one in states])
    range_use = np.concatenate([np.asarray(one.range_use) for one in states])
    none = np.zeros(0)
    return SteadyPrediction(
        force_n=float(np.median(np.abs(measured.force))),
        force="recorded",
        channels=states[0].channels,
        frequency_hz=np.concatenate([one.frequency_hz for one in states]),
        modal_amplitude=np.full(len(states), np.nan),
        fundamental_n=np.concatenate([np.abs(one.force_n[:, 1]) for one in states]),
        displacement_m=np.concatenate([one.displacement_m[:, 1] for one in states]),
        stable=stable,
        branch=np.zeros(len(states), dtype=np.int64),
        range_use=range_use,
        fold_frequency_hz=none,
        fold_amplitude_m=none,
        fold_modal_amplitude=none,
        notes=_said(measured.frequency_hz.size, several, stable, range_use),
    )


def _between(begin: tuple[float, float], end: tuple[float, float]) -> list[tuple[float, float]]:
    return [
        (begin[0] + share * (end[0] - begin[0]), begin[1] + share * (end[1] - begin[1]))
        for share in (np.arange(1, _STEPS + 1) / _STEPS).tolist()
    ]


def _said(points: int, several: int, stable: np.ndarray, range_use: np.ndarray) -> tuple[str, ...]:
    missing, unstable = points - stable.size, int(np.count_nonzero(~stable))
    notes = [f"at {missing} of {points} points no vibration was found"] if missing else []
    if several:
        notes.append(
            f"at {several} of {points} points several vibrations were found: the one nearest to the measured amplitude was "
            "taken, which the model alone cannot decide"
        )
    if unstable:
        notes.append(f"{unstable} of {stable.size} vibrations are unstable")
    if np.nanmax(range_use, initial=0.0) > 1.0:
        notes.append(f"states reach {np.nanmax(range_use):.2f} times the training data: extrapolated")
    return tuple(notes)
