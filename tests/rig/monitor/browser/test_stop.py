"""STOP in a real browser: by click, by key, with the socket dead, with scripts off, and when nobody hears."""

import pytest

from rig.monitor.sources import always
from tests.rig.monitor.browser.test_browser import DEAD_SOCKET, REFUSED
from tests.rig.monitor.browser.told import Told

ESCAPE = "\ue00c"


def click(browser):
    browser.click("stop")


def key(browser):
    browser.press(ESCAPE)


@pytest.mark.parametrize("how", [click, key])
def test_stop_ramps_down_and_says_when_the_output_is_at_0_v(page, told, how):
    how(page)
    page.shows("stopping", "RAMPING DOWN")
    page.shows("state", "ramping down")
    assert set(told.causes) == {"stopped on the page"}  # by the socket and by the form
    told.end()
    page.shows("stopping", "OUTPUT AT 0 V")
    page.shows("detail", "OUTPUT AT 0 V")


def test_other_keys_and_escape_held_down_ask_for_nothing_more(page, told):
    for letter in "s \ue007":
        page.press(letter)
    assert told.causes == []
    page.run("document.dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape', repeat: true }))")
    key(page)
    page.shows("stopping", "RAMPING DOWN")
    assert len(told.causes) in (1, 2)  # once by the socket, once by the form


def test_what_came_of_a_stop_is_not_said_of_the_next_run(browser, serve, told):
    shown = [told]
    browser.open(serve(lambda before: shown[0]))
    browser.is_connected("live")
    click(browser)
    told.end()
    browser.shows("stopping", "OUTPUT AT 0 V")
    shown[0] = Told(process=2)
    browser.shows("state", "settling")
    assert browser.text("stopping") == ""
    click(browser)
    browser.shows("stopping", "RAMPING DOWN")
    assert len(shown[0].causes) in (1, 2)


@pytest.mark.parametrize("how", [click, key])
def test_stop_works_where_the_socket_is_dead(browser, serve, told, how):
    with browser.before_the_page(DEAD_SOCKET):
        browser.open(serve(always(told)))
        how(browser)
        browser.shows("stopping", "RAMPING DOWN")
        told.end()
        browser.shows("stopping", "OUTPUT AT 0 V")


def test_stop_works_where_the_server_takes_no_new_connection(browser, serve, told):
    with browser.before_the_page("window.fetch = () => new Promise(() => {});"):
        browser.open(serve(always(told)))
        browser.is_connected("live")
        click(browser)
        browser.shows("state", "ramping down")
        assert told.causes == ["stopped on the page"]


def test_stop_works_where_the_script_can_send_nothing(browser, serve, told):
    broken = "window.fetch = () => Promise.reject(new Error('broken'));" + DEAD_SOCKET
    with browser.before_the_page(broken):
        browser.open(serve(always(told)))
        click(browser)
        heading = lambda: browser.driver.find_element("tag name", "h1").text  # noqa: E731
        browser.until(lambda: "RAMPING DOWN" in heading(), "the server's own page")
        told.end()
        browser.until(lambda: "OUTPUT AT 0 V" in heading(), "the output at 0 V")


def test_stop_works_where_scripts_are_off(browser, serve, told):
    server = serve(always(told))
    with browser.without_scripts():
        browser.driver.get(server.url)
        browser.until(lambda: browser.driver.find_elements("id", "stop"), "the page")
        note = lambda: browser.driver.find_element("css selector", ".noscript").text  # noqa: E731
        browser.until(lambda: "STOP works" in note(), "a note that STOP works")
        click(browser)
        heading = lambda: browser.driver.find_element("tag name", "h1").text  # noqa: E731
        browser.until(lambda: "RAMPING DOWN" in heading(), "the server's own page")
        told.end()
        browser.until(lambda: "OUTPUT AT 0 V" in heading(), "the output at 0 V")


def test_a_stop_that_cannot_be_sent_says_to_use_the_hardware_stop(browser, serve, told):
    browser.expected = REFUSED
    server = serve(always(told))
    browser.open(server)
    browser.is_connected("live")
    server.end()
    browser.is_connected("gone")
    click(browser)
    browser.shows("stopping", "NOT SENT: USE THE HARDWARE STOP")
