"""Samples of runs on virtual rigs, with what the host's tick made of them: tests by three laws."""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from images import Samples, Ticked

from controller import AmplitudeLaw, preset
from rig.bench import load_bench
from rig.daq import DAQ, LOST
from rig.drivers import make_daq
from rig.firmware.signature import Arguments, arguments_for, example
from rig.tick.kernels import tick_block
from rig.tick.layout import TickArrays
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Segment, SettleRule
from rig.tick.tick import Tick, TickSettings
from vibrolock.compiled import bound

BENCH = "magnet-beam"
LAWS = ("voltage", "force", "harmonics")
"""Levels in volts; levels in newtons; and a force that is made a sine."""


class Captured(NamedTuple):
    """Samples, and what the host's tick made of them."""

    samples: Samples
    after: TickArrays
    readings: np.ndarray
    rows: np.ndarray
    outputs: np.ndarray


def tick_of(law_name: str) -> Tick:
    """Return a tick that ramps up, settles and records at two levels, in few periods."""
    law = preset(BENCH)
    changes = {"k3": 1.5, "k4": 1.0, "harmonics": {"highest": 5} if law_name == "harmonics" else None}
    law = type(law).model_validate(law.model_dump() | changes)
    by_force = law_name != "voltage"
    segments = [Segment(SegmentKind.START, -1, 0.3, 12.0, amplitude_law=AmplitudeLaw.VOLTAGE)]
    for point, level in enumerate((0.6, 1.0)):
        segments += [
            Segment(SegmentKind.RAMP, point, level * (0.2 if by_force else 1.0), 4.0),
            Segment(SegmentKind.SETTLE, point, level * (0.2 if by_force else 1.0), 12.0),
            Segment(SegmentKind.RECORD, point, level * (0.2 if by_force else 1.0), 6.0),
        ]
    amplitude = AmplitudeLaw.FORCE if by_force else AmplitudeLaw.VOLTAGE
    rule = SettleRule(average_periods=3, settled_periods=3, longest_periods=12)
    return TickSettings(load_bench(BENCH), law, amplitude, rule, segments).build(0.5)


def copy_of(arrays: TickArrays) -> TickArrays:
    """Return a copy of a tick's arrays."""
    return TickArrays(*(np.array(array, order="C") for array in arrays))


def captured(law_name: str, windows: Sequence[tuple[int, int]]) -> list[Captured]:
    """Run a test by one of `LAWS` sample by sample; return windows of it, each from a sample, of so many."""
    tick, out = tick_of(law_name), []
    one = arguments_for(tick, 1)
    run = bound(tick_block, *one)
    with make_daq(tick.bench) as daq:
        daq.start(1)
        done = 0
        for begin, n in windows:
            _run(daq, run, one, begin - done, None)
            done = begin + n
            whole = arguments_for(tick, n)
            before = copy_of(tick.arrays)
            _run(daq, run, one, n, whole)
            samples = Samples(before, whole.volts, whole.flags, whole.put_out)
            out.append(Captured(samples, copy_of(tick.arrays), whole.readings, whole.rows, whole.outputs))
    return out


def _run(daq: DAQ, run: Callable[..., None], one: Arguments, n: int, kept: Arguments | None) -> None:
    """Run n samples, one by one; keep what each was given and came to."""
    for index in range(n):
        one.volts[...], one.flags[...] = daq.exchange(one.outputs), daq.flags
        one.put_out[...] = daq.put_out
        run(*one)
        if kept is not None:
            for name in ("volts", "flags", "put_out", "readings", "rows", "outputs"):
                getattr(kept, name)[index] = getattr(one, name)[0]


def at_the_edges(samples: Samples) -> Captured:
    """Return what the host's tick makes of samples whose voltages are replaced by numbers as no converter gives them."""
    volts, flags = samples.volts.copy(), samples.flags.copy()
    for index, value in enumerate((5e-324, -1e-310, 1e-39, -1e-42, 0.0, -0.0, np.nan, np.inf, -1e308)):
        volts[10 * index + 5] = value
    flags[100:103] = LOST
    tick_arrays = copy_of(samples.before)
    like = example()._replace(t=tick_arrays)
    n, channels = volts.shape
    readings, rows, outputs = np.zeros((n, channels), np.float32), np.zeros(n, like.rows.dtype), np.zeros(n)
    for at in range(n):
        part = slice(at, at + 1)
        given = tick_arrays, volts[part], flags[part], readings[part], rows[part], outputs[part], samples.put_out[part]
        tick_block(*given, like.continuation)
    return Captured(samples._replace(volts=volts, flags=flags), tick_arrays, readings, rows, outputs)


def fields(array: np.ndarray, path: str) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the plain fields of a record array, those of inner records too."""
    if not array.dtype.names:
        yield path, array
    for name in array.dtype.names or ():
        yield from fields(array[name], f"{path}.{name}")


def differences(expected: Captured, found: Ticked) -> dict[str, float]:
    """Return the fields that differ, with the largest difference over the field's largest size; infinite for whole numbers.

    All that is no number is one: processors give it another sign.
    """
    pairs = [(name, getattr(expected.after, name), getattr(found.after, name)) for name in TickArrays._fields]
    pairs += [(name, getattr(expected, name), getattr(found, name)) for name in ("readings", "rows", "outputs")]
    out = {}
    for name, one, other in pairs:
        for (path, x), (_, y) in zip(fields(one, name), fields(other, name), strict=True):
            differs = ~((x == y) | ((x != x) & (y != y)))
            if differs.any():
                exact = not np.issubdtype(x.dtype, np.inexact) or not np.isfinite(x[differs] - y[differs]).all()
                largest = np.abs(x[np.isfinite(x)]).max()
                out[path] = np.inf if exact else float(np.abs(x - y)[differs].max() / largest)
    return out
