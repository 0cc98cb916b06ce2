// The page of a run: messages of the feed go to its parts, which draw what they got when the display is ready.

import { Bars } from "./bars.js";
import { Events } from "./events.js";
import { Feed } from "./feed.js";
import { Folder } from "./folder.js";
import { Harmonics } from "./harmonics.js";
import { themes } from "./palette.js";
import { Points } from "./points.js";
import { Replay } from "./replay.js";
import { Scope } from "./scope.js";
import { Status } from "./status.js";
import { Stop } from "./stop.js";
import { Traces } from "./traces.js";

const at = (id) => document.getElementById(id);
const token = at("token").value;

let feed = null;
const stop = new Stop(at("stop-form"), at("stopping"), () => feed?.send("stop")); // first: whatever fails below, STOP has its key

let parts = [];
let waiting = false;

feed = new Feed(token, (message) => {
  for (const part of parts) {
    if (message.is === "whole") {
      part.reset(message);
      part.drawn = -Infinity; // it is drawn at once
    }
    part.take(message);
    part.dirty = true;
  }
  if (message.is === "whole") document.body.dataset.run = message.facts || message.frame ? "yes" : "none";
  wait();
});

function wait() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(draw);
}

/** Draw what has changed, each part as often as it is worth it and never faster than the display. */
function draw(now) {
  waiting = false;
  for (const part of parts) {
    if (!part.dirty) continue;
    if (now - (part.drawn ?? -Infinity) < part.every) {
      wait();
      continue;
    }
    part.drawn = now;
    part.dirty = false;
    part.draw();
  }
}

themes(at("theme"), () => parts.forEach((part) => part.recolour?.()));

parts = [
  stop,
  new Status(feed),
  new Replay(at("replay"), token),
  new Traces(at("strips"), at("span")),
  new Points(at("canvas-points"), at("points"), at("result-hint")),
  new Bars(at("shares")),
  new Scope(at("canvas-scope"), at("scope-hint")),
  new Harmonics(at("canvas-harmonics"), at("purity")),
  new Events(at("events")),
];

if (document.body.dataset.folder === "yes") new Folder(at("folder"), token);
