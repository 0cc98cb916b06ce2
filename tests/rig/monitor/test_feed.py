"""What watchers are sent: made once for all, everything to who comes late, nobody waited for."""

import itertools
import json
import socket
import threading
from contextlib import ExitStack
from types import SimpleNamespace

import pytest

from rig.live.place import runs
from rig.live.publisher import Publisher
from rig.monitor.feed import Earlier, Place
from rig.monitor.replay import ReplayState
from rig.monitor.sources import Latest
from rig.tick.safety.layout import GuardMode
from tests.rig.monitor.scripted import Scripted, facts, point
from tests.rig.monitor.visitor import Visitor, heard, served
from tests.waiting import LONG_S, wait_until

END = {"is": "end", "text": "the plan was carried out", "completed": True}


@pytest.fixture
def run():
    return Scripted()


@pytest.fixture
def server(run):
    with served(run) as server:
        yield server


@pytest.fixture
def inside(server) -> Visitor:
    return Visitor(server.url).enter()


def until(socket, has_come):
    """All messages up to the one in which something has come."""
    out = []
    while not out or not has_come(out[-1]):
        out.append(heard(socket))
    return out


def numbers(messages):
    return [line["number"] for message in messages for line in message["lines"] if line["is"] == "point"]


def test_the_first_message_is_whole_and_the_next_bring_what_is_new(run, inside):
    run.tell({"is": "part"}, point(0))
    with inside.feed() as socket:
        first = heard(socket)
        assert first["is"] == "whole"
        assert first["facts"]["bench"] == "magnet-beam"
        assert first["connected"] is True
        assert (first["replay"], first["earlier"]) == (None, None)
        assert [line["is"] for line in first["lines"]] == ["part", "point"]
        assert (first["bins"]["first"], len(first["bins"]["end_s"])) == (0, 1)
        run.tell(point(1))
        run.step(voltage_v=0.5)
        *_, last = until(socket, lambda message: message["lines"])
        assert last["is"] == "next"
        assert "facts" not in last
        assert numbers([last]) == [1]
        if last["frame"]["voltage_v"] != 0.5:
            last = heard(socket)
        assert last["frame"]["voltage_v"] == 0.5
        assert last["frame"]["age_s"] >= 0.0


def test_who_comes_late_gets_all_points_and_traces_so_far(run, inside):
    for number in range(500):
        run.tell(point(number))
        run.step()
    with inside.feed() as socket:
        first = heard(socket)
    assert numbers([first]) == list(range(500))
    assert len(first["bins"]["end_s"]) == 501
    whole = inside.state()
    assert numbers([whole]) == list(range(500))
    assert whole["is"] == "whole"


def test_numbers_for_every_harmonic_are_left_out_of_lines(run, inside):
    run.tell(point(0))
    assert "harmonics" not in inside.state()["lines"][0]


def test_where_nothing_changes_the_server_still_shows_that_it_lives(inside):
    with inside.feed() as socket:
        ages = [heard(socket)["frame"]["age_s"] for _ in range(5)]
    assert ages == sorted(ages)
    assert ages[-1] > ages[0]


def test_a_run_that_dies_is_no_longer_connected(run, inside):
    with inside.feed() as socket:
        assert heard(socket)["connected"] is True
        run.connected = False
        last = until(socket, lambda message: not message["connected"])[-1]
        assert not any(line["is"] == "end" for line in last["lines"])


def test_a_view_that_cannot_be_read_is_told_of_and_the_page_goes_on(run, inside, monkeypatch):
    def fail(first):
        raise OSError(5, "Input/output error")

    with inside.feed() as socket:
        heard(socket)
        with monkeypatch.context() as patch:
            patch.setattr(run, "lines", fail)
            last = until(socket, lambda message: message["frame"]["state"] == "unreadable")[-1]
            assert "Input/output error" in last["frame"]["cause"]
            assert last["connected"] is False
        assert until(socket, lambda message: message["connected"])[-1]["frame"]["state"] != "unreadable"


def test_a_message_is_made_once_for_all_who_are_as_far(run, server, inside, monkeypatch):
    """Twenty clients. Of one reading of the run, those who are as far get one and the same text."""
    made = {}
    message = server.feed.message

    async def noted(moment, since=Place()):  # noqa: B008 (immutable)
        text = await message(moment, since)
        made.setdefault((moment, since), []).append(text)  # holds the moment, so that no other takes its place
        return text

    monkeypatch.setattr(server.feed, "message", noted)
    with ExitStack() as sockets:
        all_of_them = [sockets.enter_context(inside.feed()) for _ in range(20)]
        for number in range(5):
            run.tell(point(number))
            run.step()
            for one in all_of_them:
                until(one, lambda message, number=number: numbers([message])[-1:] == [number])
    assert all(len({id(text) for text in texts}) == 1 for texts in made.values())
    assert sum(len(texts) for texts in made.values()) >= 20 * 5
    assert max(len(texts) for texts in made.values()) > 1


