"""Who may see a run on the page, and who may stop it: tokens, hosts, origins, and what every answer forbids the browser.

Whoever knows the address, with its token, gets in, once; from then on a cookie shows who is meant. The cookie alone stops
nothing: forms and sockets need a second token, which only the page knows, and an ``Origin`` that is the page's own. The
``Host`` of every request must be the server's own address: a name of somebody else's that was made to point here is refused.
"""

import re
import secrets
from collections.abc import Callable
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
        "form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "same-origin",  # with no-referrer a browser sends "Origin: null" with a plain form
    "Cache-Control": "no-store",
}
"""Headers of every answer."""

LARGEST_HEADERS = 16384  # bytes of the headers of a request; chosen
RECORD_HEAD, LARGEST_RECORD = 5, 16384  # bytes of a record of TLS (RFC 8446, 5.1)
HANDSHAKE = 22
"""Type of a record of TLS (RFC 8446, 5.1): type, version, length, and what it holds."""
LARGEST = RECORD_HEAD + LARGEST_RECORD
HEADERS_END = re.compile(rb"\n\r?\n")
TOKEN_BYTES = 32  # bytes of a secret: 256 bits, as for keys


def same(given: str, expected: str) -> bool:
    """Return whether two secrets are the same, in a time that does not depend on where they differ."""
    return secrets.compare_digest(given.encode("utf-8", "replace"), expected.encode())


class Keys:
    """The secrets of one server: a token for the address that is used up, a cookie, a token for forms and sockets."""

    def __init__(self) -> None:
        self.cookie_name = f"vibrolock-{secrets.token_hex(4)}"  # cookies know no ports: each server has its own name
        self.cookie = secrets.token_urlsafe(TOKEN_BYTES)
        self.action = secrets.token_urlsafe(TOKEN_BYTES)
        self.entry = secrets.token_urlsafe(TOKEN_BYTES)
        self.on_entry: Callable[[], None] = lambda: None

    def admit(self, token: str) -> bool:
        """Return whether this is the token of the address; if so, it is replaced by another, and ``on_entry`` is called."""
        if not self.opens(token):
            return False
        self.entry = secrets.token_urlsafe(TOKEN_BYTES)
        self.on_entry()
        return True

    def opens(self, token: str) -> bool:
        """Return whether this is the token of the address; it is not used up by that."""
        return same(token, self.entry)

    def known(self, headers: Headers) -> bool:
        """Return whether a request has the cookie."""
        pairs = (one.strip().partition("=") for one in ";".join(headers.getlist("cookie")).split(";"))
        return any(name == self.cookie_name and same(value, self.cookie) for name, _, value in pairs)

    def in_query(self, query: bytes) -> bool:
        """Return whether a query has the token of the address."""
        return self.opens(parse_qs(query.decode("latin-1")).get("token", [""])[0])

    def shown_by(self, request: bytes) -> bool:
        """Return whether a request has the cookie or the token of the address."""
        first, *lines = request.splitlines()
        pairs = (line.partition(b":") for line in lines)
        headers = Headers(raw=[(name.strip().lower(), value.strip()) for name, _, value in pairs])
        target = first.split(b" ")[1:2] or [b""]
        return self.known(headers) or self.in_query(target[0].partition(b"?")[2])

    def acts(self, token: str | None) -> bool:
        """Return whether this is the token for forms and sockets."""
        return token is not None and same(token, self.action)


def is_whole(come: bytes, tls: bool) -> bool:
    """Return whether what has come on a connection is a message, or can no longer become one that is allowed."""
    if not tls:
        return len(come) >= LARGEST_HEADERS or HEADERS_END.search(come) is not None
    if len(come) < RECORD_HEAD:
        return False
    length = int.from_bytes(come[3:RECORD_HEAD], "big")
    return come[0] != HANDSHAKE or length > LARGEST_RECORD or len(come) >= RECORD_HEAD + length


Refuse = Callable[[Scope, int, str], ASGIApp]


class Guard:
    """Lets through what is addressed to this server, and comes from its own page where it does something."""

    def __init__(self, app: ASGIApp, scheme: str, hosts: frozenset[str], refuse: Refuse) -> None:
        self._app, self._hosts, self._refuse = app, hosts, refuse
        self._origins = {f"{scheme}://{host}" for host in hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Check a request or socket and pass it on, with `HEADERS` on the answer."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        wrong = self._what_is_wrong(scope)
        if scope["type"] == "websocket":
            if wrong:
                await receive()
                await send({"type": "websocket.close", "code": 1008})  # before it is accepted: answered with status 403
            else:
                await self._app(scope, receive, send)
            return

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        app = self._refuse(scope, *wrong) if wrong else self._app
        await app(scope, receive, with_headers)

    def _what_is_wrong(self, scope: Scope) -> tuple[int, str] | None:
        headers = Headers(scope=scope)
        if [host.lower() for host in headers.getlist("host")] not in [[host] for host in self._hosts]:
            return 421, "This server is not at that address."
        acts = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
        if acts and headers.getlist("origin") not in [[origin] for origin in self._origins]:
            return 403, "The request does not come from this server's page."
        return None
