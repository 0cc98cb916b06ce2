"""Strangers at the door keep nobody out who has a key: counted by who is answered, with rooms of a few places."""

import asyncio
import errno
import os
import socket
import ssl
import sys
from contextlib import ExitStack, suppress

import pytest

from rig.monitor import connections, door, visits
from rig.monitor.process import Address
from rig.monitor.security import Keys, is_whole
from rig.monitor.visits import Capacity, capacity
from tests.rig.monitor.crowd import SAID, trusting_all
from tests.rig.monitor.scripted import Scripted
from tests.rig.monitor.visitor import Visitor, heard, served
from tests.waiting import LONG_S, wait_until

CROWD = 30
ANY = trusting_all()
SMALL = Capacity(waiting=8, strangers=4)


@pytest.fixture
def run():
    return Scripted()


@pytest.fixture
def little_room(monkeypatch):
    """Few places, which strangers lose at once."""
    monkeypatch.setattr(visits, "TURN_S", 0.0)
    monkeypatch.setattr(door, "capacity", lambda: SMALL)


@pytest.fixture(params=["http", "https"])
def server(request, run, little_room, tls_files):
    """A server with little room."""
    address = Address(certificate=tls_files) if request.param == "https" else Address()
    with served(run, address=address) as server:
        yield server


@pytest.fixture(scope="module")
def tls_files(tmp_path_factory):
    """Certificate and key in one file."""
    from rig.monitor.certificate import _made

    path = tmp_path_factory.mktemp("tls") / "both.pem"
    path.write_bytes(b"".join(reversed(_made("127.0.0.1"))))
    return path


def visitor(server) -> Visitor:
    """Somebody with the address."""
    return Visitor(server.url, ANY if server.scheme == "https" else None)


def strangers(server, kind: str, number: int, stack: ExitStack) -> list[socket.socket]:
    """So many connections of a kind, held open on this side."""
    held = []
    for _ in range(number):
        one = stack.enter_context(socket.create_connection(("127.0.0.1", server.port), LONG_S))
        if kind == "greeted" and server.scheme == "https":
            one = stack.enter_context(ANY.wrap_socket(one))
        elif SAID[kind]:
            one.sendall(SAID[kind])
        held.append(one)
    return held


@pytest.mark.parametrize("kind", sorted(SAID))
def test_a_crowd_keeps_out_neither_the_operator_nor_a_newcomer(server, run, kind):
    operator = visitor(server).enter()
    with ExitStack() as crowd:
        strangers(server, kind, CROWD, crowd)
        newcomer = visitor(server).enter()
        assert [who.stop().status for who in (operator, newcomer) for _ in range(5)] == [200] * 10
    assert len(run.stops) == 10


