"""What is said after STOP, until the output is at 0 V."""

from rig.errors import RecordingError
from rig.live.reader import View
from rig.monitor.feed import Moment
from rig.monitor.plain_pages import HARDWARE

__all__ = ["Stopping"]

SILENT_S = 2.0
BY_PAGE = "stopped on the page"


class Stopping:
    """Leaves the request to stop and follows what comes of it."""

    def __init__(self) -> None:
        self._asked: View | None = None
        self._refused = ""

    def ask(self, view: View | None) -> None:
        """Ask the run that is shown to ramp down."""
        if view is None:
            return
        self._asked, self._refused = view, ""
        try:
            view.request_stop(BY_PAGE)
        except RecordingError as error:
            self._refused = str(error)

    def state(self, moment: Moment) -> tuple[str, str, str]:
        """Return a word, a heading and a sentence on where the ramp is.

        The word is ``none`` (no run), ``driven`` (nobody has asked here), ``asked``, ``ramping``, ``off`` or ``failed``.
        """
        shown = moment.shown or {}
        if moment.view is None:
            return "none", "NO RUN IS UNDER WAY", "There is nothing to stop here."
        if moment.ended and not moment.connected:
            return "off", "OUTPUT AT 0 V", f"The run is over. {shown.get('cause', '')}".strip()
        if moment.connected and shown.get("output_off") and shown.get("cause"):
            return "off", "OUTPUT AT 0 V", f"{shown['cause']}."
        if not moment.connected:
            text = "The run's process has ended without a word: what the output does is not known here."
            return "failed", HARDWARE, text
        if self._refused and self._asked is moment.view:
            return "failed", HARDWARE, f"The request could not be left: {self._refused}"
        if self._asked is not moment.view:
            return "driven", "NO STOP WAS ASKED FOR", f"The run is under way: {shown.get('state', 'starting')}."
        if shown.get("age_s", 0.0) > SILENT_S:
            return "failed", HARDWARE, f"A stop is asked for, but the run has not answered for {shown['age_s']:.0f} s."
        if shown.get("guard") == "ramping down":
            return "ramping", "RAMPING DOWN", f"Output {shown['voltage_v']:.3f} V. {shown.get('cause', '')}".strip()
        return "asked", "STOP IS ASKED FOR", "The ramp begins within a tenth of a second."
