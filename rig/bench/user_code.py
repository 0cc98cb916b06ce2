"""Code named by a bench as ``function = "module:name"``: imported for the user's own bench, not for one in a recording."""

import sys

from rig.bench import Bench
from rig.errors import ConfigurationError


def named_code(bench: Bench) -> list[str]:
    """Return every ``function`` in the options of the driver, at any depth, sorted."""
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
    """Raise `ConfigurationError` if a bench names code; ``source`` is the recording that holds the bench."""
    if code := named_code(bench):
        raise ConfigurationError(
            f"function = {code[0]!r}: is code that the recording names, and is not imported unless you trust "
            "it: `trust_code`",
            where=source,
            field="bench",
        )


def imported_code(bench: Bench) -> list[dict[str, str]]:
    """Return, for the recording, each function that a bench names and the file its module was imported from."""
    return [
        {"function": name, "file": str(getattr(sys.modules.get(name.partition(":")[0]), "__file__", None) or "")}
        for name in named_code(bench)
    ]
