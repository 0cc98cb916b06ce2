"""Pages of runs, served to a browser."""

import threading

import pytest

from rig.monitor.process import PageServer
from rig.monitor.sources import always
from tests.rig.monitor.browser.told import Told
from tests.waiting import LONG_S


@pytest.fixture
def serve(browser):
    """Serve the page of a view in a thread."""
    running = []

    def begin(look, **more):
        server = PageServer(look, **more)
        thread = threading.Thread(target=server.run)
        thread.start()
        running.append((server, thread))
        return server

    yield begin
    browser.driver.get("about:blank")  # before the servers go
    for server, thread in running:
        server.end()
        thread.join(LONG_S)
        assert not thread.is_alive()
        getattr(server.feed.view, "close", lambda: None)()


@pytest.fixture
def told():
    return Told()


@pytest.fixture
def page(browser, serve, told):
    """The page of a run that does what the test says."""
    browser.open(serve(always(told)))
    browser.is_connected("live")
    return browser
