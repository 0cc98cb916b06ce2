"""What a bench is: driver, rate, channels, limits and the facts known of the specimen; read from TOML."""

from importlib import resources
from pathlib import Path
from typing import Self

from pydantic import ConfigDict, Field, field_validator, model_validator

from rig.bench.channels import Channel
from rig.bench.configuration import Configured, Table, find_toml, merged, read_toml, shipped_names, validated
from rig.bench.cross_checks import refuse
from rig.bench.sensors import with_sensors
from rig.errors import ConfigurationError
from vibrolock.errors import InputError

HIGHEST_PART = 0.45
"""Highest frequency of the output, over the sample rate; chosen: a tenth below Nyquist."""


class DriverChoice(Configured):
    """Which driver stands between the loop and the rig."""

    name: str = Field(min_length=1)
    """Name of the driver, for instance ``virtual``; ``rig list`` shows those that are installed."""
    options: Table = Field(default_factory=dict)
    """What this driver needs to know; the driver checks it."""

    def table(self, key: str) -> Table:
        """Return a table among the options; empty if there is none."""
        value = self.options.get(key)
        return value if isinstance(value, dict) else {}


class Limits(Configured):
    """What the bench may be asked for. A voltage is clamped to its limit; anything else beyond its limit trips."""

    voltage_v: float = Field(gt=0, le=100)
    """Largest output amplitude, V, at most ``output_range_v``. The output is clamped to it, which is no trip."""
    force_n: float = Field(gt=0)
    """Largest instantaneous force, N, at most what the channel can read. Beyond 1.25 times this, during the ramp of a trip,
    the output drops to 0 V at once."""
    acceleration_m_s2: float = Field(gt=0)
    """Largest instantaneous acceleration of any drive or response channel, m/s^2; as ``force_n``."""
    displacement_m: float = Field(gt=0)
    """Largest displacement of any drive or response channel, m; by integrating its acceleration twice, without its mean."""
    frequency_hz: tuple[float, float] = Field(json_schema_extra={"items": {"exclusiveMinimum": 0}})
    """Lowest and highest frequency that may be put out, Hz; up to 0.45 of the sample rate. Displacements are integrated from
    a fifth of the lowest on."""
    slew_v_per_s: float = Field(100.0, gt=0)
    """Largest rate of change of the complex output amplitude (size and angle together), V/s. A faster change is clamped to
    it."""
    overload_fraction: float = Field(0.98, gt=0, le=1)
    """Part of a channel's range from which on a reading counts as overload."""
    overload_s: float = Field(0.002, ge=0, le=10)
    """Time of uninterrupted overload that trips, s."""
    stuck_s: float = Field(0.5, gt=0, le=3600)
    """Time without any change of a reading, at a held level, that trips, s."""
    lost_s: float = Field(0.05, gt=0, le=10)
    """Time of lost samples that trips, s. Each sample that arrives makes up for one that was lost."""
    ramp_down_s: float = Field(0.5, gt=0, le=60)
    """Time of the ramp to 0 V that ends every run, s; at least one period of ``linear_frequency_hz``, as a shorter ramp is a
    step that excites the specimen."""

    @field_validator("frequency_hz")
    @classmethod
    def _ordered(cls, value: tuple[float, float]) -> tuple[float, float]:
        if not 0 < value[0] < value[1]:
            raise ValueError(f"[{value[0]:g}, {value[1]:g}]: allowed is two positive frequencies, the lower one first")
        return value


class SpecimenFacts(Configured):
    """What is known of the specimen before the test."""

    name: str
    """Name, for files and figures."""
    linear_frequency_hz: float = Field(gt=0)
    """Frequency of the mode under test at low level, Hz; inside the plan's ``frequency_window_hz``. The loop starts at the
    plan's ``centre_frequency_hz``."""
    drive_mode_shape: float | None = Field(None, json_schema_extra={"not": {"const": 0}})
    """Mass-normalised shape of this mode at the drive channel, kg^-1/2, from a modal test. Damping needs it: 1 % of error in
    it is 2 % in the damping. A plan with ``[plant]`` uses the shape measured there instead."""

    @field_validator("drive_mode_shape")
    @classmethod
    def _not_zero(cls, value: float | None) -> float | None:
        if value == 0.0:
            raise ValueError("0: a mode cannot be driven at its node, allowed is any other number")
        return value


