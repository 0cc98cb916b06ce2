"""Levels as people read them: displacements in mm, as amplitudes are."""


def in_shown_unit(level: float, unit: str) -> tuple[float, str]:
    """Return a level and its unit as they are shown: metres as mm, everything else as it is."""
    return (1e3 * level, "mm") if unit == "m" else (level, unit)


def level_text(level: float, unit: str, pattern: str = ".4g") -> str:
    """Return a level with its unit: ``0.1144 mm``."""
    value, shown = in_shown_unit(level, unit)
    return f"{value:{pattern}} {shown}"
