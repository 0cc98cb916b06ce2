"""The unit of a field, a key or an array, which is the end of its name: ``Hz`` of ``frequency_hz``."""

UNITS = {
    "v_per_unit": "V per N or m/s^2", "octaves_per_min": "octaves/min", "hz_per_s": "Hz/s", "v_per_s": "V/s",
    "v_s2_m": "V s^2/m", "rms_v": "V RMS", "rms_n": "N RMS", "valid_h": "hours", "periods": "periods",
    "m_s2": "m/s^2", "n_m_rad": "N m/rad", "n_s_m": "N s/m", "n_m4": "N m^4", "n_m3": "N/m^3", "n_m2": "N/m^2",
    "kg_m3": "kg/m^3", "kg_m2": "kg m^2", "rad_s": "rad/s", "n_m": "N/m", "n_a": "N/A", "v_n": "V/N",
    "a_v": "A/V", "m_s": "m/s", "per_m2": "1/m^2", "per_m": "1/m", "per_kg": "1/kg", "per_s": "1/s", "1_s": "1/s",
    "ohm": "ohm", "deg": "deg", "hz": "Hz", "pa": "Pa", "kg": "kg", "samples": "samples", "rad": "rad",
    "s": "s", "h": "H", "v": "V", "n": "N", "m": "m", "a": "A",
}  # fmt: skip
"""Units by the end of a name, longer ends first."""


def parted(name: str) -> tuple[str, str]:
    """Return a name without the end that is its unit, and the unit; the whole name and nothing if it has none."""
    end = next((end for end in UNITS if name.endswith(f"_{end}")), None)
    return (name, "") if end is None else (name.removesuffix(f"_{end}"), UNITS[end])


def unit_of(name: str) -> str:
    """Return the unit in which a name ends, also that of an element such as ``levels_hz[3]``; empty without one."""
    return parted(name.partition("[")[0] if name.endswith("]") else name)[1]


def titled(key: str) -> str:
    """Return a key in words with its unit behind: ``frequency (Hz)`` for ``frequency_hz``."""
    stem, unit = parted(key)
    return stem.replace("_", " ") + (f" ({unit})" if unit else "")
