"""Frequency responses and single periodic vibrations of nonlinear state-space models at constant force."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from identification.channels import MOTION_ORDER
from identification.errors import IdentificationError
from identification.pnlss.model import PnlssModel
from identification.pnlss.steady.balance import Balance
from identification.pnlss.steady.paths import Followed, followed, from_rest, polished, statically_stable
from identification.pnlss.steady.setting_up import Held, balance_of, band_of, harmonics_that_fit, unknowns_near
from identification.pnlss.steady.states import PnlssResponse, SteadyStates, largest_use, motion_rows, steady_states
from identification.prediction.exciter import Exciter
from identification.prediction.steady_prediction import SteadyPrediction
from identification.validation import positive

__all__ = ["notes_of", "pnlss_frequency_response", "pnlss_response", "pnlss_steady_state"]

Float = NDArray[np.float64]

_STEP = 0.05


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
        notes=(*notes_of(model, every, force, exciter, held_inputs), *_at_the_edge(every, low, high), *more),
        complete=not any(each.note for each in found),
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
    if near is None:
        z = from_rest(balance, at_hz, largest_range_use)
    else:
        z = polished(balance, unknowns_near(balance, near), at_hz)
    if z is None:
        raise IdentificationError(f"frequency_hz: no periodic vibration was found at {at_hz:g} Hz and {force_n:g}")
    stable = np.array([statically_stable(balance, z, at_hz)])
    return steady_states(balance, z[None], np.array([at_hz]), stable)


def _along(balance: Balance, found: Followed) -> SteadyStates:
    path = found.path
    return steady_states(balance, path.unknowns, path.parameter, path.direction * path.direction[0] > 0.0)


def _at_the_edge(points: SteadyStates, low: float, high: float) -> list[str]:
    """Return a note if the largest amplitude is at an end of the band."""
    at_hz = points.frequency_hz[int(np.argmax(np.abs(points.displacement_m[:, 1, 0])))]
    return ["the largest amplitude is at an end of the band: widen it"] if at_hz in (low, high) else []


def _turns(balance: Balance, found: Followed) -> SteadyStates:
    path = found.path
    none = np.zeros(path.turning_parameter.size, dtype=bool)
    return steady_states(balance, path.turning_unknowns, path.turning_parameter, none)


def notes_of(
    model: PnlssModel,
    points: SteadyStates,
    force: str,
    exciter: Exciter | None,
    held_inputs: Mapping[str, float] | None = None,
) -> tuple[str, ...]:
    """Return notes on the held quantity, harmonics at the peak, use of the trained range, and losses of stability but folds."""
    constant = [f"input '{name}' is held at {value:g}" for name, value in (held_inputs or {}).items()]
    return (*_held(model, force, exciter), *constant, *_harmonics(points), *_range(points), *_losses(points))


def _held(model: PnlssModel, force: str, exciter: Exciter | None) -> list[str]:
    where = f" of the exciter{f' ({exciter.source})' if exciter.source else ''}" if exciter else " at the model's input"
    voltage_driven = exciter is None and not any(channel.role == "force" for channel in model.inputs)
    maker = "the exciter inside the model" if voltage_driven else "the exciter"
    return {
        "pure-sine": ["held: a force without harmonics"],
        "fundamental": [f"held: the force's fundamental; its harmonics are those that {maker} makes"],
        "rms": [f"held: the RMS of the force; its harmonics are those that {maker} makes"],
        "voltage": [f"held: the amplitude of a sine of voltage{where}"],
    }[force]


def _harmonics(points: SteadyStates) -> list[str]:
    """Return notes on the harmonics of force and motion at the largest amplitude."""
    peak = int(np.argmax(np.abs(points.displacement_m[:, 1, 0])))
    row = motion_rows(points.output_channels)[0]
    order = MOTION_ORDER[points.output_channels[row].motion]
    h = np.arange(1, points.outputs.shape[1])
    motion, force = np.abs(points.outputs[peak, 1:, row]) / h**order, np.abs(points.force_n[peak, 1:])
    notes = [
        f"at the peak harmonics 2 to {h[-1]} are {100.0 * np.linalg.norm(motion[1:]) / motion[0]:.2g} % of the "
        "displacement's fundamental"
    ]
    if h.size > 1 and force[1] > 0.0:
        notes.append(f"at the peak F2/F1 is {force[1] / force[0]:.2g}")
    return notes if h.size > 1 else []


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


def _losses(points: SteadyStates) -> list[str]:
    notes = []
    for kind, what in (("period doubling", "the period doubles"), ("Neimark-Sacker", "the amplitude is modulated")):
        at = [hz for hz, loss in zip(points.frequency_hz.tolist(), points.loss, strict=True) if loss == kind]
        if at:
            notes.append(f"{kind}: from {min(at):.4g} to {max(at):.4g} Hz the vibration is unstable, {what}")
    return notes
