"""Frequency responses and single periodic vibrations of structured models at constant force."""

import numpy as np

from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.harmonic_balance.assembly import response_of, steady_state_of
from identification.harmonic_balance.basis import Basis
from identification.harmonic_balance.notes import harmonics_notes, held_notes, loss_notes
from identification.harmonic_balance.setting_up import Held, band_around, drive_of, held_values
from identification.harmonic_balance.states import PnlssResponse, SteadyStates, largest_use
from identification.models.structured.model import StructuredModel
from identification.models.structured.steady.balance import StructuredBalance
from identification.prediction.steady_prediction import SteadyPrediction
from identification.validation import positive

_SAMPLES = 32
"""Samples of a period per harmonic: dampers and springs have bends."""
_LEAST_SAMPLES = 256


def structured_frequency_response(
    model: StructuredModel,
    force_n: float,
    *,
    force: Held = "pure-sine",
    exciter: Exciter | None = None,
    support: bool | None = None,
    lowest_hz: float | None = None,
    highest_hz: float | None = None,
    harmonics: int = 7,
    samples: int | None = None,
    points: int = 1000,
    largest_range_use: float = 3.0,
) -> SteadyPrediction:
    """Compute the steady response of a model to a constant force, through its folds: fundamentals of `structured_response`."""
    return structured_response(
        model,
        force_n,
        force=force,
        exciter=exciter,
        support=support,
        lowest_hz=lowest_hz,
        highest_hz=highest_hz,
        harmonics=harmonics,
        samples=samples,
        points=points,
        largest_range_use=largest_range_use,
    ).prediction


def structured_response(
    model: StructuredModel,
    force_n: float,
    *,
    force: Held = "pure-sine",
    exciter: Exciter | None = None,
    support: bool | None = None,
    lowest_hz: float | None = None,
    highest_hz: float | None = None,
    harmonics: int = 7,
    samples: int | None = None,
    points: int = 1000,
    largest_range_use: float = 3.0,
) -> PnlssResponse:
    """Compute the steady response of a model to a constant force, by harmonic balance and arc-length continuation.

    The balance is that of the continuous equation of motion. Result and notes are those of `pnlss_response`; ``states`` are the
    modal coordinates, ``state_use`` the largest displacement of each element over its largest in the training data (over its
    reach if that is unknown), and the multipliers are those over a period. Stability does not consider the memory of the
    support's filter.

    Parameters
    ----------
    model
        Model of one force; at least one output is a motion.
    force_n
        Held force, N: the peak of its fundamental, or its RMS if ``force`` is ``rms``. The amplitude of the voltage, V, if
        ``force`` is ``voltage``.
    force
        Quantity that is constant. ``pure-sine``: a force without harmonics; the only choice without ``exciter``.
        ``fundamental`` or ``rms``: that of a force with the harmonics that the exciter causes. ``voltage``: a sine of constant
        voltage at the exciter.
    exciter
        Exciter that applies the force and moves with the model's drive point.
    support
        Whether the support holds the mean position, with the static force of the exciter. By default it does with an
        ``exciter``; a pure sine has no static part.
    lowest_hz, highest_hz
        Band; by default within 15 % of the mode of small vibrations with the largest drive-point motion.
    harmonics, samples
        Numbers of harmonics without the static one, and of samples per period; by default 32 per harmonic, at least 256.
    points
        Largest number of points on a branch.
    largest_range_use
        Largest ``state_use``; a path that exceeds it ends there, with a note.

    Raises
    ------
    IdentificationError
        If model, exciter and force do not match, the band limits do not rise, there are too few samples, or no periodic
        vibration is found at either end of the band.
    """
    band_hz = band_around(lambda: resonance_hz(model), lowest_hz, highest_hz, np.inf)
    return response_of(
        balance_of(model, force_n, force, exciter, support, harmonics, samples),
        force_n,
        force,
        band_hz,
        points=points,
        largest_range_use=largest_range_use,
        notes=lambda every: [
            *held_notes(model, force, exciter),
            *harmonics_notes(every),
            *_range_notes(model, every),
            *loss_notes(every),
        ],
    )


def structured_steady_state(
    model: StructuredModel,
    force_n: float,
    frequency_hz: float,
    *,
    force: Held = "pure-sine",
    exciter: Exciter | None = None,
    support: bool | None = None,
    harmonics: int = 7,
    samples: int | None = None,
    near: SteadyStates | None = None,
    largest_range_use: float = 3.0,
) -> SteadyStates:
    """Compute the periodic vibration at one force and frequency: reached from rest as the force rises, or ``near`` another.

    Parameters are those of `structured_response`. Newton's method starts from the first point of ``near`` and may exceed
    ``largest_range_use``. Raises `IdentificationError` if no vibration is found.
    """
    at_hz = positive("frequency_hz", frequency_hz, "Hz")
    balance = balance_of(model, force_n, force, exciter, support, harmonics, samples)
    return steady_state_of(balance, at_hz, force_n, near, largest_range_use)


def balance_of(
    model: StructuredModel,
    level: float,
    force: Held,
    exciter: Exciter | None,
    support: bool | None,
    harmonics: int,
    samples: int | None,
) -> StructuredBalance:
    """Return the equations; raise `IdentificationError` for what `structured_response` refuses."""
    if harmonics < 1:
        raise IdentificationError(f"harmonics: is {harmonics}, needs at least 1")
    count = max(_SAMPLES * harmonics, _LEAST_SAMPLES) if samples is None else samples
    if count < 2 * harmonics + 1:
        raise IdentificationError(f"samples: is {count}, needs at least {2 * harmonics + 1} for {harmonics} harmonics")
    basis = Basis(harmonics, count)
    row, _ = held_values(model, None)
    supported = exciter is not None if support is None else support
    return StructuredBalance(model, drive_of(model, level, force, exciter, basis.size, row), basis, supported)


def resonance_hz(model: StructuredModel, near_hz: float | None = None) -> float:
    """Frequency of a mode of small vibrations: the nearest one, or that which moves most at the first input."""
    at_rest = model.linearised()
    if near_hz is not None:
        return float(at_rest.frequency_hz[np.argmin(np.abs(at_rest.frequency_hz - near_hz))])
    compliance = at_rest.input_shapes[:, 0] ** 2 / (at_rest.damping_ratio * at_rest.omega**2)
    return float(at_rest.frequency_hz[int(np.argmax(compliance))])


def _range_notes(model: StructuredModel, points: SteadyStates) -> list[str]:
    largest = float(np.max(largest_use(points.state_use), initial=0.0))
    known = all(element.largest for element in model.elements)
    of = "the training data" if known else "the reach of their laws"
    return [f"elements reach {largest:.2f} times {of}: extrapolated"] if largest > 1.0 else []
