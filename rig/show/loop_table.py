"""Print the recorded timing of a wall-clock loop."""

from collections.abc import Mapping
from typing import Any

from rig.figures.lateness import PACED, TIMES
from rig.text.console import number, print_table

GRANTED = ("scheduling", "memory", "timer_slack", "processor", "garbage_collector")
SHARES = {"p50": "p50", "p99": "p99", "p99_9": "p99.9", "largest": "largest"}


def print_loop(loop: Mapping[str, Any], counters: Mapping[str, int]) -> None:
    """Print pacing, real-time settings granted by the machine, lateness, overruns, lost samples and round trips.

    Nothing is printed if no clock paced the loop. ``loop`` and ``counters`` are those in the end record of a part.
    """
    said = loop.get("real_time")
    if not said:
        return
    granted = "; ".join(f"{name.replace('_', ' ')} {said[name]}" for name in GRANTED if name in said)
    lost = f"{counters.get('lost_samples', 0)} lost samples"
    if said.get("loop") == "device":
        print(f"  the loop ran on the device, its rows were collected; {granted}")
        print(f"  {lost}")
    else:
        print(f"  {PACED.get(said['pacing'], said['pacing'])}; {granted}")
        _print_times(loop, lost)
    if "round_trip_p50_us" in loop:
        told = ", ".join(
            f"{share} {loop[f'round_trip_{share}_us']:.0f} us"
            for share in ("p50", "p99", "largest")
            if f"round_trip_{share}_us" in loop
        )
        print(f"  round trip to the device: {told}")


def _print_times(loop: Mapping[str, Any], lost: str) -> None:
    counted = {name: loop[f"{key}_us"] for key, name in TIMES.items() if f"{key}_us" in loop}
    rows = [(f"  {name}", *(number(found[key], ".1f") for key in SHARES)) for name, found in counted.items()]
    print_table(("  of a block, us", *SHARES.values()), rows)
    blocks = sum(loop["histograms"]["execution"]["count"]) if "histograms" in loop else 0
    print(
        f"  {loop['overruns']} overruns in {blocks} blocks (response beyond {loop['deadline_us']:g} us, or left out), "
        f"{lost}"
    )
