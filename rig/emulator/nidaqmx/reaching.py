"""The bench that reaches the emulated NI devices."""

from typing import TYPE_CHECKING

from rig.bench import Bench, DriverChoice
from rig.emulator.nidaqmx.devices import DELTA_SIGMA_HZ, NI_9234, coerced_hz, system

if TYPE_CHECKING:
    from rig.bench.configuration import Table

LOWEST_HZ = DELTA_SIGMA_HZ / 4
"""Lowest sample rate of the bench, Hz: the filters of the inputs delay by 38.4 samples, 3 ms at this rate."""
BLOCK = 64
"""Samples in a block, 5 ms at that rate: a block costs two calls of about 1 ms."""
AHEAD = 3
"""Blocks ahead in the output buffer by the clock: 15 ms at that rate, for calls of 1 ms that come through two processes."""
OUTPUT = "cDAQ1Mod3/ao0"
"""Output that drives the rig."""


def chassis_options(bench: Bench, port: int, *, lockstep: bool) -> "Table":
    """Driver options that reach the chassis of a server on a port, with the sensors of a virtual bench on its inputs."""
    sockets = [name for device in system().values() if device.chassis for name in device.channels("ai")]
    return {
        "server": f"127.0.0.1:{port}",
        "output": OUTPUT,
        "inputs": sockets[: len(bench.channels)],
        "coupling": ["DC" if channel.loopback else "AC" for channel in bench.channels],
        "excitation_ma": [0.0 if channel.loopback else 1e3 * NI_9234.iepe_a for channel in bench.channels],
        "lockstep": lockstep,
        **({} if lockstep else {"buffer_blocks": AHEAD}),
    }


def reaching_bench(bench: Bench, options: "Table") -> Bench:
    """Return the bench that reaches the chassis of a virtual bench: at a rate of its inputs, with blocks of 5 ms.

    Channels that read the output come last, as the next input of the chassis does; the others are AC coupled.
    """
    rate_hz = coerced_hz([NI_9234], max(bench.sample_rate_hz, LOWEST_HZ))
    coupled = {"input_high_pass_hz": NI_9234.high_pass_hz}
    changes = {
        "channels": tuple(one if one.loopback else one.model_copy(update=coupled) for one in bench.channels),
        "driver": DriverChoice(name="nidaqmx", options=options),
        "sample_rate_hz": rate_hz,
        "block": BLOCK,
    }
    return bench.model_copy(update=changes)
