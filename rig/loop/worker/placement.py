"""Who runs the loop of a bench, its open device or the computer, and why not the device where the bench would have it so."""

from collections.abc import Mapping

from rig.bench import Bench
from rig.daq import DAQ
from rig.errors import DaqRefused
from rig.loop.on_device import RunsLoops, why_on_computer
from rig.loop.worker.memory import chunk_of

SMALLER = 'use fewer points, shorter waveforms, or driver.options.loop = "auto"'
NO_QUEUE = (
    "the loop runs on the device and waits for no output: it needs no queue; a late computer costs rows, not the test"
)
"""What there is to recommend for a bench whose loop runs on its device."""


def who_runs(daq: DAQ, bench: Bench) -> tuple[bool, str]:
    """Return whether the open device runs the loop of a bench, and why not where the bench would have it so.

    Errors: those of `rig.loop.on_device.why_on_computer`.
    """
    if not isinstance(daq, RunsLoops) or daq.loop == "computer":
        return False, ""
    why = why_on_computer(daq, chunk_of(bench))
    return not why, why


def why_no_room(daq: DAQ, sizes: Mapping[str, int], *, may_change: bool) -> str:
    """Return why the device does not hold a plan's records; raise `DaqRefused` where the computer may not run it instead.

    ``sizes``: of the records (`rig.loop.on_device.record_sizes`), empty where they are not known yet.
    """
    assert isinstance(daq, RunsLoops)
    why = daq.why_no_room(sizes) if sizes else ""
    if why and daq.loop != "auto" and not may_change:
        raise DaqRefused(f"{why}: {SMALLER}")
    return why
