"""Levels of a plan in volts, newtons or metres, and the voltage that a test starts with before a loop holds them."""

import math
from dataclasses import replace
from typing import Self

from pydantic import ConfigDict, Field, model_validator
from pydantic.config import JsonDict

from controller import AmplitudeLaw
from rig.bench import Bench
from rig.bench.configuration import Configured
from rig.errors import ConfigurationError
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Excitation, Segment
from vibrolock.errors import InputError

LEVELS = {
    "levels_v": (AmplitudeLaw.VOLTAGE, "V"),
    "levels_n": (AmplitudeLaw.FORCE, "N"),
    "levels_rms_n": (AmplitudeLaw.FORCE_RMS, "N RMS"),
    "levels_m": (AmplitudeLaw.RESPONSE, "m"),
}
"""Amplitude law and unit of the levels, by plan key."""


def exactly_one(*groups: tuple[str, ...]) -> JsonDict:
    """Return the JSON schema of a table that has the keys of exactly one of the groups."""
    return {"oneOf": [{"required": list(group)} for group in groups]}


ONE_LEVEL_KEY = exactly_one(*((key,) for key in LEVELS))
"""What the JSON schema says of the level keys together."""
ABOVE_ZERO: JsonDict = {"minItems": 1, "uniqueItems": True, "items": {"exclusiveMinimum": 0}}
"""What the JSON schema says of a list of levels; `Levels` itself says it in clearer words."""


