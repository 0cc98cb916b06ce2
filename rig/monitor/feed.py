"""What is sent to those who watch: read from the run once a tick, made into a message once for all who are as far.

Nobody is waited for. A client that does not read is sent the newest state when it reads again, with all lines and bins that it
has missed; until then no message is made for it.

A message is JSON. ``is``: "whole" for what begins anew (a client that has just come, another run, a replay after a jump), else
"next". Both have ``frame`` (`rig.monitor.shown.shown_json`, None without a run), ``lines`` and ``bins``
(`rig.monitor.shown.bins_json`): all in "whole", in "next" what is new; and
``connected`` (whether the run's process lives), ``replay`` (None, or time_s, duration_s, playing, speed). "whole" also has
``facts`` (None without a run) and ``earlier`` (None, or facts and lines of a run to compare with).
"""

import asyncio
import json
import math
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rig.live.facts import Line, RunFacts
from rig.live.layout import bin_dtype
from rig.monitor.shown import Shown, as_json, bins_json, shown_frame, shown_json, shown_line
from vibrolock.printable import error_text

if TYPE_CHECKING:
    from rig.monitor.replay import View

TICK_S = 1.0 / 15.0
"""Time between two looks at a run that is watched, s; chosen: motion looks smooth from some ten pictures a second on."""
STILL_S = 0.25
"""Longest time between two messages where nothing changes: they show that the server lives."""
UNWATCHED_S, WAITING_S = 1.0, 0.2
"""Time between two looks while nobody watches: at a run, and for a run to begin."""

Look = Callable[["View | None"], "View | None"]
"""Given the view that is shown, returns the one to show."""


class Place(NamedTuple):
    """How far a client is: which view, and how many of its lines and bins it has."""

    view: int = -1
    lines: int = 0
    bins: int = 0


@dataclass(frozen=True, eq=False)
class Moment:
    """What was read in one tick."""

    place: Place
    view: "View | None"
    lines: list[str]
    """JSON of all lines of the view; it may have grown since, `place` says how many there were."""
    facts: RunFacts | None
    shown: Shown | None
    connected: bool
    ended: bool
    """Whether the run has told how it ended, after which its output is at 0 V."""
    state: str
    """JSON of frame, connected and replay."""
    changed: bool
    """Whether anything is new in it."""
    texts: "dict[Place, Future[str]]" = field(default_factory=dict)


class Earlier(NamedTuple):
    """Facts and points of a recording, drawn under those of the run that is shown."""

    facts: RunFacts
    lines: list[Line]


