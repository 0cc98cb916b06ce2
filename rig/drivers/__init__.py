"""Drivers by name. A driver is a class found under the entry-point group ``vibrolock.drivers``.

The class is called as ``Driver(bench, seed)`` and keeps the contract of `rig.daq.DAQ`; its module is imported on use only.
The names of this distribution's own drivers always mean these. Looking through all installed packages takes as long as building
a virtual rig, so it is done for other names only.
"""

from collections.abc import Callable
from functools import cache
from importlib.metadata import EntryPoint, PackageNotFoundError, distribution, entry_points

from rig.bench import Bench
from rig.daq import DAQ
from rig.drivers.oversampled import at_loop_rate
from rig.errors import ConfigurationError, RigError, as_daq_error

__all__ = ["GROUP", "driver_names", "make_daq"]

GROUP = "vibrolock.drivers"
"""Group of entry points under which drivers are installed."""


@cache
def _shipped() -> dict[str, EntryPoint]:
    try:
        return {entry.name: entry for entry in distribution("vibrolock").entry_points.select(group=GROUP)}
    except PackageNotFoundError:
        return {}


def _found() -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=GROUP)} | _shipped()


def driver_names() -> list[str]:
    """Names of all installed drivers."""
    return sorted(_found())


def make_daq(bench: Bench, seed: int = 0) -> DAQ:
    """Return the driver that a bench asks for, not yet open.

    Raises `ConfigurationError` for an unknown name, a driver that cannot be imported, or options it refuses; `DaqError` for
    any other exception of it.

    Parameters
    ----------
    bench
        The bench.
    seed
        Seed of the noise of a virtual rig.
    """
    name = bench.driver.name
    found = _shipped() if name in _shipped() else _found()
    if name not in found:
        raise ConfigurationError(
            f"there is no such driver; installed are {', '.join(sorted(found)) or 'none'}",
            field="driver.name",
            value=name,
        )
    try:
        driver: Callable[[Bench, int], object] = found[name].load()
    except (ImportError, AttributeError) as error:
        raise ConfigurationError(f"its code cannot be imported: {error}", field="driver.name", value=name) from error
    try:
        daq = driver(bench.at_device, seed)
    except RigError:
        raise
    except Exception as error:
        raise as_daq_error(error) from error
    if not isinstance(daq, DAQ):
        raise ConfigurationError(f"{found[name].value} is not a rig.daq.DAQ", field="driver.name", value=name)
    return at_loop_rate(daq, bench)
