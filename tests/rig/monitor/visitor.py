"""A server of the page in a thread of the test, and somebody who comes to it with the means of the standard library."""

import http.client
import json
import re
import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple
from urllib.parse import urlencode, urlsplit

from websockets.sync.client import ClientConnection, connect

from rig.monitor.process import Address, PageServer
from rig.monitor.sources import always
from tests.waiting import LONG_S

FORM = "application/x-www-form-urlencoded"


class Answer(NamedTuple):
    """An answer of the server."""

    status: int
    headers: dict[str, str]
    text: str
    body: bytes


@contextmanager
def served(show: Any, **options: Any) -> Iterator[PageServer]:
    """A server of a view, or of what is chosen, on loopback; ended in order afterwards."""
    options.setdefault("address", Address())
    server = PageServer(show if callable(show) else always(show), **options)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        yield server
    finally:
        server.end()
        thread.join(LONG_S)
        assert not thread.is_alive()


class Visitor:
    """A browser, or what pretends to be one."""

    def __init__(self, url: str, context: ssl.SSLContext | None = None) -> None:
        parts = urlsplit(url)
        self.host, self.port, self.scheme = parts.hostname or "", parts.port or 0, parts.scheme
        self.origin = f"{parts.scheme}://{parts.netloc}"
        self.door = f"/?{parts.query}"
        self.context, self.cookie, self.token = context, "", ""

    def get(self, path: str, **headers: str) -> Answer:
        """GET a path, with the cookie if there is one."""
        return self._ask("GET", path, None, headers)

    def post(self, path: str, fields: dict[str, str] | bytes, **headers: str) -> Answer:
        """POST a form as the page does."""
        body = fields if isinstance(fields, bytes) else urlencode(fields).encode()
        return self._ask("POST", path, body, {"Origin": self.origin, "Content-Type": FORM} | headers)

    def _ask(self, method: str, path: str, body: bytes | None, headers: dict[str, str]) -> Answer:
        kind: Any = http.client.HTTPConnection
        more: dict[str, Any] = {"timeout": LONG_S}
        if self.scheme == "https":
            kind, more["context"] = http.client.HTTPSConnection, self.context
        connection = kind(self.host, self.port, **more)
        sent = ({"Cookie": self.cookie} if self.cookie else {}) | {k.replace("_", "-"): v for k, v in headers.items()}
        try:
            connection.request(method, path, body, sent)
            response = connection.getresponse()
            content = response.read()
            found = {name.lower(): value for name, value in response.getheaders()}
            return Answer(response.status, found, content.decode("utf-8", "replace"), content)
        finally:
            connection.close()

    def enter(self) -> "Visitor":
        """Open the address with its token, take the cookie, and read the second token from the page."""
        first = self.get(self.door)
        assert first.status == 200, first.text
        self.cookie = first.headers["set-cookie"].partition(";")[0]
        page = self.get("/")
        assert page.status == 200, page.text
        found = re.search(r'value="([\w-]{43})"', page.text)
        assert found is not None
        self.token = found[1]
        return self

    def stop(self, **headers: str) -> Answer:
        """Send the plain form."""
        return self.post("/stop", {"token": self.token}, **headers)

    def state(self) -> dict[str, Any]:
        """Everything at once."""
        answer = self.get("/state", X_Token=self.token)
        assert answer.status == 200, answer.text
        return dict(json.loads(answer.text))

    def feed(self, **changes: Any) -> ClientConnection:
        """Open a socket as the page does; ``changes``: token, origin, cookie, or options of the client."""
        token = changes.pop("token", self.token)
        cookie = changes.pop("cookie", self.cookie)
        origin = changes.pop("origin", self.origin)
        headers = {"Cookie": cookie} | changes.pop("headers", {})
        if self.scheme == "https":
            changes["ssl"] = self.context
        changes.setdefault("max_size", None)
        address = f"{self.origin.replace('http', 'ws', 1)}/feed?token={token}"
        return connect(address, origin=origin, additional_headers=headers, proxy=None, open_timeout=LONG_S, **changes)


def heard(socket: ClientConnection) -> dict[str, Any]:
    """The next message."""
    return dict(json.loads(socket.recv(timeout=LONG_S)))
