"""The unit of a key of a bench, a plan or a virtual rig, which is the end of its name."""

UNITS = {
    "v_per_unit": "V per N or m/s^2", "octaves_per_min": "octaves/min", "hz_per_s": "Hz/s", "v_per_s": "V/s",
    "v_s2_m": "V s^2/m", "rms_v": "V RMS", "rms_n": "N RMS", "valid_h": "hours", "periods": "periods",
    "m_s2": "m/s^2", "n_m_rad": "N m/rad", "n_s_m": "N s/m", "n_m4": "N m^4", "n_m3": "N/m^3", "n_m2": "N/m^2",
    "kg_m3": "kg/m^3", "kg_m2": "kg m^2", "rad_s": "rad/s", "n_m": "N/m", "n_a": "N/A", "v_n": "V/N",
    "a_v": "A/V", "per_m2": "1/m^2", "per_m": "1/m", "per_kg": "1/kg", "ohm": "ohm", "deg": "deg", "hz": "Hz", "pa": "Pa",
    "kg": "kg", "samples": "samples", "per_s": "1/s", "s": "s", "h": "H", "v": "V", "n": "N", "m": "m", "a": "A",
}  # fmt: skip
"""Units by the end of a key, longer ends first."""


def unit_of(key: str) -> str:
    """Return the unit that a key's name ends with; empty for a name without a unit."""
    return next((unit for end, unit in UNITS.items() if key.endswith(f"_{end}")), "")


def titled(key: str) -> str:
    """Return a key in words with its unit behind: ``frequency (Hz)`` for ``frequency_hz``."""
    end = next((end for end in UNITS if key.endswith(f"_{end}")), None)
    if end is None:
        return key.replace("_", " ")
    return f"{key.removesuffix(f'_{end}').replace('_', ' ')} ({UNITS[end]})"
