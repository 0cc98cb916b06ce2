"""The true force of a run on a virtual rig: its recorded output drives the same rig again, without sensor noise."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.bench import Bench
from rig.drivers.virtual.driver import Queue
from rig.measurements import bench_of_recording
from rig.recording.parts import Part
from rig.recording.reader import Recording
from simulators import Simulation, VirtualRig

HIGHEST = 31
BELOW_NYQUIST = 0.45  # of the sample rate: highest harmonic of the fit


@dataclass(frozen=True)
class TruePoint:
    """A point of a recording, and the true motion under the output that was recorded with it."""

    point: dict[str, Any]
    """The point as recorded."""
    force_n: NDArray[np.complex128]
    """Harmonics of the true force in the oscillator's phase, from the mean (entry 0) on."""
    drive_m: NDArray[np.complex128]
    """Harmonics of the true displacement of the stinger's point."""
    smallest_n: float
    """A tenth of a bit of the converter, as force."""

    def ratios(self, highest: int = 7) -> NDArray[np.complex128]:
        """Return harmonics 2 to ``highest`` relative to the fundamental; a real one has a peak where the fundamental has."""
        turn = self.force_n[1] / abs(self.force_n[1])
        orders = np.arange(2, highest + 1)
        return np.asarray(self.force_n[2 : highest + 1] / (abs(self.force_n[1]) * turn**orders))

    def allowed(self, share: float = 0.002) -> float:
        """Return what a harmonic may be off, relative to the fundamental: ``share``, or a tenth of a converter bit."""
        return float(max(share, self.smallest_n / abs(self.force_n[1])))


def virtual_rig(bench: Bench, *, silent: bool = True) -> VirtualRig:
    """Return the rig of a virtual bench, ``silent`` without noise."""
    table = {key: value for key, value in bench.driver.options.items() if key not in Queue.model_fields}
    converter = {"sample_rate_hz": bench.sample_rate_hz, "dac_range_v": bench.output_range_v}
    table["converter"] = converter | table.get("converter", {})
    return VirtualRig.model_validate(table | ({"noise_scale": 0.0} if silent else {}))


def true_points(
    recording: Recording, seed: int, *, bench: Bench | None = None, last_periods: float = math.inf
) -> list[TruePoint]:
    """Return the accepted points of all parts, by their ``last_periods``; ``bench`` is the virtual rig's, behind a device."""
    known = bench_of_recording(recording) if bench is None else bench
    return [true for part in recording.parts for true in _of_part(part, known, seed, last_periods)]


def _of_part(part: Part, bench: Bench, seed: int, last_periods: float) -> list[TruePoint]:
    rig = virtual_rig(bench)
    output_v = part.rows("output_v").astype(float)  # on the converter up to the row's instant
    series = Simulation(rig, seed=seed).run(np.append(output_v[1:], output_v[-1]))
    theta = part.rows("theta_rad").astype(float)
    force = bench.channels[bench.index_of("force")]
    bit_n = force.resolution_v / abs(force.sensitivity_v_per_unit)
    out = []
    for point in part.points:
        if not point["accepted"]:
            continue
        end = point["end_sample"] - (part.first_sample or 0)
        first = point["first_sample"] - (part.first_sample or 0)
        rows = slice(round(max(first, end - last_periods * bench.sample_rate_hz / point["frequency_hz"])), end)
        values = np.stack([series.force_n[rows], series.displacement_m[rig.stinger.at][rows]])
        highest = min(HIGHEST, int(BELOW_NYQUIST * bench.sample_rate_hz / point["frequency_hz"]))
        harmonics = fitted(theta[rows], values, highest)
        out.append(TruePoint(point, harmonics[0], harmonics[1], 0.1 * bit_n))
    return out


def fitted(theta_rad: NDArray[np.float64], values: NDArray[np.float64], highest: int) -> NDArray[np.complex128]:
    """Return the harmonics 0 to ``highest`` of signals [m, n] over a phase, by least squares."""
    turns = np.exp(1j * np.outer(theta_rad, np.arange(1, highest + 1)))
    matrix = np.hstack([np.ones((theta_rad.size, 1)), turns.real, -turns.imag])
    found = np.linalg.lstsq(matrix, values.T)[0].T
    return np.hstack([found[:, :1], found[:, 1 : highest + 1] + 1j * found[:, highest + 1 :]])