class Arming(Configured):
    """Who may arm a bench on which something physical moves."""

    automated: bool = False
    """Whether the bench arms itself; only for a bench that was made to run without a person beside it."""
    check_valid_h: float = Field(24.0, gt=0, le=8760)
    """Age up to which a check counts, h."""
    require_check: bool = True
    """Whether an automated bench needs a check that passed, of the same channels and driver."""
    largest_trip_probability: float | None = Field(None, gt=0, le=1)
    """Largest probability of a trip with which a plan is armed. The plan then needs a rehearsal (``rig rehearse``) whose 95 %
    interval stays below it. Without this key no rehearsal is needed."""
    require_calibration: bool = False
    """Whether the bench is not armed while the calibration of a sensor is overdue; a check may still run."""
    rehearsal_valid_h: float = Field(168.0, gt=0, le=8760)
    """Age up to which such a rehearsal counts, h."""
    hardware_emergency_stop: bool = False
    """Whether there is an emergency stop that cuts the amplifier without the computer, and a person has tested it. Without
    it, a device that does not bring its output to 0 V by itself is armed by a person only
    (`rig.daq.Capabilities.safe_without_host`)."""


class EmergencyStop(Configured):
    """A switch on an input channel that brings the output to 0 V at once."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": ["above_v"]}, {"required": ["below_v"]}]})

    channel: str = Field(min_length=1)
    """Name of the channel, of role ``monitor``, that the switch is connected to."""
    above_v: float | None = Field(None, ge=-100, le=100)
    """The switch counts as pressed where the channel reads more than this, V. Either this or ``below_v`` is given."""
    below_v: float | None = Field(None, ge=-100, le=100)
    """The switch counts as pressed where the channel reads less than this, V: a switch that opens, or a cable that breaks,
    stops too."""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if (self.above_v is None) == (self.below_v is None):
            raise InputError(field="above_v, below_v", allowed="exactly one of the two")
        return self


class Bench(Configured):
    """A rig as a laboratory has it."""

    name: str = Field(min_length=1)
    """Name, used in messages and files."""
    description: str = ""
    """What it is, and where its numbers come from."""
    driver: DriverChoice
    """The driver and its options."""
    sample_rate_hz: float = Field(gt=0, le=1e6)
    """Sample rate of the loop, Hz."""
    block: int = Field(1, ge=1, le=65536)
    """Samples that are exchanged with the device in one call, at most 0.2 s. A longer block is easier for the computer, but
    delays the loop, and limits act up to a block late. A block longer than ``lost_s`` trips where one block is lost."""
    oversample: int = Field(1, ge=1, le=64)
    """Samples of the device per sample of the loop: outputs go to the next one on a straight line, inputs pass a low-pass at
    half of ``sample_rate_hz`` before one in ``oversample`` is kept. For a device without filters of its own, whose held output
    would alias into the force. It delays the loop by some 13 samples, and the computer runs the loop."""
    output_range_v: float = Field(10.0, gt=0, le=100)
    """Range of the output converter, V."""
    output_resolution_v: float | None = Field(None, gt=0, le=1)
    """Voltage of the output converter's least bit, V; by default that of 16 bit over its range. ``rig tune`` chooses levels
    at which these steps do not matter in the force."""
    channels: tuple[Channel, ...] = Field(
        min_length=2,
        json_schema_extra={
            "allOf": [{"contains": {"properties": {"role": {"const": role}}}} for role in ("force", "drive")]
        },
    )
    """The input channels, in the device's order: two or more, one of them with role ``force`` and one with role ``drive``."""
    limits: Limits
    """Limits of what the bench may do."""
    specimen: SpecimenFacts
    """What is known of the specimen."""
    arming: Arming = Field(default_factory=Arming)
    """Who may arm it; a virtual rig arms itself."""
    emergency_stop: EmergencyStop | None = None
    """A switch that stops, where there is one."""

    @property
    def output_bit_v(self) -> float:
        """Voltage of the output converter's least bit, V."""
        return self.output_resolution_v or 2.0 * self.output_range_v / 65536.0

    @property
    def at_device(self) -> "Bench":
        """The bench as its device sees it: with ``oversample`` samples for each of the loop's. The bench itself without any."""
        times = self.oversample
        if times == 1:
            return self
        channels = [c.model_copy(update={"skew_samples": times * c.skew_samples}) for c in self.channels]
        rate_hz = times * self.sample_rate_hz
        changed = {"oversample": 1, "sample_rate_hz": rate_hz, "block": times * self.block, "channels": tuple(channels)}
        return self.model_copy(update=changed)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        names = [channel.name for channel in self.channels]
        for role in ("force", "drive"):
            count = sum(channel.role == role for channel in self.channels)
            InputError.raise_if(count != 1, f"{count} with role {role!r}", field="channels", allowed="exactly 1")
        doubled = sorted({name for name in names if names.count(name) > 1})
        if doubled:
            raise InputError(f"the name {doubled[0]!r} is used twice", field="channels")
        if self.limits.voltage_v > self.output_range_v:
            raise InputError(
                field="limits.voltage_v",
                value=self.limits.voltage_v,
                allowed=f"up to output_range_v = {self.output_range_v:g}",
            )
        if self.limits.frequency_hz[1] > HIGHEST_PART * self.sample_rate_hz:
            raise InputError(
                field="limits.frequency_hz",
                value=list(self.limits.frequency_hz),
                allowed=f"up to {HIGHEST_PART:g} of sample_rate_hz, {HIGHEST_PART * self.sample_rate_hz:g} Hz",
            )
        stop = self.emergency_stop
        if stop is not None and stop.channel not in {
            channel.name for channel in self.channels if channel.role == "monitor"
        }:
            raise InputError(
                field="emergency_stop.channel", value=stop.channel, allowed="the name of a channel with role 'monitor'"
            )
        for channel in self.channels:
            limit = self.limits.force_n if channel.role == "force" else self.limits.acceleration_m_s2
            if channel.role != "monitor" and limit > channel.range_in_unit:
                raise InputError(
                    f"{limit:g} {channel.unit} is beyond the range of channel {channel.name!r}",
                    field="limits",
                    allowed=f"up to {channel.range_in_unit:g} {channel.unit}",
                )
        return self

    def index_of(self, role: str) -> int:
        """Index of the first channel with a role."""
        return next(index for index, channel in enumerate(self.channels) if channel.role == role)

    @property
    def response_ratios(self) -> dict[str, float]:
        """Displacement of each channel over that of the drive point, in the mode under test, by channel name.

        Only channels with known mode shape are included; the drive channel itself has 1.
        """
        drive, own = self.specimen.drive_mode_shape, self.channels[self.index_of("drive")].name
        shapes = {channel.name: channel.mode_shape for channel in self.channels if channel.mode_shape is not None}
        ratios = {} if drive is None else {name: abs(shape / drive) for name, shape in shapes.items()}
        return {own: 1.0, **ratios}