class Feed:
    """Reads what ``look`` chooses, and makes messages of it. All reading is done in one thread, beside the event loop."""

    def __init__(self, look: Look, earlier: Earlier | None = None) -> None:
        self.view: View | None = None
        self.clients = 0
        self.last_seen_s = time.monotonic()
        """When a client last asked for anything, or was connected."""
        self._look = look
        self._earlier = _text(earlier and {"facts": earlier.facts.to_json(), "lines": earlier.lines})
        self._thread = ThreadPoolExecutor(1, "view")
        self._number, self._generation = 0, 0
        self._lines: list[str] = []
        self._raw: list[Line] = []
        self._bins = 0
        self._key: object = None
        self._shown = Shown("")
        self._shown_text = "null"
        self._told_s = -math.inf
        self._moment: Moment | None = None
        self._news = asyncio.Condition()
        self._wanted = asyncio.Event()

    async def run(self) -> None:
        """Read, tick after tick, until cancelled."""
        while True:
            began_s = time.monotonic()
            await self._read_now()
            if self.clients:
                self.last_seen_s = time.monotonic()
                await asyncio.sleep(max(TICK_S - (time.monotonic() - began_s), 0.001))
            else:
                self._wanted.clear()
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._wanted.wait(), UNWATCHED_S if self.view else WAITING_S)

    def close(self) -> None:
        """End the thread, so that nothing is read any more."""
        self._thread.shutdown(cancel_futures=True)

    async def fresh(self) -> Moment:
        """Return what there is now."""
        self.last_seen_s = time.monotonic()
        return await self._read_now()

    async def following(self, place: Place) -> tuple[str, Place]:
        """Wait for news and return the message for a client that is at ``place``, and its new place."""
        if place.view < 0:
            moment = await self.fresh()
            self._wanted.set()
        else:
            async with self._news:
                await self._news.wait()
            moment = self._moment or await self.fresh()
        return await self.message(moment, place), moment.place

    async def message(self, moment: Moment, since: Place = Place()) -> str:  # noqa: B008 (immutable)
        """Return the message that brings a client from ``since`` to a moment. It is made once for all who are there."""
        if since.view != moment.place.view:
            since = Place()
        if since not in moment.texts:
            moment.texts[since] = self._thread.submit(self._made, moment, since)
        return await asyncio.shield(asyncio.wrap_future(moment.texts[since]))

    async def _read_now(self) -> Moment:
        moment = self._moment = await asyncio.get_running_loop().run_in_executor(self._thread, self._read)
        now_s = time.monotonic()
        if moment.changed or now_s - self._told_s >= STILL_S:
            self._told_s = now_s
            async with self._news:
                self._news.notify_all()
        return moment

    def _read(self) -> Moment:
        view = self.view
        try:
            view = self._look(view)
            generation = 0 if view is None else view.generation  # a replay that jumps begins anew
            if view is not self.view or generation != self._generation:
                self.view, self._generation = view, generation
                self._number += 1
                self._lines, self._raw, self._bins, self._key = [], [], 0, None
            return self._read_view(view)
        except Exception as error:  # of a damaged file, or of a run of which nothing is left
            shown = Shown("unreadable", error_text(error))
            facts = None if view is None else view.facts
            return self._moment_of(facts, shown, _text(shown_json(shown)), connected=False, changed=False)

    def _read_view(self, view: "View | None") -> Moment:
        if view is None:
            return self._moment_of(None, None, "null", connected=False, changed=self._moment is None)
        before = Place(self._number, len(self._lines), self._bins)
        connected = view.connected  # asked first: what was told last is read afterwards
        new = view.lines(len(self._raw))
        self._raw += new
        self._lines += [_text(shown_line(line, view.facts)) for line in new]
        frame = view.frame()
        key = connected, len(self._raw), frame and (int(frame.state["written_ns"]), int(frame.state["sample"]))
        changed = key != self._key
        if changed:
            self._key, self._shown = key, shown_frame(frame, view.facts, self._raw)
            content = shown_json(self._shown)
            content.pop("age_s", None)
            self._shown_text = _text(content)
        shown, text = self._shown, self._shown_text
        if frame is not None and shown.details is not None:
            shown = replace(shown, details=replace(shown.details, age_s=frame.age_s))
            text = f'{text[:-1]},"age_s":{frame.age_s:.3f}}}'
        first, bins = view.bins(self._bins)
        self._bins = first + len(bins)
        moment = self._moment_of(view.facts, shown, text, connected=connected, changed=changed or len(bins) > 0)
        made: Future[str] = Future()
        made.set_result(_next(moment, before, _text(bins_json(first, bins, view.facts))))
        moment.texts[before] = made  # nearly all clients are there
        return moment

    def _moment_of(
        self, facts: RunFacts | None, shown: Shown | None, text: str, *, connected: bool, changed: bool
    ) -> Moment:
        player = None if self.view is None else self.view.player
        replay = None if player is None else player.replay_state()
        return Moment(
            place=Place(self._number, len(self._lines), self._bins),
            view=self.view,
            lines=self._lines,
            facts=facts,
            shown=shown,
            connected=connected,
            ended=bool(self._raw) and self._raw[-1]["is"] == "end",
            state=f'"frame":{text},"connected":{json.dumps(connected)},"replay":{_text(replay)}',
            changed=changed,
        )

    def _made(self, moment: Moment, since: Place) -> str:
        bins = "null"
        if moment.view is not None and moment.facts is not None:
            first, found = since.bins, np.zeros(0, bin_dtype(len(moment.facts.channels)))
            if moment.view is self.view:  # which may have been closed otherwise
                first, found = moment.view.bins(since.bins)
            bins = _text(bins_json(first, found[: max(moment.place.bins - first, 0)], moment.facts))
        if since.view >= 0:
            return _next(moment, since, bins)
        lines = ",".join(moment.lines[: moment.place.lines])
        whole = f'"facts":{_text(moment.facts and moment.facts.to_json())},"earlier":{self._earlier}'
        return f'{{"is":"whole",{whole},"lines":[{lines}],"bins":{bins},{moment.state}}}'


def _next(moment: Moment, since: Place, bins: str) -> str:
    lines = ",".join(moment.lines[since.lines : moment.place.lines])
    return f'{{"is":"next","lines":[{lines}],"bins":{bins},{moment.state}}}'


def _text(value: object) -> str:
    return json.dumps(as_json(value), separators=(",", ":"))
