"""The page of one run, beside it: ``python -m rig.monitor PROCESS``, started by ``rig run --monitor``.

Its one line on standard output is JSON: ``{"address": ...}`` or ``{"error": ...}``. When its standard input ends, because the
run's process does, it goes on for a while.
"""

import json
import os
import sys
import threading
from collections.abc import Mapping
from contextlib import suppress

from rig.system.privileges import lower_priority


def _main(process: int) -> None:
    lower_priority()  # before the libraries are read, which takes longest

    from rig.errors import RigError
    from rig.monitor.process import PageServer
    from rig.monitor.sources import Latest
    from rig.monitor.stopping import Stopping
    from rig.system.stop_signals import ended_in_order

    gone = threading.Event()

    def wait() -> None:
        os.read(0, 1)
        gone.set()

    threading.Thread(target=wait, name="the run's process", daemon=True).start()
    try:
        stopping = Stopping(expecting=lambda: not gone.is_set())
        look = Latest(lambda facts: facts.process == process, on_found=stopping.begun)
        server = PageServer(look, alone=gone.is_set, stopping=stopping)
    except (RigError, OSError) as error:
        _tell({"error": str(error)})
        return
    _tell({"address": server.url})
    with suppress(KeyboardInterrupt), ended_in_order():
        server.run()


def _tell(what: Mapping[str, str]) -> None:
    """Say it to the run's process, which reads one line; nobody reads what comes after it."""
    with suppress(OSError):
        print(json.dumps(what), flush=True)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)


if __name__ == "__main__":
    _main(int(sys.argv[1]))
