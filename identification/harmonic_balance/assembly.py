"""Frequency responses and single vibrations from a harmonic balance, whatever model it describes."""

from collections.abc import Callable, Sequence

import numpy as np

from identification.errors import IdentificationError
from identification.harmonic_balance.driven import DrivenBalance
from identification.harmonic_balance.notes import edge_notes
from identification.harmonic_balance.paths import Followed, followed, from_rest, polished, statically_stable
from identification.harmonic_balance.setting_up import Held, unknowns_near
from identification.harmonic_balance.states import HarmonicResponse, SteadyStates, steady_states
from identification.validation import positive

_STEP = 0.05


def response_of(
    balance: DrivenBalance,
    force_n: float,
    force: Held,
    band_hz: tuple[float, float],
    *,
    points: int,
    largest_range_use: float,
    notes: Callable[[SteadyStates], Sequence[str]],
    more: Sequence[str] = (),
) -> HarmonicResponse:
    """Return the response over a band, from below and, where that does not reach the far end, also from above.

    ``notes`` gives the notes on all points; ``more`` are further notes. Raises `IdentificationError` if ``points`` or
    ``largest_range_use`` are not allowed, or if no vibration is found at either end.
    """
    allowed = positive("largest_range_use", largest_range_use)
    IdentificationError.unless_at_least("points", points, 2)
    (low, high), more, found = band_hz, list(more), list[Followed]()
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
            f"at {force_n:g} {('V' if force == 'voltage' else 'N')} the model has no periodic vibration at "
            f"{low:.4g} or {high:.4g} Hz that rest leads to within {allowed:g} times its range",
            field="force_n",
        )
    states = [_along(balance, each) for each in found]
    every = states[0] if len(states) == 1 else states[0].joined(states[1])
    folds = [_turns(balance, each) for each in found]
    return HarmonicResponse(
        force_n=float(force_n),
        force=force,
        points=every,
        folds=folds[0] if len(folds) == 1 else folds[0].joined(folds[1]),
        branch=np.repeat(np.arange(len(states)), [each.count for each in states]),
        notes=(*notes(every), *edge_notes(every, *band_hz), *more),
        complete=not any(each.note for each in found),
    )


def steady_state_of(
    balance: DrivenBalance, at_hz: float, force_n: float, near: SteadyStates | None, largest_range_use: float
) -> SteadyStates:
    """Return the vibration at a frequency: reached from rest as the force rises, or ``near`` another."""
    if near is None:
        z = from_rest(balance, at_hz, largest_range_use)
    else:
        z = polished(balance, unknowns_near(balance, near), at_hz)
    if z is None:
        raise IdentificationError(
            f"no periodic vibration was found at {at_hz:g} Hz and {force_n:g}", field="frequency_hz"
        )
    stable = np.array([statically_stable(balance, z, at_hz)])
    return steady_states(balance, z[None], np.array([at_hz]), stable)


def _along(balance: DrivenBalance, found: Followed) -> SteadyStates:
    path = found.path
    return steady_states(balance, path.unknowns, path.parameter, path.direction * path.direction[0] > 0.0)


def _turns(balance: DrivenBalance, found: Followed) -> SteadyStates:
    path = found.path
    none = np.zeros(path.turning_parameter.size, dtype=bool)
    return steady_states(balance, path.turning_unknowns, path.turning_parameter, none)
