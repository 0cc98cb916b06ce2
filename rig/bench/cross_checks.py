"""Whether the numbers of a bench fit each other: limits and sensors, block and reaction, ramp and vibration.

The one place for such cross-checks. What no rig can have, or what would leave it unwatched, is refused: when a bench is
loaded, and again when it is to run, for a bench may also be made in Python. The rest is a caution: a finding of
``rig check``, and a line before a person arms. A recording's bench is read without either, so that old files stay readable.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rig.errors import ConfigurationError

if TYPE_CHECKING:
    from rig.bench import Bench
    from rig.bench.channels import Channel

__all__ = ["Objection", "cautions", "objections", "refuse"]

LONGEST_BLOCK_S = (
    0.2  # a person's reaction at the stop button: a loop that looks less often protects less than a person
)
OVERTRAVEL_FACTOR = 1.25
"""Beyond this multiple of a limit a ramp would take too long: the output drops to 0 V."""
RANGES = {
    "force": (1e-3, 1e8),  # N: from micro force sensors to the load cells of building test floors
    "drive": (1e-2, 1e7),  # m/s^2: from seismic accelerometers to shock ones, with a decade to spare at either end
    "response": (1e-2, 1e7),
    "monitor": (1e-12, 1e12),  # any unit
}
"""Plausible ranges of a channel in its unit: a slip of an exponent lies outside, no sensor does."""


@dataclass(frozen=True)
class Objection:
    """Numbers of a bench that do not fit each other."""

    field: str
    """Key of the bench that is at fault."""
    value: float
    """Its value, in ``unit``."""
    unit: str
    """Unit of the value."""
    allowed: str
    """What it may be."""
    why: str
    """What would go wrong."""
    refused: bool
    """Whether nothing may run with it; else it is a caution."""

    @property
    def line(self) -> str:
        """One line for people."""
        number = f"{self.value:g} {self.unit}".strip()
        return f"{self.field} = {number}: {self.why}; allowed is {self.allowed}"


def objections(bench: "Bench") -> tuple[Objection, ...]:
    """All that does not fit, what is refused first."""
    found = [*_ranges(bench), *_block(bench), *_ramp(bench), *_drops(bench)]
    return tuple(sorted(found, key=lambda one: not one.refused))


def refuse(bench: "Bench") -> None:
    """Raise `ConfigurationError` where the bench must not run as it is; it names field, value and what is allowed."""
    lines = [one.line for part in (_ranges, _block, _ramp) for one in part(bench) if one.refused]
    if lines:
        raise ConfigurationError("; ".join(lines))


def cautions(bench: "Bench") -> tuple[str, ...]:
    """What a person should know before arming, one line each."""
    return tuple(one.line for one in objections(bench) if not one.refused)


def _ranges(bench: "Bench") -> list[Objection]:
    out = []
    for index, channel in enumerate(bench.channels):
        scale = abs(channel.sensitivity_v_per_unit)
        low, high = RANGES[channel.role]
        if channel.range_v > high * scale or channel.range_v < low * scale:
            out.append(
                Objection(
                    f"channels[{index}].sensitivity_v_per_unit",
                    channel.sensitivity_v_per_unit,
                    f"V per {channel.unit}",
                    f"{channel.range_v / high:.3g} to {channel.range_v / low:.3g}, of either sign",
                    f"with range_v = {channel.range_v:g} channel {channel.name!r} would reach beyond {high:g} {channel.unit}, "
                    f"or less than {low:g}, which no sensor for role {channel.role!r} does",
                    refused=True,
                )
            )
    return out


def _block(bench: "Bench") -> list[Objection]:
    """Nothing is looked at between two blocks; a single sample is as short as a block can be."""
    block_s = bench.block / bench.sample_rate_hz
    if bench.block == 1:
        return []
    if block_s > LONGEST_BLOCK_S:
        most = max(1, int(LONGEST_BLOCK_S * bench.sample_rate_hz))
        why = f"lasts {block_s:.3g} s at {bench.sample_rate_hz:g} samples/s, and so late a limit acts"
        allowed = f"1 to {most} ({LONGEST_BLOCK_S:g} s)"
        return [Objection("block", bench.block, "", allowed, why, refused=True)]
    if block_s > bench.limits.lost_s:
        most = max(1, int(bench.limits.lost_s * bench.sample_rate_hz))
        why = f"lasts {block_s:.3g} s, and so late a limit acts; one lost block is beyond limits.lost_s and trips"
        allowed = f"1 to {most} with limits.lost_s = {bench.limits.lost_s:g}"
        return [Objection("block", bench.block, "", allowed, why, refused=False)]
    return []


def _ramp(bench: "Bench") -> list[Objection]:
    """A ramp within a period of the vibration is a step: it kicks the specimen instead of bringing it down."""
    least_s = 1.0 / bench.specimen.linear_frequency_hz
    ramp_s = bench.limits.ramp_down_s
    if ramp_s >= least_s:
        return []
    why = "shorter than a period of the specimen, such a ramp is a step, which excites it"
    allowed = f"from {least_s:.3g} s, 1/specimen.linear_frequency_hz, to 60 s"
    return [Objection("limits.ramp_down_s", ramp_s, "s", allowed, why, refused=True)]


def _drops(bench: "Bench") -> list[Objection]:
    """Limits whose multiple at which the output drops to 0 V is more than a channel can show."""
    out = []
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
        out.append(Objection(f"limits.{field}", limit, narrowest.unit, allowed, why, refused=False))
    return out
