"""Who gets in and who does not: tokens, cookies, hosts, origins, paths, sizes."""

import http.client
import re
import socket
from contextlib import ExitStack, suppress

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from rig.monitor import process, server as module
from rig.monitor.process import PageServer
from rig.monitor.security import HEADERS
from rig.monitor.visits import MOST_SOCKETS
from tests.rig.monitor.scripted import Scripted
from tests.rig.monitor.visitor import Visitor, heard, served
from tests.waiting import LONG_S, wait_until


@pytest.fixture
def run():
    return Scripted()


@pytest.fixture
def server(run):
    with served(run) as server:
        yield server


@pytest.fixture
def inside(server) -> Visitor:
    """A browser that has been let in."""
    return Visitor(server.url).enter()


def raw(server: PageServer, request: bytes, method: str = "GET") -> tuple[int, bytes]:
    """Status of the answer to bytes, and what it says."""
    with socket.create_connection(("127.0.0.1", server.port), LONG_S) as connection:
        connection.sendall(request)
        with http.client.HTTPResponse(connection, method=method) as answer:
            answer.begin()
            return answer.status, b"" if answer.status == 101 else answer.read()


def test_the_address_lets_one_browser_in_and_no_second(server):
    address = server.url
    Visitor(address).enter()
    second = Visitor(address)
    answer = second.get(second.door)
    assert answer.status == 403
    assert "set-cookie" not in answer.headers
    assert "rig monitor prints another" in answer.text
    Visitor(server.url).enter()  # the next address


def test_a_browser_that_is_in_may_open_its_old_address_again(server):
    visitor = Visitor(server.url).enter()
    assert visitor.get(visitor.door).status == 200


@pytest.mark.parametrize("token", ["", "wrong", "ä" * 43, "A" * 43, "%00", "x" * 5000])
def test_a_wrong_token_is_refused(server, token):
    answer = Visitor(server.url).get(f"/?token={token.encode('ascii', 'replace').decode()}")
    assert answer.status == 403
    assert "set-cookie" not in answer.headers


def test_the_cookie_is_for_this_server_alone_and_no_script_reads_it(server):
    visitor = Visitor(server.url)
    cookie = visitor.get(visitor.door).headers["set-cookie"]
    assert re.fullmatch(r"vibrolock-[0-9a-f]{8}=[\w-]{43}; HttpOnly; Path=/; SameSite=strict", cookie)


@pytest.mark.parametrize("path", ["/", "/state", "/stopping", "/folder", "/folder/0/figure.png"])
def test_without_the_cookie_nothing_is_shown(server, run, path):
    answer = Visitor(server.url).get(path, X_Token=server.keys.action)
    assert answer.status == 403
    assert run.facts.bench not in answer.text


def test_without_the_cookie_nothing_is_stopped(server, run):
    visitor = Visitor(server.url)
    answer = visitor.post("/stop", {"token": server.keys.action})
    assert answer.status == 403
    assert "NOT STOPPED: USE THE HARDWARE STOP" in answer.text
    assert run.stops == []


@pytest.mark.parametrize(
    "cookie", ["", "a=b", "=", "vibrolock-00000000=x", ";;;", "\xe4=\xf6", "{name}=wrong", "{name}"]
)
def test_a_forged_cookie_is_no_cookie(server, cookie):
    visitor = Visitor(server.url)
    visitor.cookie = cookie.format(name=server.keys.cookie_name)
    assert visitor.get("/").status == 403