class Levels(Configured):
    """Levels in exactly one of four quantities. If a loop holds the levels, the run may begin at a voltage, ``start_v``."""

    model_config = ConfigDict(json_schema_extra={"allOf": [ONE_LEVEL_KEY]})

    levels_v: tuple[float, ...] | None = Field(None, json_schema_extra=ABOVE_ZERO)
    """Levels as amplitude of the output voltage, V peak, up to the bench's ``voltage_v``. Give one kind of level."""
    levels_n: tuple[float, ...] | None = Field(None, json_schema_extra=ABOVE_ZERO)
    """Levels as amplitude of the fundamental force, N peak, up to the bench's ``force_n``."""
    levels_rms_n: tuple[float, ...] | None = Field(None, json_schema_extra=ABOVE_ZERO)
    """Levels as root mean square of the force, all harmonics together, N, up to the bench's ``force_n``."""
    levels_m: tuple[float, ...] | None = Field(None, json_schema_extra=ABOVE_ZERO)
    """Levels as amplitude of the drive point's fundamental displacement, m peak, up to the bench's ``displacement_m``."""
    start_v: float | None = Field(None, gt=0)
    """Voltage with which the rig is set in motion before a loop takes over and goes to a level in newtons or metres, V peak."""
    start_ramp_periods: float = Field(10.0, ge=1, le=1e5)
    """Length of the ramp to ``start_v``, periods: slow enough that an exciter of another gain than the known plant's is noticed
    at a small force."""
    start_periods: float = Field(40.0, ge=1, le=1e5)
    """Time at ``start_v`` in which the lock is gained, periods. It is extended a little while it is uncertain whether there is
    a lock. If there is none at the end (the frequency stays at an end of its window for 20 periods, or the phase is far off for
    100 periods), the run ends."""

    @model_validator(mode="after")
    def _levels_make_sense(self) -> Self:
        given = list(self._given)
        if len(given) != 1:
            raise InputError("exactly one of them must be given", field=", ".join(LEVELS))
        if not self.levels:
            raise InputError("at least one level is needed", field=given[0], value=[])
        for index, level in enumerate(self.levels):
            InputError.unless_above(f"{given[0]}[{index}]", level, 0)
        if len(set(self.levels)) != len(self.levels):
            raise InputError("a level is given twice", field=given[0], hint="use repeats to measure levels again")
        return self

    @property
    def _given(self) -> dict[str, tuple[float, ...]]:
        return {name: values for name in LEVELS if (values := getattr(self, name)) is not None}

    @property
    def level_count(self) -> dict[str, int]:
        """Number of levels, by each level key that is given."""
        return {name: len(values) for name, values in self._given.items()}

    @property
    def levels_key(self) -> str:
        """Name of the key that gives the levels."""
        return next(iter(self._given))

    @property
    def levels(self) -> tuple[float, ...]:
        """The levels, in V, N or m."""
        return next(iter(self._given.values()))

    @property
    def amplitude_law(self) -> AmplitudeLaw:
        """Quantity that the levels refer to."""
        return LEVELS[self.levels_key][0]

    @property
    def level_unit(self) -> str:
        """Unit of the levels: ``V``, ``N``, ``N RMS`` or ``m``."""
        return LEVELS[self.levels_key][1]

    @property
    def force_loop(self) -> str:
        """Name of the loop that would hold a force."""
        return "linear"

    def start_segments(self, lag_deg: float | None = None, excitation: Excitation | None = None) -> list[Segment]:
        """Return the segments that set the rig in motion at ``start_v``; none without ``start_v`` or with levels in volts."""
        if self.start_v is None or self.amplitude_law is AmplitudeLaw.VOLTAGE:
            return []
        ramp = Segment(
            SegmentKind.RAMP,
            -1,
            self.start_v,
            self.start_ramp_periods,
            excitation=excitation,
            amplitude_law=AmplitudeLaw.VOLTAGE,
            lag_deg=lag_deg,
        )
        kind = SegmentKind.START if excitation is None else SegmentKind.HOLD
        return [ramp, replace(ramp, kind=kind, periods=self.start_periods)]

    def ratios_to_drive(self, bench: Bench) -> dict[str, float]:
        """Return the motion of each channel per metre at the drive point, as far as the bench's mode shapes give it."""
        return bench.response_ratios

    def check_levels(self, bench: Bench, band_hz: tuple[float, float] | None = None) -> None:
        """Refuse levels beyond the bench's limits, and levels of a logarithmic loop without a start voltage.

        A displacement is checked at every channel whose motion in the tested mode is known. If a band is given, this check is
        made only if the band contains the mode.
        """
        limits = bench.limits
        largest = {"V": limits.voltage_v, "N": limits.force_n, "N RMS": limits.force_n, "m": limits.displacement_m}
        for index, level in enumerate(self.levels):
            if level > largest[self.level_unit]:
                raise ConfigurationError(
                    f"the bench {bench.name} allows up to {largest[self.level_unit]:g} {self.level_unit}",
                    field=f"{self.levels_key}[{index}]",
                    value=level,
                    unit=self.level_unit,
                )
        if band_hz is None or band_hz[0] <= bench.specimen.linear_frequency_hz <= band_hz[1]:
            self._check_channels(bench)
        if self.start_v is not None and self.start_v > limits.voltage_v:
            raise ConfigurationError(
                f"the bench {bench.name} allows up to {limits.voltage_v:g} V", field="start_v", value=self.start_v
            )
        linear = self.amplitude_law is not AmplitudeLaw.RESPONSE and self.force_loop == "linear"
        if self.start_v is None and not linear and self.amplitude_law is not AmplitudeLaw.VOLTAGE:
            raise ConfigurationError(
                f"levels by {self.levels_key} of this loop need a voltage to begin with", field="start_v"
            )

    def _check_channels(self, bench: Bench) -> None:
        """Refuse levels in metres at which a channel exceeds its limits when the linear mode is passed."""
        if self.level_unit != "m":
            return
        omega = 2.0 * math.pi * bench.specimen.linear_frequency_hz
        ratios = self.ratios_to_drive(bench)
        name = max(ratios, key=lambda channel: ratios[channel])
        limits = bench.limits
        for index, level in enumerate(self.levels):
            moved = level * ratios[name]
            for key, unit, value, allowed in (
                ("displacement_m", "m", moved, limits.displacement_m),
                ("acceleration_m_s2", "m/s^2", moved * omega**2, limits.acceleration_m_s2),
            ):
                if value > allowed:
                    raise ConfigurationError(
                        f"means {value:.3g} {unit} at channel {name!r}, which moves {ratios[name]:.3g} times as far as "
                        f"the drive point; the bench {bench.name} allows limits.{key} = {allowed:g}",
                        field=f"{self.levels_key}[{index}]",
                        value=level,
                        unit="m",
                    )
