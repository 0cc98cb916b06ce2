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
            return "failed", HARDWARE, "A stop may be asked for, but what the run does cannot be read."
        shown = moment.shown or Shown("starting")
        now = shown.details
        cause = f" {shown.cause}." if shown.cause else ""
        if moment.view is None and self._kept and self._expecting():
            return "asked", "STOP IS ASKED FOR", f"The run has not been heard of yet. If anything moves: {HARDWARE}."
        if moment.view is None and self._expecting():
            return "driven", "NOTHING IS KNOWN OF THE RUN", f"It is about to begin, or cannot be watched: {HARDWARE}."
        if moment.view is None or moment.facts is None:
            return "none", "NO RUN IS UNDER WAY", "There is nothing to stop here."
        if moment.view.player is not None:
            return "none", "THIS IS A RECORDING", "Nothing is driven from here: there is nothing to stop."
        if not moment.connected:
            if shown.output_off or (moment.ended and now is None):  # the last: nothing was driven
                return "off", "OUTPUT AT 0 V", f"The run is over.{cause}"
            how = cause or " Its process has ended without a word."
            return "failed", HARDWARE, f"The run is over, and what the output does is not known here.{how}"
        if shown.output_off and cause:
            return "off", "OUTPUT AT 0 V", cause.strip()
        if self._asked is not moment.view:
            return "driven", "NO STOP WAS ASKED FOR", f"The run is under way: {shown.state}."
        if self._refused:
            return "failed", HARDWARE, f"The request could not be left: {self._refused}."
        if now is not None and now.age_s > SILENT_S:
            return "failed", HARDWARE, f"A stop is asked for, but the run has said nothing for {now.age_s:.0f} s."
        waited_s = time.monotonic() - self._asked_s
        if waited_s > moment.facts.limits.ramp_down_s + REST_S:
            return "failed", HARDWARE, f"The output is not at 0 V after {waited_s:.0f} s.{cause}"
        if now is not None and now.guard == "ramping down":
            return "ramping", "RAMPING DOWN", f"Output {now.voltage_v:.3f} V.{cause}"
        return "asked", "STOP IS ASKED FOR", "The ramp begins as soon as the run looks, twenty times a second."
