"""Cross-checks between the numbers of a bench: limits and sensors, block and reaction time, ramp and vibration.

All such cross-checks are in this module. Numbers that no rig can have, or that would leave the rig unsupervised, are refused
when a bench is loaded, and again before a run, because a bench may also be made in Python. Other inconsistencies give a
caution: a finding of ``rig check``, and a line before a person arms. The bench of a recording is read without these checks, so
that old files stay readable.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from rig.errors import ConfigurationError

if TYPE_CHECKING:
    from rig.bench import Bench
    from rig.bench.channels import Channel

LONGEST_BLOCK_S = 0.2  # s; reaction time of a person at the stop button: a loop must not check less often
OVERTRAVEL_FACTOR = 1.25
"""Multiple of a limit beyond which a ramp would take too long and the output drops to 0 V."""
PLAIN_CONVERTERS = ("serial", "can")
"""Drivers of boards, whose converters have no filter of their own as those of sound cards and delta-sigma modules have."""
RANGES = {
    "force": (1e-3, 1e8),  # N: from micro force sensors to the load cells of building test floors
    "drive": (1e-2, 1e7),  # m/s^2: from seismic accelerometers to shock ones, with a decade to spare at either end
    "response": (1e-2, 1e7),
    "monitor": (1e-12, 1e12),  # any unit
}
"""Plausible ranges of a channel in its unit: every sensor lies inside, a wrong exponent usually outside."""


class Caution(ConfigurationError):  # noqa: N818 (said, not raised)
    """An inconsistency between numbers of a bench, with which it may run."""


def objections(bench: "Bench") -> tuple[ConfigurationError, ...]:
    """Return all objections to a bench, refusals first."""
    found = [*_ranges(bench), *_block(bench), *_oversample(bench), *_images(bench), *_ramp(bench), *_drops(bench)]
    return tuple(sorted(found, key=lambda one: isinstance(one, Caution)))


def refuse(bench: "Bench") -> None:
    """Raise `ConfigurationError` if the bench must not run."""
    if refusals := [one for one in objections(bench) if not isinstance(one, Caution)]:
        raise ConfigurationError.of(refusals[0], further=refusals[1:])


def cautions(bench: "Bench") -> tuple[str, ...]:
    """Return the cautions that a person should read before arming, one line each."""
    return tuple(str(one) for one in objections(bench) if isinstance(one, Caution))


def _ranges(bench: "Bench") -> Iterator[ConfigurationError]:
    for index, channel in enumerate(bench.channels):
        scale = abs(channel.sensitivity_v_per_unit)
        low, high = RANGES[channel.role]
        if channel.range_v > high * scale or channel.range_v < low * scale:
            yield ConfigurationError(
                f"with range_v = {channel.range_v:g} channel {channel.name!r} would reach beyond {high:g} {channel.unit}, "
                f"or less than {low:g}, which no sensor for role {channel.role!r} does",
                field=f"channels[{index}].sensitivity_v_per_unit",
                value=channel.sensitivity_v_per_unit,
                unit=f"V per {channel.unit}",
                allowed=f"{channel.range_v / high:.3g} to {channel.range_v / low:.3g}, of either sign",
            )


def _block(bench: "Bench") -> Iterator[ConfigurationError]:
    """Check the block length: limits are not checked within a block. A block of one sample is always accepted."""
    block_s = bench.block / bench.sample_rate_hz
    if bench.block == 1:
        return
    if block_s > LONGEST_BLOCK_S:
        most = max(1, int(LONGEST_BLOCK_S * bench.sample_rate_hz))
        why = f"lasts {block_s:.3g} s at {bench.sample_rate_hz:g} samples/s, and so late a limit acts"
        allowed = f"1 to {most} ({LONGEST_BLOCK_S:g} s)"
        yield ConfigurationError(why, field="block", value=bench.block, allowed=allowed)
    elif block_s > bench.limits.lost_s:
        most = max(1, int(bench.limits.lost_s * bench.sample_rate_hz))
        why = f"lasts {block_s:.3g} s, and so late a limit acts; one lost block is beyond limits.lost_s and trips"
        allowed = f"1 to {most} with limits.lost_s = {bench.limits.lost_s:g}"
        yield Caution(why, field="block", value=bench.block, allowed=allowed)


def _oversample(bench: "Bench") -> Iterator[ConfigurationError]:
    """Check that no device is to run the loop at its own rate and at another."""
    if bench.oversample > 1 and bench.driver.options.get("loop") == "device":
        why = "a device that runs the loop has a sample of the loop for each of its own"
        allowed = "1 with driver.options.loop = 'device'"
        yield ConfigurationError(why, field="oversample", value=bench.oversample, allowed=allowed)


def _images(bench: "Bench") -> Iterator[ConfigurationError]:
    """Check that something keeps images of the held output out of the force, where plain converters are behind a wire."""
    index, force = next((i, channel) for i, channel in enumerate(bench.channels) if channel.role == "force")
    if bench.driver.name not in PLAIN_CONVERTERS or bench.oversample > 1 or force.anti_alias_hz:
        return
    why = "nothing is known to keep images of the held output out of the force, of which little is left at resonance"
    allowed = "the corner of its filter in Hz, or a bench with oversample = 4"
    said = "not given" if force.anti_alias_hz is None else force.anti_alias_hz
    yield Caution(why, field=f"channels[{index}].anti_alias_hz", value=said, allowed=allowed)


def _ramp(bench: "Bench") -> Iterator[ConfigurationError]:
    """Check the ramp-down time: a ramp shorter than a period of the vibration excites the specimen like a step."""
    least_s = 1.0 / bench.specimen.linear_frequency_hz
    ramp_s = bench.limits.ramp_down_s
    if ramp_s < least_s:
        why = "shorter than a period of the specimen, such a ramp is a step, which excites it"
        allowed = f"from {least_s:.3g} s, 1/specimen.linear_frequency_hz, to 60 s"
        yield ConfigurationError(why, field="limits.ramp_down_s", value=ramp_s, unit="s", allowed=allowed)


def _drops(bench: "Bench") -> Iterator[ConfigurationError]:
    """Check the limits: the multiple at which the output drops to 0 V should be within the range of the channels."""
    for field, roles in (("force_n", ("force",)), ("acceleration_m_s2", ("drive", "response"))):
        narrowest: Channel = min((c for c in bench.channels if c.role in roles), key=lambda c: c.range_in_unit)
        shown = bench.limits.overload_fraction * narrowest.range_in_unit
        limit = getattr(bench.limits, field)
        if OVERTRAVEL_FACTOR * limit <= shown:
            continue
        why = (
            f"a trip is only ramped down: at {OVERTRAVEL_FACTOR:g} times the limit the output would drop to 0 V, but channel "
            f"{narrowest.name!r} shows up to {shown:.4g} {narrowest.unit} (overload_fraction of its range)"
        )
        allowed = f"up to {shown / OVERTRAVEL_FACTOR:.3g} {narrowest.unit} for a drop that can be seen"
        yield Caution(why, field=f"limits.{field}", value=limit, unit=narrowest.unit, allowed=allowed)
