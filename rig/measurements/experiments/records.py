"""Records that are no whole periods as experiments: sweeps, and the settled points of everything that is held or locked."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from identification import decimated
from identification.pnlss.experiment import Experiment, InitialState
from identification.signals.decimation import EDGE_SAMPLES
from rig.campaigns.evaluation.lost_samples import lost_rows
from rig.campaigns.evaluation.point import Point, spectrum_of, vibration_of
from rig.measurements.experiments.signals import Signals

__all__ = ["segment", "sweep_pieces"]

AT_REST = 0.01
"""Share of its largest value that a signal may have, RMS, in the first period of a record that begins at rest."""
FEWEST_PERIODS = 8
"""Periods without which a settled point says nothing: its initial state takes some, and is to be known."""
SHORTEST_PIECE = 20
"""Periods of a sweep's first frequency that a piece of it has at least."""


def segment(
    signals: Signals, point: Point[Any], rows: np.ndarray, *, rate_hz: float, periods: int, name: str
) -> Experiment | None:
    """The first so many periods of a settled point, in its longest stretch without lost samples; None if that is too short.

    Its state before the first sample is to be estimated.
    """
    fs, frequency_hz = signals.bench.sample_rate_hz, vibration_of(point).frequency_hz
    static = spectrum_of(point).harmonics[:, 0].real
    whole = max(_stretches(rows), key=lambda piece: piece.stop - piece.start, default=slice(0, 0))
    values = signals.of(rows[whole])
    offset = signals.offset
    values[offset] -= static[offset[:-1], None]
    wanted = round(periods * rate_hz / frequency_hz)
    enough = wanted * fs / rate_hz + 4 * EDGE_SAMPLES * fs / rate_hz + 2 * (EDGE_SAMPLES + np.abs(signals.skew).max())
    slow = _slower(signals, values[:, : int(enough)], rate_hz, begins_at_rest=False)[:, :wanted]
    if slow.shape[1] < FEWEST_PERIODS * rate_hz / frequency_hz:
        return None
    return _experiment(signals, slow, rate_hz, "estimated", name, vibration_of(point).force_n)


def sweep_pieces(
    signals: Signals,
    level: float,
    rows: np.ndarray,
    before: int,
    *,
    start_hz: float,
    rate_hz: float,
    name: str,
) -> Iterator[Experiment]:
    """A whole sweep, or its pieces between lost samples; from rest where it begins there, else from an estimated state.

    ``before``: how many of the rows lead to the sweep; they are simulated and do not count. ``level``: that of the plan.
    """
    fs = signals.bench.sample_rate_hz
    shortest = SHORTEST_PIECE * fs / start_hz
    pieces = [piece for piece in _stretches(rows) if piece.stop - max(piece.start, before) >= shortest]
    offset = signals.offset
    for number, piece in enumerate(pieces, 1):
        values = signals.of(rows[piece])
        values[offset] -= values[offset].mean(axis=1, keepdims=True)
        used = values[[*signals.inputs, *signals.outputs]]
        first = used[:, : int(fs / start_hz)].std(axis=1)
        rest = bool(np.all(first <= AT_REST * np.abs(used).max(axis=1)))
        slow = _slower(signals, values, rate_hz, begins_at_rest=rest)
        called = name if len(pieces) == 1 else f"{name}, piece {number}"
        found = _experiment(signals, slow, rate_hz, "zero" if rest else "estimated", called, level)
        yield replace(found, counted_from=round(max(0, before - piece.start) * rate_hz / fs))


def _stretches(rows: np.ndarray) -> list[slice]:
    """Stretches of rows between lost samples, in the order of time."""
    sound = np.concatenate([[False], ~lost_rows(rows), [False]])
    ends = np.flatnonzero(np.diff(sound.astype(np.int8)))
    return [slice(int(first), int(end)) for first, end in zip(ends[::2], ends[1::2], strict=True)]


def _slower(signals: Signals, values: np.ndarray, rate_hz: float, *, begins_at_rest: bool) -> np.ndarray:
    """In step and decimated, without the ends that filters have spoilt; a beginning at rest is not spoilt."""
    fs = signals.bench.sample_rate_hz
    values, spoilt = signals.in_step(values)
    values = values[:, 0 if begins_at_rest else spoilt : values.shape[1] - spoilt]
    edge = EDGE_SAMPLES if rate_hz != fs else 0
    if values.shape[1] * rate_hz / fs <= 2 * edge + 1:
        return values[:, :0]
    slow = decimated(values, fs, rate_hz)
    return slow[:, 0 if begins_at_rest else edge : slow.shape[1] - edge]


def _experiment(
    signals: Signals, values: np.ndarray, rate_hz: float, state: InitialState, name: str, level: float
) -> Experiment:
    return Experiment(
        inputs=values[list(signals.inputs)],
        outputs=values[list(signals.outputs)],
        sample_rate_hz=rate_hz,
        input_channels=signals.input_channels,
        output_channels=signals.output_channels,
        initial_state=state,
        name=name,
        level=level,
        specimen=signals.bench.specimen.name,
    )
