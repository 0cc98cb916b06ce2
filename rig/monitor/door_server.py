"""uvicorn's server, with connections that come through the door."""

import asyncio
import socket
import ssl
from contextlib import suppress

import uvicorn

from rig.monitor.connections import WebConnection
from rig.monitor.door import Door
from rig.monitor.security import Keys
from rig.monitor.visits import Visit


class DoorServer(uvicorn.Server):
    """Serves at one socket that listens, by TLS if there is a context for it."""

    def __init__(self, config: uvicorn.Config, keys: Keys, tls: ssl.SSLContext | None) -> None:
        super().__init__(config)
        self._keys, self._tls = keys, tls
        self.door: Door | None = None

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start the application, then accept."""
        await super().startup(sockets=[])  # it listens nowhere itself
        assert sockets is not None
        self.door = Door(sockets[0], self._tls, self._keys, self._connection)
        self._accepting = asyncio.create_task(self.door.accept())

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Accept no more, then end what is under way."""
        self._accepting.cancel()
        with suppress(asyncio.CancelledError):
            await self._accepting
        await super().shutdown(sockets)

    def _connection(self, visit: Visit) -> WebConnection:
        return WebConnection(visit, self._keys, self.config, self.server_state, self.lifespan.state)
