"""Frequency responses and single periodic vibrations of nonlinear state-space models at constant force."""

from collections.abc import Mapping

import numpy as np

from identification.exciter_coupling.exciter import Exciter
from identification.harmonic_balance.assembly import response_of, steady_state_of
from identification.harmonic_balance.notes import harmonics_notes, held_notes, loss_notes
from identification.harmonic_balance.setting_up import Held
from identification.harmonic_balance.states import PnlssResponse, SteadyStates, largest_use
from identification.models.pnlss.model import PnlssModel
from identification.models.pnlss.steady.setting_up import balance_of, band_of, harmonics_that_fit
from identification.prediction.steady_prediction import SteadyPrediction
from identification.validation import positive


def pnlss_frequency_response(
    model: PnlssModel,
    force_n: float,
    *,
    force: Held = "fundamental",
    exciter: Exciter | None = None,
    held_inputs: Mapping[str, float] | None = None,
    lowest_hz: float | None = None,
    highest_hz: float | None = None,
    harmonics: int = 7,
    samples: int | None = None,
    points: int = 1000,
    largest_range_use: float = 3.0,
) -> SteadyPrediction:
    """Compute the steady response of a model to a constant force, through its folds: the fundamentals of `pnlss_response`."""
    return pnlss_response(
        model,
        force_n,
        force=force,
        exciter=exciter,
        held_inputs=held_inputs,
        lowest_hz=lowest_hz,
        highest_hz=highest_hz,
        harmonics=harmonics,
        samples=samples,
        points=points,
        largest_range_use=largest_range_use,
    ).prediction


def pnlss_response(
    model: PnlssModel,
    force_n: float,
    *,
    force: Held = "fundamental",
    exciter: Exciter | None = None,
    held_inputs: Mapping[str, float] | None = None,
    lowest_hz: float | None = None,
    highest_hz: float | None = None,
    harmonics: int = 7,
    samples: int | None = None,
    points: int = 1000,
    largest_range_use: float = 3.0,
) -> PnlssResponse:
    """Compute the steady response of a model to a constant force, by harmonic balance and arc-length continuation.

    Parameters
    ----------
    model
        Model driven by one force, or by one voltage with the force among its outputs; at least one output is a motion.
    force_n
        Held force, N: the peak of its fundamental, or its RMS if ``force`` is ``rms``. The amplitude of the voltage, V, if
        ``force`` is ``voltage``.
    force
        Quantity that is constant. ``pure-sine``: a force without harmonics, for a model driven by a force; the only choice
        for such a model without ``exciter``. ``fundamental`` or ``rms``: that of a force with the harmonics that the exciter
        causes, without a static part. ``voltage``: a sine of constant voltage at the exciter.
    exciter
        For models driven by a force: the exciter that applies the force and moves with the model's drive point.
    held_inputs
        Constant value of every input other than the driven one, by name: ``{"constant": 1.0}`` after
        `Experiment.with_constant_input`.
    lowest_hz, highest_hz
        Band; by default within 15 % of the resonance of the model's linear part with the largest drive-point motion.
    harmonics, samples
        Number of harmonics without the static one, reduced (with a note) if they exceed half the sample rate. Number of
        samples per period; by default enough that polynomials do not alias into the retained harmonics.
    points
        Largest number of points on a branch.
    largest_range_use
        Largest state relative to the trained range; a path that exceeds it ends there, with a note.

    Raises
    ------
    IdentificationError
        If model, exciter and force do not match, the band limits do not rise, there are too few samples, or no periodic
        vibration is found at either end of the band.
    """
    low, high = band_of(model, lowest_hz, highest_hz)
    held, more = harmonics_that_fit(model, harmonics, high)
    balance = balance_of(model, force_n, force, exciter, held_inputs, held, samples)
    return response_of(
        balance,
        force_n,
        force,
        (low, high),
        points=points,
        largest_range_use=largest_range_use,
        notes=lambda every: notes_of(model, every, force, exciter, held_inputs),
        more=more,
    )


def pnlss_steady_state(
    model: PnlssModel,
    force_n: float,
    frequency_hz: float,
    *,
    force: Held = "fundamental",
    exciter: Exciter | None = None,
    held_inputs: Mapping[str, float] | None = None,
    harmonics: int = 7,
    samples: int | None = None,
    near: SteadyStates | None = None,
    largest_range_use: float = 3.0,
) -> SteadyStates:
    """Compute the periodic vibration at one force and frequency: reached from rest as the force rises, or ``near`` another.

    Parameters are those of `pnlss_response`. Newton's method starts from the first point of ``near`` and may leave the
    trained range. Raises `IdentificationError` if no vibration is found.
    """
    at_hz = positive("frequency_hz", frequency_hz, "Hz")
    held, _ = harmonics_that_fit(model, harmonics, at_hz)
    balance = balance_of(model, force_n, force, exciter, held_inputs, held, samples)
    return steady_state_of(balance, at_hz, force_n, near, largest_range_use)


def notes_of(
    model: PnlssModel,
    points: SteadyStates,
    force: str,
    exciter: Exciter | None,
    held_inputs: Mapping[str, float] | None = None,
) -> tuple[str, ...]:
    """Return notes on the held quantity, harmonics at the peak, use of the trained range, and losses of stability but folds."""
    first = held_notes(model, force, exciter, held_inputs)
    return (*first, *harmonics_notes(points), *_range(points), *loss_notes(points))


def _range(points: SteadyStates) -> list[str]:
    notes = []
    for name, use in (("states", points.state_use), ("input", points.input_use)):
        largest = float(np.max(largest_use(use), initial=0.0))
        if np.isnan(largest):
            notes.append(f"the range of the {name} in the training data is unknown")
        elif largest > 1.0:
            notes.append(
                f"the {name} reach{'' if name == 'states' else 'es'} {largest:.2f} times the training data: extrapolated"
            )
    return notes
