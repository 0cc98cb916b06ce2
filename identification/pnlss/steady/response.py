"""Frequency responses and single periodic vibrations of nonlinear state-space models at constant force."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.pnlss.model import PnlssModel
from identification.pnlss.steady.balance import Balance, samples_for
from identification.pnlss.steady.basis import Basis, real_coefficients
from identification.pnlss.steady.excitation import Held, drive_of, linear_resonance_hz
from identification.pnlss.steady.notes import notes_of
from identification.pnlss.steady.paths import Followed, followed, from_rest, polished, statically_stable
from identification.pnlss.steady.states import SteadyStates, steady_states
from identification.prediction.exciter import Exciter
from identification.prediction.steady_prediction import SteadyPrediction
from identification.validation import positive

__all__ = ["PnlssResponse", "pnlss_frequency_response", "pnlss_response", "pnlss_steady_state"]

Float = NDArray[np.float64]

_BAND = (0.85, 1.15)
_STEP = 0.1


@dataclass(frozen=True, eq=False, kw_only=True)
class PnlssResponse:
    """Frequency response of a nonlinear state-space model at constant force, with all harmonics.

    Parameters
    ----------
    force_n, force
        What is held, as in `SteadyPrediction`.
    points, folds
        The vibrations along the curve, and those where it turns back in frequency.
    branch
        int[n], 0 for the response that begins at the lowest frequency; 1 for the part that was reached from the highest,
        where the first did not get there.
    notes
        What a user should know about these numbers, one line each.
    """

    force_n: float
    force: str
    points: SteadyStates
    folds: SteadyStates
    branch: NDArray[np.int64]
    notes: tuple[str, ...]

    @property
    def prediction(self) -> SteadyPrediction:
        """The fundamental harmonics; the modal amplitude is unknown, for no mode shape is needed."""
        count, folds = self.points.count, self.folds.count
        return SteadyPrediction(
            force_n=self.force_n,
            force=self.force,
            channels=self.points.channels,
            frequency_hz=self.points.frequency_hz,
            modal_amplitude=np.full(count, np.nan),
            fundamental_n=np.abs(self.points.force_n[:, 1]),
            displacement_m=self.points.displacement_m[:, 1],
            stable=self.points.stable,
            branch=self.branch,
            range_use=np.asarray(self.points.range_use),
            fold_frequency_hz=self.folds.frequency_hz,
            fold_amplitude_m=np.abs(self.folds.displacement_m[:, 1, 0]),
            fold_modal_amplitude=np.full(folds, np.nan),
            notes=self.notes,
        )


def pnlss_frequency_response(
    model: PnlssModel,
    force_n: float,
    *,
    force: Held = "fundamental",
    exciter: Exciter | None = None,
    lowest_hz: float | None = None,
    highest_hz: float | None = None,
    harmonics: int = 7,
    samples: int | None = None,
    points: int = 1000,
    largest_range_use: float = 3.0,
) -> SteadyPrediction:
    """Steady response of a model to a constant force, through its folds; `pnlss_response` with the fundamentals alone."""
    return pnlss_response(
        model,
        force_n,
        force=force,
        exciter=exciter,
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
    lowest_hz: float | None = None,
    highest_hz: float | None = None,
    harmonics: int = 7,
    samples: int | None = None,
    points: int = 1000,
    largest_range_use: float = 3.0,
) -> PnlssResponse:
    """Steady response of a model to a constant force, by harmonic balance and arc-length continuation.

    Parameters
    ----------
    model
        Driven by one force, or by one voltage with the force among its outputs; one output at least is a motion.
    force_n
        Force held, N: the peak of its fundamental, or its RMS where ``force`` is ``rms``; the voltage's amplitude, V, where it
        is ``voltage``.
    force
        What "constant" means. ``pure-sine``: a force without harmonics, for a model driven by a force; its only choice
        without ``exciter``. ``fundamental`` or ``rms`` of a force with the harmonics that the exciter gives it, no static
        one. ``voltage``: a sine of constant voltage at the exciter.
    exciter
        For models driven by a force: the exciter that makes it, and is moved by the model's drive point.
    lowest_hz, highest_hz
        Band; by default 15 % about the resonance of the model's linear part that moves the drive point most.
    harmonics, samples
        Harmonics beside the static one, fewer (with a note) where the sample rate has not room for them; samples of a
        period, by default enough that polynomials fold nothing into the harmonics kept.
    points
        Most points on a branch.
    largest_range_use
        Use of the states' trained range beyond which a path is not followed; a note says so.

    Raises
    ------
    IdentificationError
        On a model, exciter and force that do not go together, a band that is none, too few samples; and if no periodic
        vibration is found at either end of the band.
    """
    low, high = _band(model, lowest_hz, highest_hz)
    held, more = _fitting(model, harmonics, high)
    balance = _balance(model, force_n, force, exciter, held, samples)
    allowed = positive("largest_range_use", largest_range_use)
    if points < 2:
        raise IdentificationError(f"points: is {points}, needs at least 2")
    found: list[Followed] = []
    for begin, end in ((low, high), (high, low)):
        path = followed(balance, begin, end, points=points, step=_STEP, largest_use=allowed)
        if path is None:
            more.append(f"at {begin:.4g} Hz no vibration was found that rest leads to within the range allowed")
            continue
        found.append(path)
        if not path.note:
            break
        more.append(path.note)
    if not found:
        raise IdentificationError(
            f"force_n: at {force_n:g} {'V' if force == 'voltage' else 'N'} the model has no periodic vibration at {low:.4g} "
            f"or {high:.4g} Hz that rest leads to within {allowed:g} times the range of its training data"
        )
    states = [_along(balance, each) for each in found]
    every = states[0] if len(states) == 1 else states[0].joined(states[1])
    folds = [_turns(balance, each) for each in found]
    return PnlssResponse(
        force_n=float(force_n),
        force=force,
        points=every,
        folds=folds[0] if len(folds) == 1 else folds[0].joined(folds[1]),
        branch=np.repeat(np.arange(len(states)), [each.count for each in states]),
        notes=(*notes_of(model, every, force, exciter), *more),
    )


def pnlss_steady_state(
    model: PnlssModel,
    force_n: float,
    frequency_hz: float,
    *,
    force: Held = "fundamental",
    exciter: Exciter | None = None,
    harmonics: int = 7,
    samples: int | None = None,
    near: SteadyStates | None = None,
    largest_range_use: float = 3.0,
) -> SteadyStates:
    """The periodic vibration at one force and frequency: that which rest leads to as the force rises, or one ``near`` another.

    Parameters are those of `pnlss_response`; of ``near`` the first point is the start of Newton's method, which may leave the
    range. Raises `IdentificationError` if it finds none.
    """
    at_hz = positive("frequency_hz", frequency_hz, "Hz")
    held, _ = _fitting(model, harmonics, at_hz)
    balance = _balance(model, force_n, force, exciter, held, samples)
    if near is None:
        z = from_rest(balance, at_hz, largest_range_use)
    else:
        z = polished(balance, _unknowns(balance, near), at_hz)
    if z is None:
        raise IdentificationError(f"frequency_hz: no periodic vibration was found at {at_hz:g} Hz and {force_n:g}")
    stable = np.array([statically_stable(balance, z, at_hz)])
    return steady_states(balance, z[None], np.array([at_hz]), stable)


def _balance(
    model: PnlssModel, level: float, force: Held, exciter: Exciter | None, harmonics: int, samples: int | None
) -> Balance:
    least = 2 * harmonics + 1
    count = samples_for(model, harmonics) if samples is None else samples
    if count < least:
        raise IdentificationError(f"samples: is {count}, needs at least {least} for {harmonics} harmonics")
    basis = Basis(harmonics, count)
    return Balance(model, drive_of(model, level, force, exciter, basis.size), basis)


def _band(model: PnlssModel, lowest_hz: float | None, highest_hz: float | None) -> tuple[float, float]:
    if lowest_hz is None or highest_hz is None:
        resonance = linear_resonance_hz(model)
        lowest_hz = _BAND[0] * resonance if lowest_hz is None else lowest_hz
        highest_hz = _BAND[1] * resonance if highest_hz is None else highest_hz
    half = 0.5 * model.sample_rate_hz
    if not 0.0 < lowest_hz < highest_hz < half:
        raise IdentificationError(
            f"lowest_hz, highest_hz: are {lowest_hz:g} and {highest_hz:g} Hz, need to rise between 0 and {half:g} Hz"
        )
    return float(lowest_hz), float(highest_hz)


def _fitting(model: PnlssModel, harmonics: int, highest_hz: float) -> tuple[int, list[str]]:
    """Harmonics that the sample rate has room for, with a note where they are fewer than asked for."""
    if harmonics < 1:
        raise IdentificationError(f"harmonics: is {harmonics}, needs at least 1")
    room = int(np.ceil(0.5 * model.sample_rate_hz / highest_hz)) - 1
    if room < 1:
        raise IdentificationError(
            f"frequency_hz: {highest_hz:g} Hz is not below half the model's {model.sample_rate_hz:g} Hz"
        )
    if room >= harmonics:
        return harmonics, []
    return room, [
        f"{room} harmonics, for which the model's {model.sample_rate_hz:g} Hz has room at {highest_hz:.4g} Hz"
    ]


def _unknowns(balance: Balance, near: SteadyStates) -> Float:
    """Unknowns of the first point of other steady states, as far as their harmonics go."""
    size = balance.basis.size

    def fitted(harmonics: NDArray[np.complex128]) -> Float:
        given = real_coefficients(harmonics)[:size]
        return np.concatenate([given, np.zeros((size - len(given), given.shape[1]))])

    states, inputs, voltage = fitted(near.states[0]), fitted(near.inputs[0]), complex(near.voltage_v[0])
    own = np.zeros(balance.drive.size)
    if own.size == 1:
        own[0] = voltage.real
    elif own.size:
        row = next(row for row, channel in enumerate(balance.model.inputs) if channel.role == "force")
        own[:] = [*inputs[1:, row], voltage.real, -voltage.imag]
    return np.concatenate([states.ravel(), own])


def _along(balance: Balance, found: Followed) -> SteadyStates:
    path = found.path
    return steady_states(balance, path.unknowns, path.parameter, path.direction * path.direction[0] > 0.0)


def _turns(balance: Balance, found: Followed) -> SteadyStates:
    path = found.path
    none = np.zeros(path.turning_parameter.size, dtype=bool)
    return steady_states(balance, path.turning_unknowns, path.turning_parameter, none)
