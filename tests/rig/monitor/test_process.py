"""The server as a process: how it begins, how it ends, and what becomes of the page when either goes wrong."""

import json
import os
import queue
import signal
import socket
import stat
import sys
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from rig.errors import ConfigurationError, RecordingError
from rig.live import place
from rig.live.publisher import Publisher
from rig.monitor import opening, process
from rig.monitor.connections import FeedConnection
from rig.monitor.process import Address, PageServer
from rig.monitor.sources import Latest, always, chosen
from tests.refused import refused
from tests.rig.monitor.commands import address_in, monitor, started
from tests.rig.monitor.scripted import Scripted, facts, point
from tests.rig.monitor.visitor import Visitor, served
from tests.waiting import LONG_S, wait_until

PLAN = """
kind = "backbone"
bench = "magnet-beam"
levels_v = [0.4]
record_periods = 20

[controller]
low_pass_rad_s = 6.283185307179586
k1 = 2.0
k2 = 6.283185307179586
centre_frequency_hz = 24.0
frequency_window_hz = [21.933, 26.807]
"""
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals, and files only their user reads")


@pytest.mark.parametrize(
    ("number", "status", "said"), [(signal.SIGINT, 0, ""), (signal.SIGTERM, 143, "rig: ended by SIGTERM\n")]
)
def test_a_signal_ends_the_server_in_order(number, status, said):
    with monitor() as (server, url):
        visitor = Visitor(url).enter()
        with visitor.feed():
            server.send_signal(number)
            _, err = server.communicate(timeout=LONG_S)
    assert (server.returncode, err) == (status, said)


def test_a_server_ends_in_order_while_a_client_says_goodbye(monkeypatch):
    ended = queue.SimpleQueue()
    leaves = FeedConnection.handle_close

    def leaves_as_the_server_ends(feed, event):
        leaves(feed, event)
        try:
            feed.shutdown()
            ended.put("in order")
        except Exception as error:
            ended.put(error)

    monkeypatch.setattr(FeedConnection, "handle_close", leaves_as_the_server_ends)
    with served(Scripted()) as server, Visitor(server.url).enter().feed():
        pass
    assert ended.get(timeout=LONG_S) == "in order"


def test_a_port_that_is_taken_is_told_in_one_line():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with started("monitor", "--port", str(port)) as process:
            out, err = process.communicate(timeout=LONG_S)
    assert process.returncode == 1
    assert out == ""
    assert (
        err
        == f"rig: --bind = 127.0.0.1, --port = {port}: cannot be used (Address already in use); 0 chooses a free --port\n"
    )


def test_a_port_that_was_just_left_can_be_had_again():
    with served(Scripted()) as server:
        Visitor(server.url).enter()
        port = server.port
    with served(Scripted(), address=Address(port=port)) as server:
        Visitor(server.url).enter()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            {"bind": "0.0.0.0"},
            {"field": "bind", "value": "0.0.0.0", "allowed": "one address of this machine, not all at once"},
        ),
        ({"bind": "::"}, {"field": "bind", "value": "::", "allowed": "one address of this machine, not all at once"}),
        ({"bind": ""}, {"field": "bind", "value": "", "allowed": "one address of this machine, not all at once"}),
        ({"port": 65536}, {"field": "port", "value": 65536, "allowed": "0 to 65535, 0 for a free one"}),
        ({"key": Path("k.pem")}, {"says": "wants-certificate-as-well", "field": "key"}),
    ],
)
def test_an_address_that_cannot_be_is_refused(given, said):
    with refused(ConfigurationError, **said):
        Address(**given)


@pytest.mark.parametrize("bind", ["192.0.2.123", "no.such.host.invalid", "a" * 100])
def test_an_address_of_another_machine_is_refused(bind):
    with refused(ConfigurationError, "bind-is-no-address-of-this"):
        Address(bind=bind).listen()


def test_loopback_is_plain_and_everything_else_is_not():
    assert [Address(bind=bind).loopback for bind in ("127.0.0.1", "127.1.2.3", "::1", "localhost")] == [True] * 4
    assert [Address(bind=bind).loopback for bind in ("192.0.2.1", "fd00::2", "bench.lab.example")] == [False] * 3


def test_a_server_that_is_killed_leaves_the_run_alone_and_another_takes_over(tmp_path):
    """The new one has another address, shows everything from the beginning, and can stop."""
    output = tmp_path / "run.h5"
    with Publisher(facts(recording=str(output)), 4) as run:
        run.line("part", {})
        run.line("point", point(0))
        with monitor(str(output)) as (first, url):
            old = Visitor(url).enter()
            assert [line["is"] for line in old.state()["lines"]] == ["part", "point"]
            first.kill()
            first.wait()
            with pytest.raises(OSError):  # noqa: PT011 (the page then says NOT CONNECTED)
                old.get("/stopping")
            run.line("point", point(1))
        with monitor(str(output), "--port", str(old.port)) as (_, url):
            assert old.get("/").status == 403  # the old page's cookie and token are of no use
            answer = old.stop()
            assert (answer.status, "NOT STOPPED: USE THE HARDWARE STOP" in answer.text) == (403, True)
            assert not (run.folder / place.STOP).exists()
            new = Visitor(url).enter()
            assert [line.get("number") for line in new.state()["lines"]] == [None, 0, 1]
            new.stop()
            assert (run.folder / place.STOP).read_text() == "stopped on the page"


