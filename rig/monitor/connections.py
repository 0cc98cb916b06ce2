"""Connections to the page's server: the door knows of each, and none may hang for long; and the server with that door."""

import asyncio
import socket
import ssl
from collections.abc import Callable
from contextlib import suppress

import h11
from starlette.datastructures import Headers
from uvicorn import Config, Server
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from uvicorn.server import ServerState

from rig.monitor.door import Door
from rig.monitor.security import Keys
from rig.monitor.visits import Visit

REQUEST_S = 10.0
"""Time in which a request must have come in whole."""
STUCK_S = 60.0
"""Time after which a client that reads nothing is given up."""


class _Deadline:
    """Ends a connection unless it is called off."""

    def __init__(self, seconds: float, end: Callable[[], None]) -> None:
        self._seconds, self._end = seconds, end
        self._timer: asyncio.TimerHandle | None = None

    def start(self) -> None:
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(self._seconds, self._end)

    def call_off(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


class _Unread(asyncio.Protocol):
    """A connection that is given up if its client does not read for too long."""

    _stuck: _Deadline

    def pause_writing(self) -> None:
        """The client does not read."""
        super().pause_writing()
        self._stuck.start()

    def resume_writing(self) -> None:
        """It reads again."""
        super().resume_writing()
        self._stuck.call_off()


class WebConnection(_Unread, H11Protocol):
    """A connection for HTTP. Without a key there is one answer on it."""

    def __init__(
        self, visit: Visit, keys: Keys, config: Config, state: ServerState, app_state: dict[str, object]
    ) -> None:
        super().__init__(config, state, app_state)
        self._visit, self._keys = visit, keys

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection."""
        self._request = _Deadline(REQUEST_S, self._give_up)
        self._stuck = _Deadline(STUCK_S, self._give_up)
        self._visit.opened(transport)
        super().connection_made(transport)
        self._request.start()

    def data_received(self, data: bytes) -> None:
        """Take data; a request that has begun must come in whole before its deadline."""
        super().data_received(data)
        if self.cycle is None or self.cycle.response_complete:
            self._request.start()
        else:
            self._request.call_off()
            if self._shows_key():
                self._visit.shows_key()
            else:
                self.cycle.keep_alive = False

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Let a socket take over, which goes on under the same visit."""
        if self._shows_key():
            self._visit.shows_key()
        super().handle_websocket_upgrade(event)
        feed = self.transport.get_protocol()
        if isinstance(feed, FeedConnection):
            feed.visit = self._visit
            self._visit.becomes_feed()

    def _shows_key(self) -> bool:
        return self._keys.known(Headers(raw=self.headers)) or self._keys.in_query(self.scope["query_string"])

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self._request.call_off()
        self._stuck.call_off()
        self._visit.gone()
        super().connection_lost(exc)

    def _give_up(self) -> None:
        if self.transport.get_protocol() is self:  # not where a socket has taken over
            self.transport.abort()


class FeedConnection(_Unread, WebSocketsSansIOProtocol):
    """A connection that has become a socket."""

    visit: Visit | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take over a connection."""
        super().connection_made(transport)
        self._stuck = _Deadline(STUCK_S, self.transport.abort)

    def shutdown(self) -> None:
        """Say goodbye, unless the client has done so already: a second close frame is an error."""
        if not self.transport.is_closing():
            super().shutdown()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self._stuck.call_off()
        if self.visit is not None:
            self.visit.gone()
        super().connection_lost(exc)


class DoorServer(Server):
    """Serves at one socket that listens, by TLS if there is a context for it."""

    def __init__(self, config: Config, keys: Keys, tls: ssl.SSLContext | None) -> None:
        super().__init__(config)
        self._keys, self._tls = keys, tls
        self.door: Door | None = None

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start the application, then accept."""
        await super().startup(sockets=[])  # it listens nowhere itself
        assert sockets is not None

        def connection(visit: Visit) -> WebConnection:
            return WebConnection(visit, self._keys, self.config, self.server_state, self.lifespan.state)

        self.door = Door(sockets[0], self._tls, self._keys, connection)
        self._accepting = asyncio.create_task(self.door.accept())

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Accept no more, then end what is under way."""
        self._accepting.cancel()
        with suppress(asyncio.CancelledError):
            await self._accepting
        await super().shutdown(sockets)
