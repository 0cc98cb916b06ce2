"""What is said after STOP, until the output is at 0 V."""

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from rig.monitor.feed import Moment
from rig.monitor.shown import Shown
from rig.monitor.shutdown_monitor import HARDWARE, REST_S
from vibrolock.printable import error_text

if TYPE_CHECKING:
    from rig.monitor.replay import View

SILENT_S = 2.0  # s without a frame after which a run counts as silent; chosen: sixty frames
BY_PAGE = "stopped on the page"


class Stopping:
    """Leaves the request to stop and follows what comes of it.

    ``expecting`` says whether a run is about to begin: until it does, a request for it is kept.
    """

    def __init__(self, expecting: Callable[[], bool] = lambda: False) -> None:
        self._expecting, self._kept = expecting, False
        self._asked: View | None = None
        self._asked_s = 0.0
        self._refused = ""

    def ask(self, view: "View | None") -> None:
        """Ask the run that is shown to ramp down."""
        if view is None:
            self._kept = self._expecting()
            return
        if view is not self._asked:
            self._asked, self._asked_s = view, time.monotonic()
        self._refused = ""
        try:
            view.request_stop(BY_PAGE)
        except Exception as error:  # whatever it is, it must be said
            self._refused = error_text(error)

    def begun(self, view: "View") -> None:
        """Leave a request that was kept for a run that has now begun."""
        if self._kept:
            self._kept = False
            self.ask(view)

    def state(self, moment: Moment | None) -> tuple[str, str, str]:
        """Return a word, a heading and a sentence on where the ramp is.

        The word is ``none`` (no run), ``driven`` (nobody has asked here), ``asked``, ``ramping``, ``off`` or ``failed``.
        ``moment`` is None if the run cannot be read.
        """
        if moment is None:
            return "failed", HARDWARE, "The run's state cannot be read. A stop can still be requested."
        shown = moment.shown or Shown("starting")
        now = shown.details
        cause = f" {shown.cause}." if shown.cause else ""
        if moment.view is None and self._kept and self._expecting():
            return "asked", "STOP REQUESTED", f"The run has not reported yet. If anything moves: {HARDWARE}."
        if moment.view is None and self._expecting():
            return "driven", "THE RUN CANNOT BE SEEN", f"It may be about to begin, or may not be watchable: {HARDWARE}."
        if moment.view is None or moment.facts is None:
            return "none", "NO RUN IS UNDER WAY", "There is nothing to stop here."
        if moment.view.player is not None:
            return "none", "THIS IS A RECORDING", "Nothing is driven from here: there is nothing to stop."
        if not moment.connected:
            if shown.output_off or (moment.ended and now is None):  # the last: nothing was driven
                return "off", "OUTPUT AT 0 V", f"The run is over.{cause}"
            how = cause or " Its process ended unexpectedly."
            return "failed", HARDWARE, f"The run is over; whether its output is at 0 V is not known.{how}"
        if shown.output_off and cause:
            return "off", "OUTPUT AT 0 V", cause.strip()
        if self._asked is not moment.view:
            return "driven", "NO STOP REQUESTED", f"The run is under way: {shown.state}."
        if self._refused:
            return "failed", HARDWARE, f"The stop request could not be stored: {self._refused}."
        if now is not None and now.age_s > SILENT_S:
            return "failed", HARDWARE, f"A stop was requested, but the run has not reported for {now.age_s:.0f} s."
        waited_s = time.monotonic() - self._asked_s
        if waited_s > moment.facts.limits.ramp_down_s + REST_S:
            return "failed", HARDWARE, f"The output is not at 0 V after {waited_s:.0f} s.{cause}"
        if now is not None and now.guard == "ramping down":
            return "ramping", "RAMPING DOWN", f"Output {now.voltage_v:.3f} V.{cause}"
        return "asked", "STOP REQUESTED", "The run looks for requests twenty times a second, then ramps down."
