"""A child process of `rig.system.child` that does what its argument says."""

import os
import signal
import sys
import time
from pathlib import Path

from rig.system.child import confine

if __name__ == "__main__":
    what = sys.argv[1]
    confine(float(sys.argv[-1]))
    if what == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    elif what == "fail":
        sys.exit(3)
    elif what == "hang":
        time.sleep(600.0)
    elif what == "spin":
        while True:
            pass
    elif what == "fill":
        try:
            print(len(bytearray(5 * 2**30)))
        except MemoryError:
            print("no memory")
    elif what == "write-pid-and-hang":
        Path(sys.argv[2]).write_text(str(os.getpid()))
        time.sleep(600.0)
    else:
        print(what)
