"""A browser without a window, for every test of something that is shown in one."""

import os
import shutil
from contextlib import contextmanager
from importlib.util import find_spec

import pytest

from tests.waiting import LONG_S

REQUIRED = "VIBROLOCK_BROWSER"
PROGRAMS = ("chromium", "chromium-browser", "google-chrome"), ("chromedriver",)
ARGUMENTS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--window-size=1400,900")


def without_a_browser(why):
    """Skip, or fail where a browser is required."""
    if os.environ.get(REQUIRED) == "required":
        pytest.fail(f"{why}, and {REQUIRED}=required")
    pytest.skip(f"{why}: install Debian's chromium and chromium-driver, or what your system calls them")


@pytest.fixture(scope="session")
def chromium():
    programs = [next(filter(None, map(shutil.which, names)), None) for names in PROGRAMS]
    if None in programs:
        without_a_browser("no Chromium with chromedriver is found")
    if find_spec("selenium") is None:
        without_a_browser("selenium is not installed")
    driver = started(*programs)
    yield Browser(driver)
    driver.quit()


def started(chromium="chromium", chromedriver="chromedriver"):
    """Start a browser."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which(chromium)
    for argument in ARGUMENTS:
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which(chromedriver)))
    driver.set_page_load_timeout(LONG_S)
    return driver


class Browser:
    """What tests ask of a browser; every wait is for something that comes to be."""

    def __init__(self, driver):
        self.driver = driver

    def open(self, server):
        self.driver.get(server.url)
        self.until(lambda: self.driver.find_elements("id", "stop"), "the page")

    def until(self, condition, what="what was expected"):
        from selenium.common.exceptions import TimeoutException, WebDriverException
        from selenium.webdriver.support.wait import WebDriverWait

        # Where a page is replaced while it is read, Chromium answers with errors of many kinds.
        wait = WebDriverWait(self.driver, LONG_S, poll_frequency=0.02, ignored_exceptions=[WebDriverException])
        try:
            return wait.until(lambda _: condition())
        except TimeoutException:
            seen = self.driver.find_element("tag name", "body").text
            raise AssertionError(f"{what} did not come; the page shows:\n{seen}") from None

    def text(self, name):
        return self.driver.find_element("id", name).text.replace("\u202f", " ")

    def shows(self, name, text):
        """Wait until an element shows a text, whatever the case of its letters."""
        self.until(lambda: text.lower() in self.text(name).lower(), f"{text!r} in #{name}")

    def is_connected(self, how):
        self.until(lambda: self.body("connection") == how, f"connection {how!r}")

    def body(self, name):
        return self.driver.find_element("tag name", "body").get_attribute(f"data-{name}")

    def click(self, name):
        self.driver.find_element("id", name).click()

    def point_at(self, selector):
        """Move the pointer into the middle of an element."""
        from selenium.webdriver import ActionChains

        found = self.driver.find_element("css selector", selector)
        ActionChains(self.driver).move_to_element(found).perform()

    def press(self, key):
        self.driver.find_element("tag name", "body").send_keys(key)

    def run(self, script, *arguments):
        return self.driver.execute_script(script, *arguments)

    @contextmanager
    def before_the_page(self, script):
        """Run a script in every page before its own."""
        made = self.driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": script})
        try:
            yield
        finally:
            self.driver.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", made)

    @contextmanager
    def without_scripts(self):
        self.driver.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
        try:
            yield
        finally:
            self.driver.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})

    @contextmanager
    def of_size(self, width, height):
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        try:
            yield
        finally:
            self.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


@pytest.fixture
def browser(chromium):
    """A browser at whose console nothing is complained of."""
    chromium.driver.get("about:blank")
    chromium.driver.get_log("browser")
    chromium.driver.delete_all_cookies()
    chromium.expected = ()
    yield chromium
    told = [line["message"] for line in chromium.driver.get_log("browser")]
    assert [line for line in told if not any(text in line for text in chromium.expected)] == []
