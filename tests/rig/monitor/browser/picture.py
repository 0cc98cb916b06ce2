"""Make the picture of the page: ``python -m tests.rig.monitor.browser.picture docs/images/monitor.png``.

It runs the shipped backbone of the magnet beam by the clock and waits until the eleventh level is recorded: about a minute.
"""

import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from rig.monitor.process import PageServer
from rig.monitor.sources import chosen
from tests.browsing import Browser, started

LEVEL, STATE = "11 of 13", "recording"
COMMAND = [sys.executable, "-c", "from rig.cli.app import main; main()", "run", "magnet-beam/backbone", "--realtime"]
WAIT_S = 180.0
COLOURS = 256


def make(picture: Path) -> None:
    """Write the picture."""
    with TemporaryDirectory() as folder:
        os.environ |= {"VIBROLOCK_LIVE": f"{folder}/live", "VIBROLOCK_OPERATOR": "Ada"}
        recording = Path(folder) / "backbone.h5"
        server = PageServer(chosen(recording))
        thread = threading.Thread(target=server.run)
        thread.start()
        browser, run = Browser(started()), subprocess.Popen([*COMMAND, "-o", str(recording)])
        try:
            with browser.of_size(1400, 900):
                browser.open(server)
                until = time.monotonic() + WAIT_S
                while browser.text("level") != LEVEL or browser.text("state").lower() != STATE:
                    if time.monotonic() > until:
                        raise SystemExit(f"no level {LEVEL} within {WAIT_S:g} s")
                    time.sleep(0.1)
                time.sleep(1.0)  # for the curves to follow
                browser.driver.save_screenshot(str(picture))
                Image.open(picture).quantize(COLOURS, dither=Image.Dither.NONE).save(picture, optimize=True)
        finally:
            run.terminate()
            run.wait()
            browser.driver.quit()
            server.end()
            thread.join()


if __name__ == "__main__":
    make(Path(sys.argv[1]))
