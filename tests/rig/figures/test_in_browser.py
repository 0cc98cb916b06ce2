"""Figures for a browser, in one: what is painted, told and zoomed, in light and dark; what is hostile stays text."""

import re

import pytest

from rig.figures.files import plot
from tests.rig.report.conftest import HOSTILE

PIXELS = """
    const canvas = document.querySelectorAll("main .uplot canvas")[arguments[0]];
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d", { willReadFrequently: true });
    copy.drawImage(canvas, 0, 0);
    const data = copy.getImageData(0, 0, canvas.width, canvas.height).data;
    const found = new Map();
    for (let at = 0; at < data.length; at += 4) {
      if (data[at + 3] > 250) {
        const key = `${data[at]},${data[at + 1]},${data[at + 2]}`;
        found.set(key, (found.get(key) ?? 0) + 1);
      }
    }
    return Object.fromEntries(found);
"""
HOVER = """
    const over = document.querySelectorAll("main .u-over")[arguments[0]];
    const { left, top, width, height } = over.getBoundingClientRect();
    const found = new Set();
    for (let x = 2; x < width; x += 6)
      for (let y = 2; y < height; y += 6) {
        over.dispatchEvent(new MouseEvent("mousemove", { clientX: left + x, clientY: top + y, bubbles: true }));
        const told = document.getElementById("told");
        if (!told.hidden) found.add([...told.children].map((line) => line.textContent).join("\\n"));
      }
    return [...found];
"""


@pytest.fixture
def opened(browser, recordings, tmp_path):
    """Open the figure of some recordings."""

    def open_figure(*kinds, path=None):
        sources = [path] if path else [recordings[kind] for kind in kinds]
        plot(sources if len(sources) > 1 else sources[0], tmp_path / "figure.html")
        browser.driver.get((tmp_path / "figure.html").as_uri())
        browser.until(lambda: browser.driver.find_elements("css selector", "main figure"), "the figure")
        return browser

    return open_figure


def dark(browser, yes):
    features = [{"name": "prefers-color-scheme", "value": "dark" if yes else "light"}]
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})


@pytest.mark.slow
def test_all_panels_are_painted_and_points_are_told_with_unit_interval_and_quality(opened):
    page = opened("backbone")
    assert len(page.driver.find_elements("css selector", "main .uplot")) == 4
    for number in range(4):
        colours = page.run(PIXELS, number)
        assert colours.get("0,114,178", 0) > 20, number  # the first colour of Okabe and Ito
    told = page.run(HOVER, 0)
    assert len(told) == 2  # points
    for text, number in zip(sorted(told, key=lambda one: one[-30:]), (1, 2), strict=False):
        assert re.search(r"^displacement amplitude: 0\.\d+\u202fmm$", text, re.M)
        assert re.search(r"^modal frequency: 24\.\d+\u202fHz ± \d", text, re.M)
        assert "point " in text
        assert re.search(r"point \d: (good|warned)", text), (text, number)
    assert any("output amplitude: " in text and "\u202fV" in text for text in page.run(HOVER, 2))


def test_a_part_is_zoomed_into_by_dragging_and_left_by_the_button(opened):
    from selenium.webdriver import ActionChains

    page = opened("stepped-phase")
    over = page.driver.find_elements("css selector", "main .u-over")[0]
    before = page.run(PIXELS, 0)
    button = page.driver.find_element("id", "whole")
    assert not button.is_enabled()
    wide, high = over.size["width"], over.size["height"]
    chain = ActionChains(page.driver).move_to_element_with_offset(over, -wide // 4, -high // 4)
    chain.click_and_hold().move_by_offset(wide // 3, high // 2).release().perform()
    page.until(button.is_enabled, "the zoom")
    page.until(lambda: page.run(PIXELS, 0) != before, "another picture")
    button.click()
    ActionChains(page.driver).move_to_element(page.driver.find_element("tag name", "h1")).perform()
    page.until(lambda: page.run(PIXELS, 0) == before, "the picture as before")
    assert not button.is_enabled()


def test_colours_follow_the_setting_for_light_and_dark(opened):
    page = opened("backbone")
    ground = "return getComputedStyle(document.body).backgroundColor"
    try:
        dark(page, True)
        page.until(lambda: page.run(ground) == "rgb(19, 23, 26)", "a dark ground")
        page.until(lambda: "0,114,178" not in page.run(PIXELS, 0), "lighter curves")
        brightest = max(page.run(PIXELS, 0), key=lambda key: sum(map(int, key.split(","))))
        assert sum(map(int, brightest.split(","))) > 350
        dark(page, False)
        page.until(lambda: page.run(PIXELS, 0).get("0,114,178", 0) > 20, "the colours as printed")
    finally:
        page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_a_narrow_window_has_panels_below_one_another_without_scrolling_sideways(opened):
    page = opened("backbone")
    lefts = "return [...document.querySelectorAll('main figure')].map((one) => Math.round(one.getBoundingClientRect().left))"
    with page.of_size(1300, 900):
        page.until(lambda: len(set(page.run(lefts))) == 2, "two columns")
    with page.of_size(390, 844):
        page.until(lambda: len(set(page.run(lefts))) == 1, "one column")
        page.until(
            lambda: page.run("return document.documentElement.scrollWidth <= innerWidth"), "the width of the window"
        )


def test_text_of_a_recording_is_shown_and_not_run(opened, hostile, browser):
    with browser.before_the_page("window.ran = 0; window.alert = () => window.ran++;"):
        page = opened(path=hostile)
    assert page.run("return document.querySelector('h1').textContent").startswith(HOSTILE)
    assert page.run("return window.ran") == 0
    assert page.run("return performance.getEntriesByType('resource').length") == 0
