"""The tick as an object: builds its arrays from bench, law and plan."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller import AmplitudeLaw, Law, control_state
from controller.tuning import PlantModel
from rig.bench import Bench
from rig.errors import ConfigurationError
from rig.tick.layout import HISTORY, LOOP, ROW, TickArrays, recorded_row
from rig.tick.safety.expected import expected_record
from rig.tick.safety.kernels import is_over
from rig.tick.safety.layout import GuardMode
from rig.tick.safety.limits import guard_record, input_records, limits_record, watch_records
from rig.tick.safety.response_plausibility import PLAUSIBILITY, evaluate_exciter
from rig.tick.sequencer.judgement import SETTLING
from rig.tick.sequencer.layout import PROGRESS, SegmentKind
from rig.tick.sequencer.segments import Segment, SettleRule, highest_frequency_hz, segment_table
from vibrolock.arrays import undivided

JUDGED_AGAIN = 11.0  # periods
OFF = int(GuardMode.OFF)  # a member of an Enum is looked up slowly
SMALLEST_BITS = 0.4  # a phase can be read down to about this many converter bits of amplitude


@dataclass(frozen=True, eq=False)
class TickSettings:
    """Arguments of a tick except the device's latency, which is known later; can be passed to another process."""

    bench: Bench
    law: Law
    amplitude_law: AmplitudeLaw
    settle: SettleRule
    segments: Sequence[Segment]
    waveforms: np.ndarray | None = None
    """Waveforms of unit peak that segments can play, [n, period]."""
    exciter: PlantModel | None = None
    """A known plant: the fundamentals are checked against its exciter, and the law uses its mode shape, not the bench's."""
    retries: int = 0
    """How often a record that is refused for something that passes is measured again at most."""
    armed: bool = True
    """False keeps the output at 0 V."""
    start_judged: bool = False
    """Whether a start segment lasts until `Tick.release_start`, so that a caller can judge the vibration there."""
    near_limits: float = 1.0
    """Part of a limit of force or motion at which a level on its way up is given up; 1: none."""
    output_bit_v: float = 0.0
    """Bit of the output converter (V) whose rounding is fed back into the next output; 0: none is."""
    per_volt: tuple[float, float] | None = None
    """Force (N/V) and motion (m/s^2/V) at resonance in the last check, if there was one, for levels in volts."""

    def build(self, latency_samples: float) -> "Tick":
        """Build the tick for a device of this latency; its outputs show one block later in addition."""
        return Tick(self, self.bench.block + latency_samples)