@pytest.mark.slow
def test_a_run_with_a_page_beside_it(tmp_path):
    """The run says where the page is; the page stays after the run and shows its end."""
    (tmp_path / "plan.toml").write_text(PLAN)
    with started("run", str(tmp_path / "plan.toml"), "-o", str(tmp_path / "run.h5"), "--realtime", "--monitor") as run:
        assert run.stderr is not None
        line = next(line for line in run.stderr if not line.startswith("["))  # said while nothing else is
        assert line.startswith("note: the page is at http://127.0.0.1:")
        visitor = Visitor(address_in(line)).enter()
        wait_until(lambda: visitor.state()["facts"] is not None, "the run on the page")
        with visitor.feed():
            out, _ = run.communicate(timeout=LONG_S)  # and the page holds none of its pipes
            assert run.returncode == 0
            assert "the plan was carried out" in out
            wait_until(lambda: not visitor.state()["connected"], "its end on the page")
            state = visitor.state()
    assert state["frame"]["state"] == "finished"
    assert state["lines"][-1]["text"] == "the plan was carried out"
    assert state["facts"]["recording"] == str(tmp_path / "run.h5")


def test_the_page_of_a_run_ends_once_nobody_watches(monkeypatch):
    monkeypatch.setattr(process, "LINGER_S", 0.0)
    run = Scripted()
    run.connected = False
    server = PageServer(always(run), alone=lambda: True)
    server.run()  # it returns


def test_the_page_of_a_run_that_never_began_ends(monkeypatch):
    server = PageServer(Latest(lambda facts: False), alone=lambda: True)
    server.run()


def test_of_a_folder_the_runs_into_it_are_shown(tmp_path):
    inside, elsewhere = tmp_path / "in", tmp_path / "out"
    inside.mkdir()
    elsewhere.mkdir()
    look = chosen(inside)
    with Publisher(facts(recording=str(elsewhere / "run.h5")), 4):
        assert look(None) is None
        look._looked_s = float("-inf")
        with Publisher(facts(recording=str(inside / "run.h5")), 4) as run:
            view = look(None)
            assert view is not None
            assert view.folder == run.folder
            look.close()


def test_a_file_in_no_folder_is_refused():
    with refused(RecordingError, "there-is-no-folder"):
        chosen(Path("/no/such/folder/run.h5"))


@pytest.fixture
def browser(tmp_path, monkeypatch):
    """A browser that notes what it is called with, and the rights and text of the file that it is to open."""
    script, noted = tmp_path / "browser", tmp_path / "noted.json"
    script.write_text(
        f"#!{sys.executable}\nimport json, os, sys, urllib.parse\n"
        "path = urllib.parse.unquote(urllib.parse.urlsplit(sys.argv[1]).path)\n"
        f"told = [sys.argv[1:], os.stat(path).st_mode, open(path).read()]\n"
        f"json.dump(told, open({str(noted)!r} + '.part', 'w'))\nos.rename({str(noted)!r} + '.part', {str(noted)!r})\n"
    )
    script.chmod(0o700)
    monkeypatch.setenv("BROWSER", str(script))
    return noted


def test_the_browser_gets_the_address_by_a_file_that_only_the_user_reads(browser):
    with monitor("--open") as (server, url):
        wait_until(browser.exists, "the browser")
        arguments, mode, text = json.loads(browser.read_text())
        token = url.partition("token=")[2]
        assert len(arguments) == 1
        assert token not in arguments[0]
        assert stat.S_IMODE(mode) == 0o600
        assert f'content="0;url={url}"' in text
        file = Path(unquote(urlsplit(arguments[0]).path))
        assert file.parent == place.base_folder()
        Visitor(url).enter()
        assert not file.exists()
        assert server.stdout is not None
        assert "for another browser: http://" in server.stdout.readline()


def test_the_file_for_the_browser_goes_with_the_server(browser):
    with monitor("--open") as (server, _):
        wait_until(browser.exists, "the browser")
        server.terminate()
        server.communicate(timeout=LONG_S)
        assert list(place.base_folder().glob("open-*")) == []


def test_with_a_full_disk_the_address_is_printed_all_the_same(monkeypatch):
    def full(*arguments):
        raise OSError(28, "No space left on device")

    said = []
    monkeypatch.setattr(os, "open", full)
    assert opening.open_in_browser("http://127.0.0.1:1/?token=x", said.append) is None
    assert said == [
        "no browser is opened, as there is no room for the file that tells it the address (No space left on device)"
    ]


def test_without_a_browser_a_line_says_so(monkeypatch):
    said = []
    monkeypatch.setattr("webbrowser.open", lambda uri: False)
    path = opening.open_in_browser("http://127.0.0.1:1/?token=x", said.append)
    assert path is not None
    wait_until(lambda: said == ["no browser could be opened here"], "the line")
    path.unlink()
