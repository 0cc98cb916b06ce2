"""A reader that opens a run, reads once, and never again."""

import sys
import time
from pathlib import Path

from rig.live.reader import LiveRun

if __name__ == "__main__":
    run = LiveRun(Path(sys.argv[1]))
    run.frame(), run.lines(0), run.bins(0)
    print("reading", flush=True)
    time.sleep(600.0)
