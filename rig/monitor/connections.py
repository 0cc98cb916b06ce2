"""Connections to the page's server, bounded: neither their number nor the time that one may hang is without end."""

import asyncio
from collections.abc import Callable

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

__all__ = ["MOST_CONNECTIONS", "MOST_SOCKETS", "FeedConnection", "WebConnection"]

MOST_CONNECTIONS = 128
MOST_SOCKETS = 32
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


class WebConnection(H11Protocol):
    """A connection for HTTP."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection, or drop it where there are too many."""
        self._request = _Deadline(REQUEST_S, self._give_up)
        self._stuck = _Deadline(STUCK_S, self._give_up)
        super().connection_made(transport)
        if len(self.connections) > MOST_CONNECTIONS:
            transport.abort()
        else:
            self._request.start()

    def data_received(self, data: bytes) -> None:
        """Take data; a request that has begun must come in whole before its deadline."""
        super().data_received(data)
        if self.cycle is None or self.cycle.response_complete:
            self._request.start()
        else:
            self._request.call_off()

    def pause_writing(self) -> None:
        """The client does not read."""
        super().pause_writing()
        self._stuck.start()

    def resume_writing(self) -> None:
        """It reads again."""
        super().resume_writing()
        self._stuck.call_off()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self._request.call_off()
        self._stuck.call_off()
        super().connection_lost(exc)

    def _give_up(self) -> None:
        if self.transport.get_protocol() is self:  # not where a socket has taken over
            self.transport.abort()


class FeedConnection(WebSocketsSansIOProtocol):
    """A connection that has become a socket."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take over a connection."""
        super().connection_made(transport)
        self._stuck = _Deadline(STUCK_S, self.transport.abort)

    def pause_writing(self) -> None:
        """The client does not read."""
        super().pause_writing()
        self._stuck.start()

    def resume_writing(self) -> None:
        """It reads again."""
        super().resume_writing()
        self._stuck.call_off()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self._stuck.call_off()
        super().connection_lost(exc)
