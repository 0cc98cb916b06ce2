"""Sizes of a virtual specimen that look like a slip of the unit: they are told, and analysed as they are."""

from simulators import VirtualRig
from simulators.parts import MeshedBeam

LEAST_HZ = 1.0  # frequency of the mode under test; chosen: below what shakers and accelerometers are used for
SLENDERNESS = (0.001, 0.2)
"""Thickness of a beam over its length. Chosen: thinner is a ribbon, thicker is no Euler-Bernoulli beam."""


def implausible_sizes(rig: VirtualRig, frequency_hz: float, sample_rate_hz: float) -> tuple[str, ...]:
    """Return one line for each implausible size of the specimen; ``frequency_hz`` is that of the mode under test."""
    out = []
    look = "look at the units of the specimen's sizes, stiffnesses and masses"
    if frequency_hz < LEAST_HZ:
        out.append(f"implausible: the mode under test has {frequency_hz:.3g} Hz, less than {LEAST_HZ:g} Hz; {look}")
    if frequency_hz > 0.5 * sample_rate_hz:
        half = f"half of sample_rate_hz = {sample_rate_hz:g}"
        out.append(f"implausible: the mode under test has {frequency_hz:.5g} Hz, more than {half}; {look}")
    beam = rig.structure
    if isinstance(beam, MeshedBeam):
        ratio, (low, high) = beam.thickness_m / beam.length_m, SLENDERNESS
        if not low <= ratio <= high:
            out.append(
                f"implausible: thickness_m = {beam.thickness_m:g} is {ratio:.3g} of length_m = {beam.length_m:g}; beams have "
                f"{low:g} to {high:g}"
            )
    return tuple(out)