class Tick:
    """The control state of a run.

    ``loop_delay_samples`` is the delay from an output computed by the tick to the input that shows it: the block plus the
    device's latency, including the fraction.

    Raises `ConfigurationError` if the law does not suit the bench.
    """

    def __init__(self, settings: TickSettings, loop_delay_samples: float) -> None:
        bench, law, amplitude_law = settings.bench, settings.law, settings.amplitude_law
        segments, waveforms, exciter = settings.segments, settings.waveforms, settings.exciter
        shape = bench.specimen.drive_mode_shape if exciter is None else exciter.drive_shape
        try:
            if law.harmonics is not None:
                highest_hz = highest_frequency_hz(law, segments)
                law.harmonics.check_frequency(bench.sample_rate_hz, highest_hz, loop_delay_samples)
            law_record = law.build(bench.sample_rate_hz, amplitude_law, bench.limits.voltage_v, shape)
        except ValueError as error:
            raise ConfigurationError.of(error, within="controller") from None
        if loop_delay_samples < 1.0:
            raise ConfigurationError(
                "an output shows at the next sample at the earliest",
                field="loop_delay_samples",
                value=loop_delay_samples,
            )
        lag_rad = float(law_record["frequency"]["target_lag_rad"][0])
        table, outcomes = segment_table(
            segments, bench.sample_rate_hz, amplitude_law, lag_rad, law_record["harmonics"]["wanted"][0]
        )
        force, drive = bench.index_of("force"), bench.index_of("drive")
        near_hz = bench.specimen.linear_frequency_hz
        smallest = [SMALLEST_BITS * c.resolution_in_unit for c in bench.channels]
        law_record["lock"] = law.lock.build(smallest[force], smallest[drive])
        limits = limits_record(bench, settings.near_limits)
        if law.harmonics is not None:
            controlled = bench.channels[force if law.harmonics.channel == "force" else drive]
            law_record["harmonics"]["smallest"] = controlled.negligible_amplitude
            law_record["harmonics"]["high_pass_rad_s"] = 2.0 * math.pi * controlled.corner_hz(near_hz)
            law_record["harmonics"]["step_v"] = limits["slew_v_per_sample"] / law.harmonics.highest
        loop = np.zeros(1, LOOP)
        loop["delay_whole"] = math.floor(loop_delay_samples)
        loop["delay_fraction"] = loop_delay_samples - math.floor(loop_delay_samples)
        loop["queue_whole"] = math.floor(loop_delay_samples)
        loop["output_bit_v"] = settings.output_bit_v
        loop["dt_s"] = 1.0 / bench.sample_rate_hz
        loop["force_channel"], loop["drive_channel"] = force, drive
        loop["skew_samples"] = bench.channels[force].skew_samples - bench.channels[drive].skew_samples
        loop["force_high_pass_rad_s"] = 2.0 * math.pi * bench.channels[force].corner_hz(near_hz)
        loop["drive_high_pass_rad_s"] = 2.0 * math.pi * bench.channels[drive].corner_hz(near_hz)
        loop["drive"] = table["drive"][:1]
        control = control_state(law_record)
        first = segments[0].excitation if segments else None
        if first is not None:
            control["frequency"]["omega"] = 2.0 * math.pi * first.frequency_hz
        omega = float(control["frequency"]["omega"][0])
        progress = np.zeros(1, PROGRESS)
        progress["omega"] = omega
        progress["unlocked"] = 1
        progress["lag"] = table["lag_rad"][:1] if len(segments) else lag_rad
        progress["segments"] = len(segments)
        progress["retries"], progress["point"] = settings.retries, -1
        progress["held_back"] = int(settings.start_judged and any(one.kind is SegmentKind.START for one in segments))
        expected = expected_record(bench, smallest[force], smallest[drive], exciter, settings.per_volt)
        plausibility = np.zeros(1, PLAUSIBILITY)
        plausibility["reference_v"] = expected["floor_v"]
        evaluate_exciter(expected[0], plausibility[0], omega)
        self.bench = bench
        self.arrays = TickArrays(
            law=law_record,
            rule=settings.settle.build(),
            limits=limits,
            inputs=input_records(bench, settings.near_limits),
            expected=expected,
            segments=table,
            waveforms=np.zeros((1, 1)) if waveforms is None else np.ascontiguousarray(waveforms, float),
            loop=loop,
            control=control,
            guard=guard_record(settings.armed),
            watches=watch_records(len(bench.channels)),
            plausibility=plausibility,
            settling=np.zeros(1, SETTLING),
            progress=progress,
            outcomes=outcomes,
            history=_history(int(loop["delay_whole"][0]) + 2, omega, 1.0 / bench.sample_rate_hz),
        )

    @property
    def guard(self) -> np.ndarray:
        """The guard's record: mode, reason, channel, sample."""
        return self.arrays.guard

    @property
    def outcomes(self) -> np.ndarray:
        """Results of the segments so far."""
        return self.arrays.outcomes

    @property
    def sample(self) -> int:
        """Number of samples processed."""
        return int(self.arrays.loop["sample"][0])

    @property
    def frequency_hz(self) -> float:
        """Frequency of the oscillator (Hz)."""
        return float(self.arrays.control["frequency"]["omega"][0]) / (2.0 * math.pi)

    @property
    def row_dtype(self) -> np.dtype[np.void]:
        """Dtype of the rows that `joined` returns."""
        return recorded_row(len(self.bench.channels))

    @property
    def over(self) -> bool:
        """Whether the output is off for good and the device's queue holds no more output of the run."""
        if self.arrays.guard["mode"][0] != OFF:  # asked after every block, which a kernel's call would outlast
            return False
        return is_over(self.arrays.guard[0], int(self.arrays.loop["delay_whole"][0]))

    def request_stop(self) -> None:
        """Request a ramp to 0 V at frozen frequency, which ends the plan."""
        self.arrays.guard["stop_requested"] = 1

    @property
    def start_held(self) -> bool:
        """Whether a start segment lasts until `release_start`."""
        return bool(self.arrays.progress["held_back"][0])

    @property
    def start_late_periods(self) -> float:
        """Periods since the start segment's time was over; negative before that, and -inf while another segment runs."""
        progress = self.arrays.progress[0]
        segment = int(progress["segment"])
        running = segment < self.arrays.segments.size and progress["entered"]
        if not (running and self.arrays.segments["kind"][segment] == SegmentKind.START):
            return -math.inf
        return float(progress["cycle"] - progress["start_cycle"] - self.arrays.segments["periods"][segment])

    @property
    def start_judgements(self) -> int:
        """How many judgements of the start are due.

        One is due when its time is over, another one after every further `JUDGED_AGAIN` periods.
        """
        late = self.start_late_periods
        return 0 if late < 0.0 else 1 + int(late / JUDGED_AGAIN)

    @property
    def periods_to_judgement(self) -> float:
        """Periods until the next judgement of the start is due; infinite while another segment runs."""
        late = self.start_late_periods
        return -late if late < 0.0 else JUDGED_AGAIN - late % JUDGED_AGAIN

    def release_start(self) -> None:
        """Let the start segment end at its time."""
        self.arrays.progress["held_back"] = 0

    def buffers(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Return empty telemetry for n samples: readings float32[n, n_channels] and rows [n] of `ROW`."""
        return np.zeros((n, len(self.bench.channels)), np.float32), np.zeros(n, ROW)

    def joined(self, readings: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Join readings and rows into one structured array, the form that is recorded."""
        parts = undivided(readings), undivided(rows)
        out = np.empty(rows.size, [("readings", parts[0].dtype), ("scalars", parts[1].dtype)])
        out["readings"], out["scalars"] = parts
        return out.view(self.row_dtype)


def _history(size: int, omega: float, dt: float) -> np.ndarray:
    """Return the ring of past outputs, as if the oscillator had been running before at zero amplitude."""
    out = np.zeros(size, HISTORY)
    ago = np.arange(size, 0, -1)
    out["theta"] = np.mod(-ago * omega * dt, 2.0 * math.pi)
    out["omega"] = omega
    return out
