"""A host that drives an emulator until somebody kills it: ``python -m ... PORT WATCHDOG_S``."""

import sys

import numpy as np

from rig.bench import DriverChoice
from rig.drivers import make_daq
from tests.rig.rigs import bench_with

BLOCK = 125  # 25 ms
RAMP_S = 0.1


def main() -> None:
    options = {"port": sys.argv[1], "watchdog_s": float(sys.argv[2]), "ramp_s": RAMP_S, "timeout_s": 60.0}
    with make_daq(bench_with().model_copy(update={"driver": DriverChoice(name="serial", options=options)})) as daq:
        daq.start(BLOCK)
        for number in range(1_000_000):
            daq.exchange(np.full(BLOCK, 0.2))
            if number == 10:
                print("driving", flush=True)


if __name__ == "__main__":
    main()
