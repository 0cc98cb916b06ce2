"""Code that a bench names by ``function = "module:name"``: imported for a bench of the user, not for one in a recording."""

import sys

from rig.bench import Bench
from rig.errors import ConfigurationError

__all__ = ["imported_code", "named_code", "refuse_code"]


def named_code(bench: Bench) -> list[str]:
    """Every ``function`` in the options of the driver, at any depth."""
    found, waiting = [], list(bench.driver.options.items())
    while waiting:
        key, value = waiting.pop()
        if isinstance(value, dict):
            waiting += value.items()
        elif isinstance(value, list | tuple):
            waiting += [(key, item) for item in value]
        elif key == "function":
            found.append(str(value))
    return sorted(set(found))


def refuse_code(bench: Bench, source: str) -> None:
    """Refuse a bench that names code by `ConfigurationError`; ``source`` is the recording that holds it."""
    if code := named_code(bench):
        raise ConfigurationError(
            f"{source}: bench: function = {code[0]!r}: is code that the recording names, and is not imported unless you "
            "trust it: `trust_code`"
        )


def imported_code(bench: Bench) -> list[dict[str, str]]:
    """For the record: each function that a bench names, and the file that its module was imported from."""
    return [
        {"function": name, "file": str(getattr(sys.modules.get(name.partition(":")[0]), "__file__", None) or "")}
        for name in named_code(bench)
    ]
