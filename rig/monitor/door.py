"""The way to the page's server: whoever has no key cannot keep out those who have one.

A connection is a stranger until a request on it has shown the browser's cookie or the token of the address. Addresses tell nobody
apart: on one machine all have the same. Before it is a stranger, a connection waits as a bare socket: until something has come from
it, and for its turn. That costs a descriptor, no handshake and no buffers, so that many can be kept: one that is dropped
comes back at once. Where even these are too many, the oldest is dropped, of those that are silent or of those in the queue,
whichever are more: neither crowd can push out the other.
"""

import asyncio
import socket
import ssl
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from rig.monitor.descriptors import Room, room
from rig.monitor.visits import Visit, Visits

__all__ = ["BACKLOG", "Door"]

BACKLOG = 1024
"""Connections that the system keeps until they are accepted."""
AT_ONCE = 32
"""Connections that are accepted before what others have said is looked at."""
HANDSHAKE_S = 5.0
"""Time in which a TLS handshake must be over."""
SILENT_S = 10.0
"""Time in which something must have come from a connection."""
RETRY_S = 0.1
"""Time between two tries to accept where the system has no room for another connection."""

Open = Callable[[Visit], asyncio.Protocol]


class Door:
    """Accepts connections at a socket that listens, and gives each its turn: a `Visit` for ``open_``, with TLS where there is some."""

    def __init__(
        self, listening: socket.socket, tls: ssl.SSLContext | None, open_: Open, most: Room | None = None
    ) -> None:
        self._listening, self._tls, self._open = listening, tls, open_
        self._most = most or room()
        self._silent: dict[socket.socket, float] = {}
        self._queue: dict[socket.socket, None] = {}
        self._later: asyncio.TimerHandle | None = None
        self._sweep: asyncio.TimerHandle | None = None
        self.visits = Visits(self._most.strangers)
        self.visits.on_room = self._next

    async def accept(self) -> None:
        """Accept connections until cancelled; then those that wait are closed."""
        loop = asyncio.get_running_loop()
        self._listening.setblocking(False)
        accepted = 0
        try:
            while True:
                try:
                    self._arrived((await loop.sock_accept(self._listening))[0])
                except ConnectionAbortedError:
                    pass
                except OSError:  # descriptors or memory of the whole system
                    self._drop_one()
                    await asyncio.sleep(RETRY_S)
                accepted += 1
                if accepted % AT_ONCE == 0:
                    await asyncio.sleep(0)
        finally:
            self.visits.on_room = lambda: None
            for timer in (self._later, self._sweep):
                if timer is not None:
                    timer.cancel()
            while self._drop_one():
                pass

    def _arrived(self, connection: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        if len(self._silent) + len(self._queue) >= self._most.waiting:
            self._drop_one()
        self._silent[connection] = loop.time() + SILENT_S
        self._sweep = self._sweep or loop.call_later(SILENT_S, self._drop_silent)
        try:
            loop.add_reader(connection, self._spoke, connection)
        except NotImplementedError:  # Windows: its turn comes unheard
            self._line_up(connection)

    def _spoke(self, connection: socket.socket) -> None:
        asyncio.get_running_loop().remove_reader(connection)
        try:
            closed = not connection.recv(1, socket.MSG_PEEK)
        except OSError:
            closed = True
        if closed:
            del self._silent[connection]
            connection.close()
        else:
            self._line_up(connection)

    def _line_up(self, connection: socket.socket) -> None:
        del self._silent[connection]
        self._queue[connection] = None
        self._next()

    def _next(self) -> None:
        """Give as many as can be their turn, in the order in which they spoke."""
        loop = asyncio.get_running_loop()
        while self._queue:
            wait_s = self.visits.until_room_s(loop.time())
            if wait_s > 0.0:
                self._later = self._later or loop.call_later(wait_s, self._again)
                return
            connection = next(iter(self._queue))
            del self._queue[connection]
            self._begin(connection)

    def _again(self) -> None:
        self._later = None
        self._next()

    def _begin(self, connection: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        visit = self.visits.begin(loop.time())
        handshake_s = None if self._tls is None else HANDSHAKE_S
        opening = loop.connect_accepted_socket(
            lambda: self._open(visit), connection, ssl=self._tls, ssl_handshake_timeout=handshake_s
        )
        handshake = loop.create_task(opening)
        visit.shakes_hands(handshake)
        handshake.add_done_callback(lambda done: connection.close() if done.cancelled() or done.exception() else None)

    def _drop_silent(self) -> None:
        """Close those whose time is over, and look again when that of the next is."""
        loop = asyncio.get_running_loop()
        while self._silent and (until_s := next(iter(self._silent.values()))) <= loop.time():
            self._drop(next(iter(self._silent)), self._silent)
        self._sweep = loop.call_at(until_s, self._drop_silent) if self._silent else None

    def _drop_one(self) -> bool:
        """Close the connection that has waited longest, of those that are more; return whether there was one."""
        room: dict[socket.socket, Any] = self._silent if len(self._silent) >= len(self._queue) else self._queue
        if not room:
            return False
        self._drop(next(iter(room)), room)
        return True

    @staticmethod
    def _drop(connection: socket.socket, room: dict[socket.socket, Any]) -> None:
        del room[connection]
        with suppress(NotImplementedError):
            asyncio.get_running_loop().remove_reader(connection)
        connection.close()
