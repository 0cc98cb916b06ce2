"""The page in a real browser: what it shows of a run, and when it says that it knows nothing any more."""

import re

import pytest

from rig.monitor.sources import always
from rig.tick.safety.layout import EndReason, GuardMode
from rig.tick.sequencer.layout import SegmentKind

ROWS = "#points tbody tr"
REFUSED = ("ERR_CONNECTION_REFUSED", "ERR_CONNECTION_RESET", "ERR_EMPTY_RESPONSE", "WebSocket connection")


def rows(browser):
    return [row.text for row in browser.driver.find_elements("css selector", ROWS)]


def painted(browser, name):
    """How many pixels of the canvases in an element are painted."""
    return browser.run(
        """return [...document.querySelectorAll(`#${arguments[0]} canvas`)].map((canvas) => {
            const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d", { willReadFrequently: true });
            copy.drawImage(canvas, 0, 0);
            const data = copy.getImageData(0, 0, canvas.width, canvas.height).data;
            return data.filter((value, index) => index % 4 === 3 && value > 0).length;
        }).reduce((sum, one) => sum + one, 0)""",
        name,
    )


def test_state_level_time_and_numbers_are_shown_with_their_units(page):
    page.shows("state", "settling")
    page.shows("detail", "7 of 20 periods")
    page.shows("level", "3 of 13")
    page.shows("level-value", "0.390 V of 0.392 V")
    page.shows("left", "1:23 min")
    assert page.text("frequency") == "24.3841 Hz"
    assert page.text("displacement") == "0.264 mm"
    assert page.text("force") == "0.060 N"
    assert [page.text(f"fact-{name}") for name in ("operator", "specimen")] == ["Ada", "magnet beam (one-sided), no. 7"]
    assert page.text("ramp") == "within 0.5 s"
    assert "no emergency stop" in page.text("stop-note").lower()


@pytest.mark.parametrize(
    ("changed", "state"),
    [
        ({"kind": SegmentKind.RECORD}, "recording"),
        ({"kind": SegmentKind.RAMP, "lock": 0}, "searching"),
        ({"kind": SegmentKind.RAMP, "lock": 2}, "locked"),
        ({"kind": SegmentKind.RAMP, "lock": 3}, "lock lost"),
        ({"guard": GuardMode.RAMPING, "reason": EndReason.COMPLETED}, "ramping down"),
    ],
)
def test_every_state_has_its_word_and_its_shape(page, told, changed, state):
    told.say(**changed)
    page.shows("state", state)
    shape = page.driver.find_element("id", "shape").get_attribute("href")
    assert page.driver.find_elements("css selector", shape)


def test_a_trip_names_channel_value_and_cause_and_the_output_at_0_v_once_it_is(page, told):
    told.trip()
    page.shows("state", "tripped")
    assert page.text("cause") == "force above its limit on channel force: 35.2 N"
    assert page.text("detail") == "ramping down, output 0.39 V"
    told.end("force above its limit on channel force (35.2 N)", EndReason.FORCE_LIMIT)
    page.shows("detail", "OUTPUT AT 0 V")


def test_curves_scope_harmonics_and_bars_are_drawn(page, told):
    empty = painted(page, "strips"), painted(page, "canvas-points")
    told.trace(100)
    told.measure(0)
    told.measure(1)
    page.until(lambda: painted(page, "strips") > empty[0] + 500, "traces")
    page.until(lambda: painted(page, "canvas-points") > empty[1] + 100, "points")
    assert painted(page, "canvas-scope") > 1000
    assert painted(page, "canvas-harmonics") > 1000
    shares = [item.text for item in page.driver.find_elements("css selector", "#shares li")]
    assert len(shares) == 12
    assert any(re.search(r"force limit\s+0\s%\s+of 34.0\sN", text) for text in shares)


def test_all_traces_are_read_where_one_is_pointed_at(page, told):
    told.trace(100)
    readings = lambda: [text.text for text in page.driver.find_elements("css selector", ".strip b")]  # noqa: E731
    page.until(lambda: readings()[0].startswith("24.35"), "the last frequency")
    page.point_at("#canvas-frequency .u-over")
    page.until(lambda: all(re.search(r" at 0:0\d", text) for text in readings()[:1] + readings()[2:]), "the time")
    page.point_at("#title")
    page.until(lambda: not any(" at " in text for text in readings()), "the last values")


def test_who_comes_late_sees_all_points_and_one_measured_again_once(browser, serve, told):
    for number in range(13):
        told.measure(number)
    told.measure(3, quality="warned", warnings=["a knock"])
    browser.open(serve(always(told)))
    browser.until(lambda: len(rows(browser)) == 13, "13 points")
    assert rows(browser)[0].startswith("1 0.1 0.0200 24.4000 0.4000 0.1000 0.01 98.00")
    assert [text.endswith("warned") for text in rows(browser)] == [False] * 12 + [True]
    browser.shows("events", "point 4 warned: a knock")


def test_data_that_are_old_turn_grey_and_come_back(page, told):
    told.age_s = 1.5
    page.is_connected("stale")
    page.shows("detail", "STALE: nothing new for")
    greyed = "return getComputedStyle(document.querySelector('main')).filter"
    assert "grayscale(1)" in page.run(greyed)
    told.age_s = 0.0
    page.is_connected("live")
    assert page.run(greyed) == "none"