def _folder() -> Path:
    return Path(str(resources.files("rig.bench"))) / "shipped"


def shipped_benches() -> list[str]:
    """Names of the benches that come with the product."""
    return shipped_names(_folder())


def load_bench(name_or_path: str | Path) -> Bench:
    """Load a shipped bench by its name, or a bench from a TOML file.

    ``base = "magnet-beam"`` in the file starts from a shipped bench, ``base = "mine.toml"`` from a file in the same folder. The
    other entries of the file change the base key by key. If ``driver.name`` differs from the base's, the base's
    ``driver.options`` are dropped. ``sensors = "sensors.toml"`` names a file of sensors (`rig.bench.sensors`) by a path
    from the file's folder; channels refer to it by ``serial_number``.

    Raises `ConfigurationError` if the file is not a valid bench, or if the bench must not run (`rig.bench.cross_checks`).
    """
    table = _with_base(name_or_path, ())
    sensors = table.pop("sensors", None)
    try:
        table = table if sensors is None else with_sensors(table, Path(str(sensors)))
    except ConfigurationError as error:
        raise ConfigurationError.of(error, where=name_or_path) from None
    bench = validated(Bench, table, str(name_or_path))
    try:
        refuse(bench)
    except ConfigurationError as error:
        raise ConfigurationError.of(error, where=name_or_path) from None
    return bench


def _with_base(name_or_path: str | Path, over: tuple[Path, ...]) -> Table:
    """Return the table of a bench merged with its bases; ``over`` are the files for which this one is a base."""
    path = find_toml(name_or_path, _folder(), "bench")
    table = read_toml(path)
    if (sensors := table.get("sensors")) is not None:
        if not isinstance(sensors, str) or not sensors.endswith(".toml"):
            raise ConfigurationError(
                where=name_or_path, field="sensors", value=sensors, allowed="the path of a .toml file"
            )
        table["sensors"] = str(path.parent / sensors)
    base = table.pop("base", None)
    if base is None:
        return table
    if isinstance(base, str) and base.endswith(".toml"):
        if path.resolve() in over:
            raise ConfigurationError("the files start from each other", where=name_or_path, field="base", value=base)
        return _changed(_with_base(path.parent / base, (*over, path.resolve())), table)
    if base not in shipped_benches():
        allowed = ", ".join(shipped_benches())
        raise ConfigurationError(
            where=name_or_path, field="base", value=base, allowed=f"{allowed}, or a .toml file beside this one"
        )
    return _changed(_with_base(base, over), table)


def _changed(base: Table, table: Table) -> Table:
    """Return the base with the changes of ``table``; the base's driver options are dropped if the driver changes."""
    driver, other = base.get("driver"), table.get("driver")
    if (
        isinstance(driver, dict)
        and isinstance(other, dict)
        and other.get("name", driver.get("name")) != driver.get("name")
    ):
        base = {**base, "driver": {}}
    return merged(base, table)
