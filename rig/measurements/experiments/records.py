"""Records without a whole number of periods as experiments: sweeps and settled points."""

from collections.abc import Iterator

import numpy as np

from identification import Experiment, decimated
from identification.experiments import InitialState
from identification.signals import EDGE_SAMPLES
from rig.campaigns.evaluation.lost_samples import lost_rows
from rig.campaigns.evaluation.point import Point, spectrum_of, vibration_of
from rig.measurements.experiments.signals import Signals

AT_REST = 0.01
"""Largest RMS in the first period of a record that begins at rest, relative to the largest value of the signal."""
FEWEST_PERIODS = 8
"""Fewest periods of a useful settled point: some of them are needed to estimate the initial state."""
SHORTEST_PIECE = 20
"""Shortest length of a piece of a sweep, in periods of the sweep's first frequency."""


def segment(
    signals: Signals, point: Point[object], rows: np.ndarray, *, rate_hz: float, periods: int, name: str
) -> Experiment | None:
    """Return the first periods of a settled point, from its longest stretch without lost samples; None if it is too short.

    The state before the first sample has to be estimated.
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
    level = vibration_of(point).force_n
    return signals.experiment(slow, rate_hz, initial_state="estimated", name=name, level=level)


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
    """Yield a whole sweep, or its pieces between lost samples, beginning at rest or in an estimated state.

    ``before`` is the number of rows that lead to the sweep; they are simulated but do not count in errors. ``level`` is the
    level in the plan.
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
        slow = _slower(signals, signals.without_high_pass(values), rate_hz, begins_at_rest=rest)
        called = name if len(pieces) == 1 else f"{name}, piece {number}"
        state: InitialState = "zero" if rest else "estimated"
        ahead = round(max(0, before - piece.start) * rate_hz / fs)
        yield signals.experiment(slow, rate_hz, initial_state=state, name=called, level=level, counted_from=ahead)


def _stretches(rows: np.ndarray) -> list[slice]:
    """Return the stretches of rows between lost samples, in the order of time."""
    sound = np.concatenate([[False], ~lost_rows(rows), [False]])
    ends = np.flatnonzero(np.diff(sound.astype(np.int8)))
    return [slice(int(first), int(end)) for first, end in zip(ends[::2], ends[1::2], strict=True)]


def _slower(signals: Signals, values: np.ndarray, rate_hz: float, *, begins_at_rest: bool) -> np.ndarray:
    """Remove the skew and decimate; drop the ends that the filters have spoilt. A beginning at rest is not spoilt."""
    fs = signals.bench.sample_rate_hz
    values, spoilt = signals.in_step(values)
    values = values[:, 0 if begins_at_rest else spoilt : values.shape[1] - spoilt]
    edge = EDGE_SAMPLES if rate_hz != fs else 0
    if values.shape[1] * rate_hz / fs <= 2 * edge + 1:
        return values[:, :0]
    slow = decimated(values, fs, rate_hz)
    return slow[:, 0 if begins_at_rest else edge : slow.shape[1] - edge]