def test_an_operator_who_is_connected_stays_so(run, little_room):
    with served(run) as server, visitor(server).enter().feed() as feed, ExitStack() as crowd:
        heard(feed)
        for kind in SAID:
            strangers(server, kind, CROWD // 2, crowd)
            heard(feed)
        feed.ping().wait(LONG_S)


def test_stop_by_a_socket_needs_no_connection(run, little_room):
    with served(run) as server, visitor(server).enter().feed() as feed, ExitStack() as crowd:
        strangers(server, "silent", CROWD, crowd)
        feed.send("stop")
        wait_until(lambda: run.stops == ["stopped on the page"], "the stop")
        feed.send("something else")
        heard(feed)
    assert len(run.stops) == 1


@pytest.mark.parametrize("kind", sorted(SAID))
def test_no_more_strangers_are_kept_than_there_is_room_for(server, kind, monkeypatch):
    monkeypatch.setattr(door, "MESSAGE_S", 0.5)
    monkeypatch.setattr("rig.monitor.connections.REQUEST_S", 0.5)
    with ExitStack() as crowd:
        strangers(server, kind, CROWD, crowd)
        visitor(server).enter()
        seen = server._server.door
        most = SMALL.waiting + SMALL.strangers
        wait_until(lambda: len(seen._unfinished) + len(seen._queue) + len(seen.visits.strangers) <= most, "few")
        assert len(seen.visits.strangers) <= SMALL.strangers
        wait_until(lambda: not (seen._unfinished or seen._queue or seen.visits.strangers), "all forgotten")


def test_a_browser_that_opens_a_thousand_connections_loses_its_oldest_and_still_stops(run, monkeypatch):
    monkeypatch.setattr(visits, "MOST_KNOWN", 3)
    monkeypatch.setattr(visits, "MOST_FEEDS", 2 * visits.MOST_SOCKETS)
    with served(run) as server, ExitStack() as held:
        operator = visitor(server).enter()
        request = f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nCookie: {operator.cookie}\r\n\r\n".encode()
        for _ in range(CROWD):
            one = held.enter_context(socket.create_connection(("127.0.0.1", server.port), LONG_S))
            one.sendall(request)
            assert one.recv(12) == b"HTTP/1.1 200"
        assert len(server._server.door.visits.known) == 3
        assert operator.stop().status == 200


def test_without_a_key_there_is_one_answer_on_a_connection(run):
    with served(run) as server:
        with socket.create_connection(("127.0.0.1", server.port), LONG_S) as one:
            one.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n".encode() * 2)
            told = b"".join(iter(lambda: one.recv(65536), b""))
        assert told.count(b"HTTP/1.1 ") == 1
        assert told.startswith(b"HTTP/1.1 403")


@pytest.mark.skipif(sys.platform == "win32", reason="another event loop")
def test_a_system_without_descriptors_ends_no_server(run, monkeypatch):
    """Accepting fails some times, as it does while others hold all descriptors: who connects is answered afterwards."""
    failing = [errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM, errno.ECONNABORTED]
    accept = asyncio.SelectorEventLoop.sock_accept

    async def scarce(self, listening):
        found = await accept(self, listening)
        if failing:
            found[0].close()
            number = failing.pop()
            raise OSError(number, os.strerror(number))
        return found

    with served(run) as server:
        operator = visitor(server).enter()
        monkeypatch.setattr(door, "RETRY_S", 0.0)
        monkeypatch.setattr(asyncio.SelectorEventLoop, "sock_accept", scarce)
        while failing:
            with suppress(OSError):
                operator.get("/stopping")
        assert operator.stop().status == 200


@pytest.mark.parametrize("limits", [(1024, 1024), (1024, 4096), (256, 256), (-1, -1), (1024, -1)])
def test_connections_fit_into_the_descriptors(limits, monkeypatch):
    resource = pytest.importorskip("resource")
    now = list(limits)
    monkeypatch.setattr(resource, "getrlimit", lambda kind: tuple(now))
    monkeypatch.setattr(resource, "setrlimit", lambda kind, given: now.__setitem__(slice(None), given))
    found = capacity()
    kept = visits.MOST_KNOWN + visits.MOST_FEEDS + visits.FILES
    assert 0 < found.strangers <= 128
    assert now[1] == limits[1]
    assert now[0] == -1 or sum(found) + kept <= now[0]


@pytest.mark.parametrize("cut", [1, 4, 5, 100, 516])
def test_a_greeting_is_whole_once_its_record_is(cut):
    incoming, outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
    with pytest.raises(ssl.SSLWantReadError):
        trusting_all().wrap_bio(incoming, outgoing).do_handshake()
    greeting = outgoing.read()
    assert is_whole(greeting, tls=True)
    assert not is_whole(greeting[:cut], tls=True)
    assert not is_whole(greeting[:-1], tls=True)
    assert is_whole(b"GET / HTTP/1.1", tls=True)  # no TLS at all: it is refused
    assert is_whole(b"\x16\x03\x01\xff\xff", tls=True)


def test_a_request_is_whole_with_its_empty_line():
    whole = b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"
    assert is_whole(whole, tls=False)
    assert not any(is_whole(whole[:cut], tls=False) for cut in range(1, len(whole)))
    assert is_whole(b"x" * 16384, tls=False)  # too long: it is refused


def test_a_key_is_seen_in_a_request_before_it_is_read():
    keys = Keys()
    own = f"{keys.cookie_name}={keys.cookie}"
    assert keys.shown_by(f"POST /stop HTTP/1.1\r\nhost: x\r\nCOOKIE:a=b; {own}\r\n\r\n".encode())
    assert keys.shown_by(f"GET /?token={keys.entry} HTTP/1.1\r\n\r\n".encode())
    wrong = [
        f"GET /{own} HTTP/1.1",
        f"GET / HTTP/1.1\r\nX-Cookie: {own}",
        f"GET / HTTP/1.1\r\nCookie: {own}x",
        "GET",
        "",
    ]
    wrong += [f"GET /?token={keys.action} HTTP/1.1", "\x00\xff: \xfe", "GET /?token=%ff%00&&& HTTP/1.1", ":" * 9000]
    assert not any(keys.shown_by(f"{text}\r\n\r\n".encode("latin-1")) for text in wrong)
    assert keys.opens(keys.entry)  # it was looked at, not used


def test_nothing_a_stranger_does_is_told(server, capfd):
    with ExitStack() as crowd:
        for kind in SAID:
            strangers(server, kind, CROWD // 2, crowd)
        for said in (
            b"\x00" * 500,
            b"GET / HTTP/9\r\n\r\n",
            b"X" * 20000,
            b"GET /feed HTTP/1.1\r\nUpgrade: websocket\r\n\r\n",
        ):
            one = crowd.enter_context(socket.create_connection(("127.0.0.1", server.port), LONG_S))
            one.sendall(said)
        visitor(server).enter()
    assert capfd.readouterr() == ("", "")


def test_uvicorn_listens_nowhere_itself(run):
    with served(run) as server:
        Visitor(server.url).enter()
        assert isinstance(server._server, connections.DoorServer)
        assert server._server.servers == []
