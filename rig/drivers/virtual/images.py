"""What images of the held output do to the readings of a virtual rig, past the filters of its converter."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from rig.daq import IMAGES_ACCEPTED, Channel
from simulators import VirtualRig
from simulators.parts import LOWEST_INTERNAL_RATE_HZ

if TYPE_CHECKING:
    from simulators.analysis import ImageBias

TOLERANCE = 0.01  # relative change of the damping ratio that is worth a remark; chosen
NO_FILTER = "the virtual device has no anti-alias filter (driver.options.converter: oversampling, anti_alias_hz)"
PASSED = "they pass the anti-alias filter at {:g} Hz (driver.options.converter.anti_alias_hz)"


def image_biases(rig: VirtualRig, channels: Sequence[Channel]) -> "dict[float, ImageBias]":
    """Return the bias in every linear mode that is sampled, by its frequency in Hz; empty where no images are put out.

    An anti-alias filter may not be enough: at resonance a light structure takes a hundredth of the force that images find, or
    less.
    """
    converter, modes = rig.converter, rig.linear_modes
    names = {channel.role: channel.name for channel in reversed(channels)}
    if converter.reconstruction_hz or not {"force", "drive"} <= names.keys():
        return {}
    from simulators.analysis import image_bias  # on use: the analysis takes long to load

    seen = (
        (modes.frequency_hz < 0.5 * converter.sample_rate_hz) & (modes.damping_ratio > 0.0) & (modes.drive_shape > 0.0)
    )
    return {
        hz: image_bias(rig, hz, force=names["force"], drive=names["drive"])
        for mode, hz in enumerate(modes.frequency_hz.tolist())
        if seen[mode] and modes.nearest(hz) == mode  # not a free motion
    }


def image_remarks(rig: VirtualRig, biases: "Mapping[float, ImageBias]", near_hz: float) -> list[str]:
    """Return what is worth saying before a run about the mode next to a frequency (Hz)."""
    modes = rig.linear_modes
    bias = biases.get(float(modes.frequency_hz[modes.nearest(near_hz)]))
    if bias is None:
        return []
    filter_hz = rig.converter.anti_alias_hz
    if abs(bias.damping) > TOLERANCE:
        refused = abs(bias.damping) > IMAGES_ACCEPTED * abs(1.0 + bias.damping)  # points know their own damping alone
        return [
            f"images of the held output change the damping ratio of the linear mode by {100.0 * bias.damping:+.2g} % of "
            f"itself, its frequency by {100.0 * bias.frequency:+.2g} %"
            + (f"; tests of damping refuse points with more than {100.0 * IMAGES_ACCEPTED:g} %" if refused else "")
            + f": {PASSED.format(filter_hz) if filter_hz else NO_FILTER}"
        ]
    if not filter_hz and rig.converter.sample_rate_hz < LOWEST_INTERNAL_RATE_HZ:
        return [
            f"sample_rate_hz = {rig.converter.sample_rate_hz:g}: the stairs of the held output alias into the readings below "
            f"about {LOWEST_INTERNAL_RATE_HZ:g} Hz, for {NO_FILTER}"
        ]
    return []
