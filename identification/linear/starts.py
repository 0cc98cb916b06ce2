"""Poles with which a modal fit starts: stable poles of the diagram, given frequencies, known modes, or a search.

A mode that is broad, or whose responses are distorted by a nonlinearity, has no stable column in the diagram: from order to
order its pole moves by more than the tolerances. The search then takes one pole at a time. On a grid of frequencies and damping
ratios it fits the linear terms of the modal model, with errors of equal relative size, and keeps the pole that leaves the
smallest misfit.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.errors import IdentificationError
from identification.linear.accelerance import WeightedResponses, pooled
from identification.linear.modes import LinearModes
from identification.linear.rational_fractions import misfit_of
from identification.linear.stabilisation import StabilisationDiagram
from identification.validation import finite_array
from vibrolock.arrays import Float

_NEAR = 0.05
"""A starting frequency is replaced by the nearest pole of the diagram within this relative distance."""
_DAMPING = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1)
"""Damping ratios that the search tries."""
_CLEARLY = 0.8
"""The second of them is kept unless another reduces the sum of squares to this share."""
_STEPS = 60
"""Frequencies at which a further pole is tried. Chosen."""
_MOST_LINES = 400
"""Most lines that the search looks at, evenly spread."""
_EXPLAINED = 0.7
"""The pole that the search finds must reduce the sum of squares to this share of that without a pole."""


def poles_of(modes: LinearModes, data: WeightedResponses) -> Float:
    """Return the poles of known modes in the band; raise `IdentificationError` if there is none."""
    inside = (modes.frequency_hz >= data.frequency_hz[0]) & (modes.frequency_hz <= data.frequency_hz[-1])
    if not np.any(inside):
        reason = f"none of those given is in {data.frequency_hz[0]:g} to {data.frequency_hz[-1]:g} Hz"
        raise IdentificationError(reason, field="modes")
    return np.concatenate([2.0 * np.pi * modes.frequency_hz[inside], np.abs(modes.damping_ratio[inside])])


def start_of(
    stable: StabilisationDiagram, data: WeightedResponses, wanted: Sequence[float] | None
) -> tuple[Float, list[str]]:
    """Return the initial poles (angular frequencies in rad/s, then damping ratios) and notes on how they were found.

    Raises `IdentificationError` if no pole is found or a wanted frequency is outside the band.
    """
    if wanted is not None:
        return _near(stable, data, wanted), []
    columns = stable.columns()
    if columns.size:
        return np.concatenate([2.0 * np.pi * stable.frequency_hz[columns], stable.damping_ratio[columns]]), []
    found = searched(data)
    if found is None:
        raise IdentificationError(
            f"no pole is stable over the orders in {_band(data)}, and no single pole explains the responses; "
            "give starting frequencies, a narrower band, or a recording with more periods",
            field="modes",
        )
    return found


def _band(data: WeightedResponses) -> str:
    return f"{data.frequency_hz[0]:g} to {data.frequency_hz[-1]:g} Hz"


def searched(data: WeightedResponses) -> tuple[Float, list[str]] | None:
    """Return the one pole that leaves the least misfit, and a note that says so; None if it explains too little."""
    every = slice(None, None, -(-data.frequency_hz.size // _MOST_LINES))
    power = np.abs(data.value.reshape(data.frequency_hz.size, -1)) ** 2
    # The mean over neighbours, so that a line which distortion made small does not count the most.
    around = pooled(power[:, :, None] * np.eye(power.shape[1], dtype=np.complex128))
    sparse = replace(
        data, frequency_hz=data.frequency_hz[every], value=data.value[every], covariance=None, smooth=around[every]
    )
    if sparse.frequency_hz.size < 8:
        return None
    steps_hz = np.geomspace(sparse.frequency_hz[0], sparse.frequency_hz[-1], _STEPS + 2)[1:-1]
    poles = [np.array([2.0 * np.pi * f, zeta]) for f in steps_hz for zeta in _DAMPING]
    costs = np.array([misfit_of(sparse, pole) for pole in poles])
    best = int(np.argmin(costs))
    if costs[best] >= _EXPLAINED * misfit_of(sparse, np.zeros(0)):
        return None
    return poles[best], [
        f"no modes are stable over the orders in {_band(data)}: the fit starts from the single pole that explains most, at "
        f"{poles[best][0] / (2.0 * np.pi):.4g} Hz; with starting frequencies others are found"
    ]


def _near(stable: StabilisationDiagram, data: WeightedResponses, wanted: Sequence[float]) -> Float:
    """Return one pole near each wanted frequency: that of the diagram, or the frequency with the damping that fits best."""
    near_hz = np.sort(finite_array("modes", wanted, np.float64, 1))
    if not near_hz.size or near_hz[0] < data.frequency_hz[0] or near_hz[-1] > data.frequency_hz[-1]:
        reason = f"frequencies are {', '.join(f'{f:g}' for f in near_hz) or 'none'} Hz"
        allowed = f"{data.frequency_hz[0]:g} to {data.frequency_hz[-1]:g} Hz"
        raise IdentificationError(reason, field="modes", allowed=allowed)
    frequency, damping, taken = near_hz.copy(), np.full(near_hz.size, np.nan), set[int]()
    candidates = np.flatnonzero(stable.stable)
    for number, wanted_hz in enumerate(near_hz):
        distance = np.abs(stable.frequency_hz[candidates] - wanted_hz)
        free = [i for i in np.argsort(distance) if candidates[i] not in taken and distance[i] < _NEAR * wanted_hz]
        nearest = [i for i in free if np.argmin(np.abs(near_hz - stable.frequency_hz[candidates[i]])) == number]
        if nearest:
            close = candidates[[i for i in nearest if distance[i] < 2.0 * distance[nearest[0]] + 1e-3 * wanted_hz]]
            taken |= set(close.tolist())
            frequency[number] = np.median(stable.frequency_hz[close])
            damping[number] = np.median(stable.damping_ratio[close])
    poles = np.concatenate([2.0 * np.pi * frequency, np.nan_to_num(damping, nan=_DAMPING[1])])
    for number in map(int, np.flatnonzero(np.isnan(damping))):
        trials = np.tile(poles, (len(_DAMPING), 1))
        trials[:, near_hz.size + number] = _DAMPING
        costs = np.array([misfit_of(data, trial) for trial in trials])
        if np.min(costs) < _CLEARLY * costs[1]:
            poles = trials[int(np.argmin(costs))]
    return poles