@pytest.mark.slow
def test_who_does_not_read_is_not_waited_for_and_loses_no_point(run, server, inside):
    """A client that stops reading, while another goes on; then it reads again."""
    with inside.feed(max_queue=1) as idle, inside.feed() as busy:
        heard(idle)
        heard(busy)
        got = []
        for number in range(300):
            run.tell(point(number) | {"padding": "x" * 20_000})
            run.step(level=number)
            got += numbers(until(busy, lambda message: message["lines"]))
        assert got == list(range(300))
        held = [connection.transport.get_write_buffer_size() for connection in server._server.server_state.connections]
        messages = until(idle, lambda message: message["frame"]["level"] == 299.0)
        assert numbers(messages) == list(range(300))
        assert len(messages) < 300  # frames were dropped
        assert max(held) <= 2**16 + max(len(json.dumps(message)) for message in messages)  # one message waited, no more
        ends = [end for message in messages for end in message["bins"]["end_s"]]
        assert ends == sorted(set(ends))


def test_who_never_reads_again_is_dropped(run, server, inside, monkeypatch):
    monkeypatch.setattr("rig.monitor.connections.STUCK_S", 0.2)
    handshake = (
        f"GET /feed?token={inside.token} HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nOrigin: {inside.origin}\r\n"
        f"Cookie: {inside.cookie}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", server.port), LONG_S) as deaf:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        deaf.sendall(handshake.encode())
        wait_until(lambda: server.feed.clients == 1, "the socket")
        padding, number = "x" * 500_000, itertools.count()

        def dropped():
            run.tell(point(next(number)) | {"padding": padding})
            run.step()
            return server.feed.clients == 0

        wait_until(dropped, "the socket dropped")
    with inside.feed() as socket_again:
        assert heard(socket_again)["is"] == "whole"


def test_a_run_that_is_over_stays_until_the_next_begins():
    """Its end is shown; then the next one, from its beginning, without the page being opened again."""
    with served(Latest()) as server:
        inside = Visitor(server.url).enter()
        with inside.feed() as socket:
            first = heard(socket)
            assert (first["facts"], first["frame"], first["lines"]) == (None, None, [])
            with Publisher(facts(bench="first"), 4) as run:
                run.line("part", {})
                run.line("point", point(0))
                until(socket, lambda message: message["is"] == "whole" and message["facts"]["bench"] == "first")
                run.line("end", END)
                until(socket, lambda message: any(line["is"] == "end" for line in message["lines"]))
            until(socket, lambda message: not message["connected"])
            assert server.feed.view is not None
            assert inside.state()["facts"]["bench"] == "first"
            with Publisher(facts(bench="second"), 4) as run:
                last = until(socket, lambda message: message["is"] == "whole")[-1]
                assert last["facts"]["bench"] == "second"
                assert last["lines"] == []
                run.line("point", point(5))
                assert numbers(until(socket, lambda message: message["lines"])) == [5]
    assert runs() == []


def test_an_earlier_run_is_sent_along_once(run):
    earlier = Earlier(facts(bench="earlier"), [point(0)])
    with served(run, earlier=earlier) as server, Visitor(server.url).enter().feed() as socket:
        first = heard(socket)
        assert first["earlier"]["facts"]["bench"] == "earlier"
        assert "earlier" not in heard(socket)


def test_a_replay_that_jumps_begins_anew(run, server, inside):
    run.generation = 0
    run.player = SimpleNamespace(replay_state=lambda: ReplayState(1.0, 2.0, playing=True, speed=5.0))
    run.tell(point(0), point(1))
    with inside.feed() as socket:
        assert numbers([heard(socket)]) == [0, 1]
        del run.told[1:]
        run.generation += 1
        last = until(socket, lambda message: message["is"] == "whole")[-1]
        assert numbers([last]) == [0]
        assert last["replay"]["speed"] == 5.0


def test_many_read_while_much_is_written(run, server, inside):
    """Ten clients in threads of their own, each gets every point once and in order."""
    over, got = threading.Event(), [[] for _ in range(10)]

    def watch(mine):
        with inside.feed() as socket:
            messages = until(socket, lambda message: any(line["is"] == "end" for line in message["lines"]))
            mine += numbers(messages)

    threads = [threading.Thread(target=watch, args=(mine,)) for mine in got]
    for thread in threads:
        thread.start()
    for number in range(400):
        run.tell(point(number))
        run.step()
        over.wait(0.002)
    run.step(GuardMode.OFF)
    run.tell(END)
    for thread in threads:
        thread.join(LONG_S)
    assert got == [list(range(400))] * 10