def test_the_cookie_alone_neither_stops_nor_reads(inside, run):
    assert inside.get("/state").status == 403
    assert inside.get("/state", X_Token="wrong").status == 403
    for token in ("", "wrong", inside.cookie.partition("=")[2]):
        answer = inside.post("/stop", {"token": token})
        assert answer.status == 403
        assert "NOT STOPPED" in answer.text
        with pytest.raises(InvalidStatus) as refused:
            inside.feed(token=token)
        assert refused.value.response.status_code == 403
    assert run.stops == []


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1:1", "https://{host}", "http://{host}.evil.example"]
)
def test_a_page_from_elsewhere_neither_stops_nor_reads(inside, run, origin):
    origin = origin.format(host=f"127.0.0.1:{inside.port}")
    answer = inside.stop(Origin=origin)
    assert answer.status == 403
    assert "NOT STOPPED" in answer.text
    with pytest.raises(InvalidStatus) as refused:
        inside.feed(origin=origin)
    assert refused.value.response.status_code == 403
    assert run.stops == []


def test_without_an_origin_nothing_is_stopped(server, inside, run):
    body = f"token={inside.token}".encode()
    head = f"POST /stop HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nCookie: {inside.cookie}\r\nContent-Length: {len(body)}\r\n"
    form = "Content-Type: application/x-www-form-urlencoded\r\n\r\n"
    assert raw(server, (head + form).encode() + body)[0] == 403
    own = f"Origin: {inside.origin}\r\n"
    assert raw(server, (head + own + own + form).encode() + body)[0] == 403
    assert run.stops == []
    assert raw(server, (head + own + form).encode() + body)[0] == 200
    assert run.stops == ["stopped on the page"]
    with pytest.raises(InvalidStatus):
        inside.feed(origin=None)


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "evil.example:{port}",
        "127.0.0.1",
        "127.0.0.1:1",
        "localhost.evil.example:{port}",
        "0.0.0.0:{port}",
    ],
)
def test_another_name_that_points_here_is_refused_everywhere(server, inside, run, host):
    host = host.format(port=server.port)
    for path in ("/", "/state", "/stopping", "/page/plain.css", inside.door):
        assert inside.get(path, Host=host, X_Token=inside.token).status == 421
    assert inside.stop(Host=host, Origin=f"http://{host}").status == 421
    assert raw(server, f"GET /page/plain.css HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())[0] == 421
    assert run.stops == []


def test_a_socket_under_another_name_is_refused(server, inside):
    handshake = (
        f"GET /feed?token={inside.token} HTTP/1.1\r\nHost: evil.example:{server.port}\r\nOrigin: {inside.origin}\r\n"
        f"Cookie: {inside.cookie}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    )
    assert raw(server, handshake.encode())[0] == 403
    ours = handshake.replace("evil.example", "127.0.0.1")
    assert raw(server, ours.encode())[0] == 101


@pytest.mark.parametrize("host", ["localhost", "LocalHost", "[::1]"])
def test_names_of_this_machine_are_served(server, host):
    assert Visitor(server.url).get("/page/plain.css", Host=f"{host}:{server.port}").status == 200


def test_the_index_lies_behind_the_door_only(inside, server):
    assert inside.get("/page/index.html").status == 404
    assert Visitor(server.url).get("/page/index.html").status == 404


@pytest.mark.parametrize(
    "path",
    [
        *("/../../etc/passwd", "/page/../../../../../../etc/passwd", "/page/..%2f..%2f..%2f..%2fetc%2fpasswd"),
        *("/page/%2e%2e/%2e%2e/%2e%2e/etc/passwd", "/page//etc/passwd", "/page/%2fetc%2fpasswd", "//etc/passwd"),
        *("/page/..%5c..%5cetc%5cpasswd", "/page/..\\..\\etc\\passwd", "/page/....//....//etc/passwd"),
        *(
            "/page/..%252f..%252fetc%252fpasswd",
            "/page/..%c0%af..%c0%afetc/passwd",
            "/page/passwd%00.css",
            "/etc/passwd",
        ),
        *(
            "/folder/../../etc/passwd",
            "/folder/%2e%2e/figure.png",
            "/folder/0/../../etc/passwd",
            "/folder/-1/table.txt",
        ),
        *("/?token=../../etc/passwd", "/page/../server.py", "/page/..%2fserver.py", "/page/.", "/page/..", "/page/"),
    ],
)
def test_no_path_leads_to_a_file(server, inside, path):
    request = f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nCookie: {inside.cookie}\r\n\r\n"
    status, text = raw(server, request.encode("latin-1"))
    assert status in ((200,) if path.startswith("/?") else (400, 404, 307))
    assert not any(sign in text for sign in (b"root:", b"import asyncio"))


@pytest.mark.parametrize("method", ["PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "CONNECT", "POST", "X" * 3000])
def test_no_other_method_does_anything(server, inside, run, method):
    request = f"{method} / HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nCookie: {inside.cookie}\r\n\r\n"
    assert raw(server, request.encode(), method)[0] in (400, 403, 405)
    assert run.stops == []


def test_every_answer_forbids_the_browser_what_it_need_not_do(inside):
    answers = [
        inside.get(inside.door), inside.get("/"), inside.get("/state", X_Token=inside.token), inside.get("/page/plain.css"),
        inside.get("/nothing"), inside.get("/stopping"), inside.get("/", Host="evil.example"), inside.stop(),
        inside.stop(Origin="null"), inside.post("/", {}), inside.post("/stop", b"x" * 5000),
    ]  # fmt: skip
    assert sorted({answer.status for answer in answers}) == [200, 403, 404, 405, 413, 421]
    for answer in answers:
        for name, value in HEADERS.items():
            assert answer.headers[name.lower()] == value
        assert "server" not in answer.headers
        assert "<script" not in answer.text or answer is answers[1]


def test_a_plain_form_is_sent_with_its_origin():
    """With no-referrer a browser sends ``Origin: null`` with it (Fetch standard, 3.2), and STOP would be refused."""
    assert HEADERS["Referrer-Policy"] == "same-origin"


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b"x" * 1025, 413), (b"x" * 10_000_000, 413), (b"", 403), (b"token", 403), (b"token=\xff\xfe", 400),
        (b"&".join([b"a=b"] * 50), 400), (b"token=%ff%00", 403),
    ],
)  # fmt: skip
def test_a_form_that_is_none_stops_nothing(inside, run, body, status):
    try:
        answer = inside.post("/stop", body)
    except (BrokenPipeError, ConnectionResetError):  # the rest was not even read
        assert status == 413
    else:
        assert answer.status == status
        assert "NOT STOPPED" in answer.text
    assert run.stops == []


def test_stop_stops_although_the_browser_closes_at_once(server, inside, run):
    body = f"token={inside.token}"
    request = (
        f"POST /stop HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nCookie: {inside.cookie}\r\nOrigin: {inside.origin}\r\n"
        f"Content-Type: application/x-www-form-urlencoded\r\nContent-Length: {len(body)}\r\n\r\n{body}"
    )
    with socket.create_connection(("127.0.0.1", server.port), LONG_S) as connection:
        connection.sendall(request.encode())
    wait_until(lambda: run.stops == ["stopped on the page"], "the stop")


def test_a_form_of_another_type_stops_nothing(inside, run):
    assert inside.stop(Content_Type="text/plain").status == 415
    assert inside.stop(Content_Type="application/json").status == 415
    assert run.stops == []


def test_a_form_that_never_comes_whole_is_given_up(server, inside, run, monkeypatch):
    monkeypatch.setattr(module, "FORM_S", 0.2)
    head = (
        f"POST /stop HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nCookie: {inside.cookie}\r\nOrigin: {inside.origin}\r\n"
        "Content-Type: application/x-www-form-urlencoded\r\nContent-Length: 500\r\n\r\ntoken="
    )
    with socket.create_connection(("127.0.0.1", server.port), LONG_S) as connection:
        connection.sendall(head.encode())
        assert connection.recv(65536).startswith(b"HTTP/1.1 408")
    assert run.stops == []


def test_headers_are_bounded(server):
    visitor = Visitor(server.url)
    with suppress(http.client.HTTPException, OSError):  # it may hang up before all is said
        assert visitor.get("/", X_Long="x" * 200_000).status in (400, 431)
    assert visitor.get("/page/plain.css").status == 200


def test_a_long_message_ends_its_socket_and_no_other(inside):
    with inside.feed() as loud, inside.feed() as quiet:
        heard(loud)
        loud.send("x" * 2000)
        with pytest.raises(ConnectionClosed) as closed:
            list(iter(lambda: heard(loud), None))  # what was still on its way
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1009
        quiet.send("hello")  # whatever it says
        for _ in range(5):
            heard(quiet)


def test_a_hundred_sockets_are_too_many_and_stop_still_stops(server, inside, run):
    told = []
    with ExitStack() as sockets:
        for _ in range(100):
            one = sockets.enter_context(inside.feed())
            try:
                told.append(heard(one)["is"])
            except ConnectionClosed as closed:
                told.append(closed.rcvd and closed.rcvd.code)
        assert told == ["whole"] * MOST_SOCKETS + [1013] * (100 - MOST_SOCKETS)
        assert inside.stop().status == 200
        assert run.stops == ["stopped on the page"]
    wait_until(lambda: server.feed.clients == 0, "all sockets closed")
    with inside.feed() as again:
        assert heard(again)["is"] == "whole"


def test_two_servers_have_two_cookies_and_neither_opens_the_other(run):
    other = Scripted()
    with served(run) as one, served(other) as two:
        first, second = Visitor(one.url).enter(), Visitor(two.url).enter()
        assert first.cookie.partition("=")[0] != second.cookie.partition("=")[0]
        first.cookie, second.cookie = (
            f"{first.cookie}; {second.cookie}",
            f"{first.cookie}; {second.cookie}",
        )  # as sent to both
        assert first.get("/").status == second.get("/").status == 200
        assert second.post("/stop", {"token": first.token}).status == 403
        assert second.post("/stop", {"token": second.token}, Origin=first.origin).status == 403
        assert (run.stops, other.stops) == ([], [])
        second.stop()
        assert (run.stops, other.stops) == ([], ["stopped on the page"])


def test_connections_that_say_nothing_are_dropped_in_time(server, monkeypatch):
    monkeypatch.setattr("rig.monitor.connections.REQUEST_S", 0.2)
    monkeypatch.setattr("rig.monitor.door.MESSAGE_S", 0.2)
    for said in (b"", b"GET / HTTP/1.1\r\nHost: "):
        with socket.create_connection(("127.0.0.1", server.port), LONG_S) as connection:
            connection.sendall(said)
            with suppress(ConnectionResetError):  # what was said is not even read
                assert connection.recv(100) == b""


@pytest.mark.parametrize("other", ['theme={"mode": "dark"}', "x=a b", "=y", "x", "a=1; b", "ä=ö"])
@pytest.mark.parametrize("first", [True, False])
def test_cookies_of_others_on_this_machine_do_not_lock_out(inside, run, other, first):
    """Cookies know no ports: whatever else serves on 127.0.0.1 has its own beside ours."""
    own = inside.cookie
    inside.cookie = (f"{other}; {own}" if first else f"{own}; {other}").encode("utf-8").decode("latin-1")
    assert inside.stop().status == 200
    assert run.stops


@pytest.mark.parametrize("scheme", ["http", "https"])
def test_a_browser_leaves_out_the_port_that_goes_without_saying(run, monkeypatch, scheme):
    assert process.DEFAULT_PORTS == {"http": 80, "https": 443}
    with process.Address().listen() as taken:
        monkeypatch.setitem(process.DEFAULT_PORTS, scheme, taken.getsockname()[1])
        monkeypatch.setattr(process.Address, "listen", lambda self: taken)
        monkeypatch.setattr(process.Address, "secured", lambda self: (None, "x") if scheme == "https" else None)
        assert process.PageServer(lambda shown: run).hosts == {"127.0.0.1", "localhost", "[::1]"}
