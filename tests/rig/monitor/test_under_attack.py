"""The page's STOP while strangers take all connections that they can get: by real processes, to 0 V."""

import re
import subprocess
import sys
from contextlib import ExitStack

import pytest

from rig.monitor.certificate import _made
from tests.rig.monitor.commands import address_in, monitor, started
from tests.rig.monitor.crowd import trusting_all
from tests.rig.monitor.test_stop import heading
from tests.rig.monitor.visitor import Visitor
from tests.waiting import wait_until

resource = pytest.importorskip("resource")
USUAL = 1024
"""Descriptors that a process may have on most systems."""


def few_descriptors() -> None:
    """What ``ulimit -n 1024`` does."""
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    most = USUAL if hard == resource.RLIM_INFINITY else min(USUAL, hard)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "kind", "number"),
    [("https", "silent", 1500), ("http", "silent", 200), ("http", "half a request", 200), ("http", "a request", 200)],
)
def test_a_run_is_stopped_by_the_page_under_attack(tmp_path, scheme, kind, number):
    """An operator who is in and a newcomer with the next address are answered at the first try, and STOP brings 0 V."""
    output, words = tmp_path / "run.h5", []
    if scheme == "https":
        (tmp_path / "both.pem").write_bytes(b"".join(reversed(_made("127.0.0.1"))))
        words = ["--certificate", str(tmp_path / "both.pem")]
    tls = trusting_all() if scheme == "https" else None
    with ExitStack() as stack:
        run = stack.enter_context(started("run", "magnet-beam/backbone", "--realtime", "-o", str(output)))
        stack.callback(run.kill)
        page, url = stack.enter_context(monitor(str(output), *words, preexec_fn=few_descriptors))
        operator = Visitor(url, tls).enter()
        wait_until(lambda: (operator.state()["frame"] or {}).get("voltage_v", 0.0) > 0.05, "some output")
        command = [sys.executable, "-m", "tests.rig.monitor.crowd", kind, str(number), str(operator.port)]
        crowd = stack.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        stack.callback(crowd.kill)
        assert crowd.stdout is not None
        assert crowd.stdout.readline() == "all there\n"
        assert [operator.get("/stopping").status for _ in range(5)] == [200] * 5
        assert page.stdout is not None
        newcomer = Visitor(address_in(page.stdout.readline()), tls).enter()
        said = [heading(newcomer.stop())]
        while said[-1] in ("STOP REQUESTED", "RAMPING DOWN"):
            said.append(heading(operator.get("/stopping")))
        assert said[-1] == "OUTPUT AT 0 V"
        printed, _ = run.communicate()
    assert run.returncode == 1
    assert re.search("stopped on the page", printed)