def test_what_a_run_said_last_is_not_old_after_its_end(page, told):
    told.end("the plan was carried out", EndReason.COMPLETED)
    told.age_s = 100.0
    page.shows("state", "finished")
    assert page.body("connection") == "live"
    told.connected = False
    page.is_connected("over")
    assert page.text("cause") == "the plan was carried out"


def test_a_run_that_ended_before_its_output_was_at_0_v_says_so(page, told):
    told.tell(**{"is": "end", "text": "the driver failed", "tripped": True})
    page.shows("state", "tripped")
    assert page.text("detail") == "output unknown"
    assert page.text("cause") == "USE THE HARDWARE STOP. the driver failed"


def test_a_run_that_died_is_not_connected(page, told):
    told.connected = False
    page.is_connected("died")
    assert page.text("state") == "NOT CONNECTED"
    assert page.text("cause") == "USE THE HARDWARE STOP"
    assert page.text("detail") == "last known: settling"


def test_a_server_that_has_gone_is_not_connected(browser, serve, told):
    browser.expected = REFUSED
    server = serve(always(told))
    browser.open(server)
    browser.is_connected("live")
    server.end()
    browser.is_connected("gone")
    assert browser.text("state") == "NOT CONNECTED"
    assert browser.text("cause") == "USE THE HARDWARE STOP"


def test_without_a_socket_the_page_asks(browser, serve, told):
    with browser.before_the_page(DEAD_SOCKET):
        browser.open(serve(always(told)))
        browser.shows("connection", "live, without a socket")
        told.measure(0)
        browser.until(lambda: len(rows(browser)) == 1, "the point")


DEAD_SOCKET = "window.WebSocket = class { constructor() { setTimeout(() => this.onclose({}), 10); } close() {} };"


def test_on_a_phone_nothing_is_wider_than_the_page_and_stop_is_in_sight(page, told):
    told.measure(0)
    with page.of_size(360, 740):
        page.until(lambda: page.run("return innerWidth") == 360)
        assert page.run("return document.documentElement.scrollWidth") <= 360
        left, top, right, bottom = page.run(
            """const box = document.getElementById("stop").getBoundingClientRect();
            return [box.left, box.top, box.right, box.bottom]"""
        )
        assert 0 <= left < right <= 360
        assert 0 <= top < bottom <= 740
        assert bottom - top >= 72


def test_the_theme_changes_and_is_kept(page):
    theme = "return document.documentElement.dataset.theme"
    assert page.run(theme) == "dark"
    page.click("theme")
    assert page.run(theme) == "light"
    page.driver.refresh()
    page.until(lambda: page.run(theme) == "light", "the light theme")


WEEK = """
const done = arguments[0];
(async () => {
    const load = (name) => import(`/page/${name}.js`);
    const [{ Traces }, { Points }, { Events }] = await Promise.all(["traces", "points", "events"].map(load));
    const make = (tag) => document.createElement(tag);
    const [span, table, list] = [make("button"), make("table"), make("ol")];
    table.createTHead();
    table.createTBody();
    make("div").append(table);
    const traces = new Traces(make("div"), span);
    const points = new Points(make("div"), table, make("p"));
    const events = new Events(list);
    const facts = { kind: "dwell", points: 1, level_unit: "V", sample_rate_hz: 5000, channels: [], columns: [] };
    for (const part of [traces, points, events]) part.reset({ facts });
    const all = (value) => Array(1000).fill(value);
    const pair = [all(0), all(1)];
    const curves = { frequency_hz: pair, phase_error_deg: pair, force: pair, drive: pair, voltage_v: pair };
    const point = { is: "point", level: 1, accepted: true, quality: "good", end_sample: 0 };
    for (let turn = 0; turn < 200; turn++) {
        const numbers = all(0).map((_, index) => 1000 * turn + index);
        const bins = { end_s: numbers.map((n) => 0.1 * n), part: all(1), lock: all(2), guard: all(1), ...curves };
        const lines = numbers.map((number) => ({ ...point, number }));
        for (const part of [traces, points, events]) part.take({ bins, lines });
        if (turn % 50 === 0) for (const part of [points, events]) part.draw();
    }
    for (const part of [points, events]) part.draw();
    done([traces.time.length, traces.bands[4][1].length, points.points.size, table.rows.length, list.children.length]);
})().catch((error) => done(String(error)));
"""


def test_a_week_of_a_run_takes_bounded_memory(page):
    bins, of_the_last_band, points, rows_with_the_head, events = page.driver.execute_async_script(WEEK)
    assert (bins, of_the_last_band, points, rows_with_the_head, events) == (3000, 3000, 5000, 201, 300)


def test_recordings_of_a_folder_are_listed_with_figure_and_table(browser, serve, told, tmp_path):
    (tmp_path / "spoilt.h5").write_bytes(b"no recording")
    browser.open(serve(always(told), folder=tmp_path))
    browser.until(lambda: browser.driver.find_elements("css selector", "#entries details"), "the file")
    browser.shows("entries", "spoilt.h5")
    browser.expected = ("figure.png", "table.txt")  # a file that cannot be read has neither
    browser.driver.find_element("css selector", "#entries summary").click()
    browser.shows("entries", "there is no figure of it")
    browser.shows("entries", "cannot be")
