"""What watching costs: ``python -m benchmarks.watched [--seconds 15] [--clients 12] [--channels 4] [--pairs 5]``.

A virtual rig at 5 kHz runs by the clock, in turn with so many sockets of a page's server beside it, in a process of their own,
and with none. Of each: processor time of campaign, server and clients as a share of one core, the response time of the loop
(p50, p99, p99.9, us) and its late blocks; at the end the median over the pairs, watched over unwatched.
"""

import argparse
import contextlib
import http.client
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin

RUN = (
    "import json, sys, rig\n"
    "from pathlib import Path\n"
    "from benchmarks.long_records import long_plan, wide\n"
    "seconds, channels, path = float(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3])\n"
    "with rig.run(long_plan(seconds), bench=wide(channels), output=path, realtime=True) as run:\n"
    "    loop = run.recording.parts[-1].end['loop']\n"
    "    kept = ('response_us', 'overruns', 'samples', 'wall_s')\n"
    "    print(json.dumps({name: loop[name] for name in kept}))\n"
)
MONITOR = "from rig.cli import main; import sys; sys.argv = ['rig', 'monitor']; main()"
TIMES = ("p50", "p99", "p99_9")


def watch(address: str, clients: int) -> None:
    """Open sockets as so many pages would, and read until this process is ended."""
    parts = urlsplit(address)
    origin = f"{parts.scheme}://{parts.netloc}"
    cookie, page = "", ""
    for path in (f"/?{parts.query}", "/"):
        connection = http.client.HTTPConnection(parts.hostname or "", parts.port)
        connection.request("GET", path, headers={"Cookie": cookie} if cookie else {})
        answer = connection.getresponse()
        page = answer.read().decode()
        cookie = cookie or str(answer.getheader("set-cookie")).partition(";")[0]
    found = re.search(r'value="([\w-]{43})"', page)
    assert found is not None
    feed = f"ws://{parts.netloc}/feed?token={found[1]}"

    watching = threading.Barrier(clients + 1)

    def read() -> None:
        with connect(feed, origin=Origin(origin), additional_headers={"Cookie": cookie}, max_size=None) as socket:
            watching.wait()
            with contextlib.suppress(ConnectionClosed):
                for _ in socket:
                    pass

    for _ in range(clients):
        threading.Thread(target=read).start()  # until the server ends
    watching.wait()
    print("watching", flush=True)


def once(seconds: float, clients: int, channels: int) -> dict[str, Any]:
    """One run: what its loop says of itself, and shares of a core."""
    others: dict[str, subprocess.Popen[str]] = {}
    if clients:
        others["server"] = subprocess.Popen([sys.executable, "-c", MONITOR], stdout=subprocess.PIPE, text=True)
        address = _line(others["server"]).split()[-1]
        watcher = [sys.executable, "-m", "benchmarks.watched", "--watch", address, "--clients", str(clients)]
        others["clients"] = subprocess.Popen(watcher, stdout=subprocess.PIPE, text=True)
        _line(others["clients"])
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", RUN, str(seconds), str(channels), str(Path(folder) / "run.h5")]
        run = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        out = json.loads(_line(run))
        shares = {"campaign": _ended(run) / out["wall_s"]}
    if clients:
        others["server"].terminate()  # the clients end with it
    for name, process in others.items():
        shares[name] = _ended(process) / out["wall_s"]
    return {**out, "cores": shares}


def _line(process: "subprocess.Popen[str]") -> str:
    """The next line that a process prints."""
    assert process.stdout is not None
    return process.stdout.readline()


def _ended(process: "subprocess.Popen[str]") -> float:
    """Wait for a process; its processor time, s."""
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = status
    if process.stdout is not None:
        process.stdout.close()
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--clients", type=int, default=12)
    parser.add_argument("--channels", type=int, default=4)
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--watch", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.watch:
        watch(given.watch, given.clients)
        return
    pairs = []
    for number in range(given.pairs):
        order = (given.clients, 0)[:: (1, -1)[number % 2]]  # neither side always comes first
        sides = {clients: once(given.seconds, clients, given.channels) for clients in order}
        pairs.append([sides[given.clients], sides[0]])
        print(json.dumps(pairs[-1]), flush=True)
    for name in TIMES:
        ratios = [watched["response_us"][name] / alone["response_us"][name] for watched, alone in pairs]
        print(
            f"response {name}, watched over unwatched: {statistics.median(ratios):.3g} ({min(ratios):.3g} to {max(ratios):.3g})"
        )
    for side, name in enumerate(("watched", "unwatched")):
        late = [pair[side]["overruns"] for pair in pairs]
        among = statistics.median(pair[side]["samples"] for pair in pairs)
        print(f"late blocks among {among:g}, {name}: {statistics.median(late):g} ({min(late)} to {max(late)})")
    for name in ("campaign", "server", "clients"):
        print(f"{name}: {statistics.median(pair[0]['cores'][name] for pair in pairs):.3f} of a core")
    print(f"campaign unwatched: {statistics.median(pair[1]['cores']['campaign'] for pair in pairs):.3f} of a core")


if __name__ == "__main__":
    main()
