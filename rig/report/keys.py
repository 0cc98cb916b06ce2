"""Keys of plans and limits of benches as names and values."""

from collections.abc import Mapping

_UNITS = (
    ("_v_per_s", " V/s"),
    ("_m_s2", " m/s^2"),
    ("_hz", " Hz"),
    ("_v", " V"),
    ("_n", " N"),
    ("_m", " m"),
    ("_s", " s"),
    ("_fraction", " of the range"),
)
_MAX_VALUES = 200  # values of a list that are printed; chosen


def key_rows(table: Mapping[str, object], prefix: str = "") -> list[tuple[str, str]]:
    """Return path and value of every key that has a value, in the order of the table."""
    rows = []
    for name, value in table.items():
        path = f"{prefix}{name}"
        if isinstance(value, Mapping):
            rows += key_rows(value, f"{path}.")
        elif value not in (None, "", [], ()):
            rows.append((path, _text(value)))
    return rows


def limit_rows(limits: Mapping[str, object]) -> list[tuple[str, str]]:
    """Return name and value with unit of every limit of a bench."""
    rows = []
    for name, value in limits.items():
        end, unit = next(((end, unit) for end, unit in _UNITS if name.endswith(end)), ("", ""))
        words = name.removesuffix("" if end == "_fraction" else end).replace("_", " ")
        if value is not None:
            rows.append((words, _text(value, " to ") + unit))
    return rows


def _text(value: object, between: str = ", ") -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.10g}"
    if isinstance(value, list | tuple):
        if len(value) > _MAX_VALUES:
            return f"{_text(value[:3], between)}{between}...{between}{_text(value[-1])} ({len(value)} values)"
        return between.join(f"[{_text(one)}]" if isinstance(one, list | tuple) else _text(one) for one in value)
    if isinstance(value, Mapping):
        return ", ".join(f"{key} = {_text(one)}" for key, one in value.items())
    return str(value)
