"""A process that drives a bench until it is killed: ``python -m rig.conformance.driving``, with what to do on its input.

One line of JSON: ``bench``, and ``amplitude_v`` that is held on the output. It says ``driven`` once that is on the converter.
"""

import json
import os
import sys
import time

import numpy as np

from rig.bench import Bench
from rig.drivers import make_daq


def main() -> None:
    """Drive; ends by itself only where the process that wanted it is gone."""
    told, parent = json.loads(sys.stdin.readline()), os.getppid()
    bench = Bench.model_validate(told["bench"])
    with make_daq(bench) as daq:
        daq.clear()
        daq.start(bench.block)
        voltages = np.full(bench.block, float(told["amplitude_v"]))
        number, due = 0, time.monotonic()
        while os.getppid() == parent:
            daq.exchange(voltages)
            number += 1
            if number == daq.queue_blocks + 2:
                print("driven", flush=True)
            due += bench.block / bench.sample_rate_hz
            if not daq.capabilities.paced:
                time.sleep(max(0.0, due - time.monotonic()))


if __name__ == "__main__":
    main()
