// The state, as large as a hand; how old it is; and the numbers that one looks at from across the room.

import { duration, fixed, number, percent, quantity } from "./format.js";

const STALE_S = 1.0;
const GONE_S = 3.0;
const SHAPES = {
  starting: "starting",
  "not armed": "unarmed",
  searching: "searching",
  "lock lost": "lost",
  locked: "locked",
  settling: "settling",
  recording: "recording",
  driven: "driven",
  "ramping down": "ramping",
  tripped: "tripped",
  stopped: "stopped",
  finished: "finished",
};
const HARDWARE = "USE THE HARDWARE STOP";

const at = (id) => document.getElementById(id);

/** Set a text only where it differs: a screen reader reads what is set. */
function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export class Status {
  every = 100;

  constructor(feed) {
    this.feed = feed;
    this.message = null;
    this.ended = false;
    setInterval(() => this.drawConnection(), 100);
  }

  reset(message) {
    this.facts = message.facts;
    this.ended = false;
    const facts = message.facts;
    if (!facts) return;
    const serial = facts.specimen_serial ? `, ${facts.specimen_serial}` : "";
    const file = facts.recording.split(/[\\/]/).pop();
    const told = [
      ["bench", facts.bench],
      ["specimen", facts.specimen + serial],
      ["operator", facts.operator || "unknown"],
      ["arming", ""],
      ["recording", file],
    ];
    at("facts").replaceChildren(
      ...told.map(([name, value]) => {
        const pair = document.createElement("div");
        const [term, text] = [document.createElement("dt"), document.createElement("dd")];
        term.textContent = name;
        text.textContent = text.title = value;
        text.id = `fact-${name}`;
        pair.append(term, text);
        return pair;
      }),
    );
    this.arm(facts.armed);
    say(at("title"), facts.purpose || facts.kind);
    document.title = `${file} · ${facts.kind}`;
    at("ramp").textContent = ` within ${quantity(facts.limits.ramp_down_s, "s", 2)}`;
  }

  /** Say how the bench was armed, which a run tells when its part begins. */
  arm(how) {
    const words = { virtual: "virtual rig: nothing moves", "": "not armed" }[how] ?? `armed: ${how}`;
    const place = at("fact-arming");
    if (place) place.textContent = place.title = words;
  }

  take(message) {
    this.message = message;
    for (const line of message.lines ?? []) {
      if (line.is === "part") this.ended = false;
      if (line.about?.armed) this.arm(line.about.armed.how);
      if (line.is === "end") this.ended = true;
    }
  }

  /** One of: waiting, none (no run), live, stale, over, died, gone. */
  connection() {
    const message = this.message;
    const silent = (performance.now() - this.feed.heard) / 1000;
    if (!message) return this.feed.refused ? "gone" : "waiting";
    if (silent > GONE_S || (this.feed.refused && silent > STALE_S)) return "gone";
    if (!this.facts && !message.frame) return "none";
    if (silent > STALE_S) return "stale";
    if (!message.connected) return this.ended ? "over" : "died";
    return this.age() > STALE_S ? "stale" : "live";
  }

  /** Time since the run published the state that is shown, s. A part that has ended has nothing more to say. */
  age() {
    const frame = this.message?.frame;
    const still = this.ended || this.message?.replay || frame?.age_s == null;
    return (performance.now() - this.feed.heard) / 1000 + (still ? 0 : frame.age_s);
  }

  drawConnection() {
    const connection = this.connection();
    const frame = this.message?.frame;
    const known = frame?.state ?? "starting";
    const away = connection === "gone" || connection === "died";
    const state = { none: "no run", waiting: "no data", gone: "NOT CONNECTED", died: "NOT CONNECTED" }[connection] ?? known;
    document.body.dataset.connection = connection;
    document.body.dataset.state = away ? "away" : known;
    say(at("state"), state);
    at("shape").setAttribute("href", `#shape-${away ? "away" : (SHAPES[known] ?? "starting")}`);
    say(at("detail"), away ? `last known: ${known}` : this.detail(connection, frame));
    say(at("cause"), away ? HARDWARE : this.cause(frame));
    say(at("connection"), this.words(connection));
  }

  detail(connection, frame) {
    if (connection === "stale") return `STALE: nothing new for ${number(this.age(), 1)} s`;
    if (!frame || connection === "none") return "";
    const [good, wanted] = frame.settled ?? [];
    const output = `output ${quantity(frame.voltage_v, "V", 3)}`;
    const guard = frame.output_off ? "OUTPUT AT 0 V" : frame.guard === "ramping down" ? `ramping down, ${output}` : frame.guard;
    const now = this.message.replay ? "replay, nothing moves" : (guard ?? "");
    return frame.state === "settling" && wanted ? `${good} of ${wanted} periods · ${now}` : now;
  }

  /** Why the output came down. Where a run ended before it told that it is at 0 V, somebody has to see to that. */
  cause(frame) {
    const cause = frame?.cause ?? "";
    return this.ended && frame?.output_off === false ? `${HARDWARE}. ${cause}` : cause;
  }

  words(connection) {
    return {
      waiting: "waiting for the first data",
      none: "no run is under way",
      live: this.message?.replay ? "replay of a recording" : this.feed.polled ? "live, without a socket" : "live",
      stale: "stale: nothing new for a second",
      over: "the run is over",
      died: "the run's process ended unexpectedly",
      gone: "no answer from the monitor",
    }[connection];
  }

  draw() {
    const { frame } = this.message;
    const facts = this.facts;
    if (!facts || frame?.time_s == null) return;
    const running = frame.frequency_hz != null && !frame.output_off;
    say(at("level"), frame.points ? `${Math.max(frame.point || frame.finished, 1)} of ${frame.points}` : "–");
    const [level, target] = [frame.level, frame.target].map((value) => quantity(value, facts.level_unit));
    say(at("level-value"), frame.target ? `${level} of ${target}` : level);
    say(at("left"), running ? duration(frame.left_s) : "–");
    say(at("time"), `time of test ${duration(frame.time_s)}`);
    say(at("frequency"), quantity(frame.frequency_hz, "Hz", 6));
    say(at("phase"), frame.phase_error_deg == null ? "phase error –" : `phase error ${fixed(frame.phase_error_deg, 1)}°`);
    say(at("force"), quantity(frame.force_n, "N"));
    say(at("voltage"), `output ${quantity(frame.voltage_v, "V")}`);
    say(at("displacement"), quantity(frame.displacement_mm, "mm"));
    say(at("acceleration"), `acceleration ${quantity(frame.acceleration_m_s2, "m/s²", 3)}`);
    this.drawNearest(frame.shares ?? []);
    this.drawLoop(frame);
  }

  drawNearest(shares) {
    const largest = shares.reduce((most, one) => ((one.share ?? 0) > (most?.share ?? -1) ? one : most), null);
    say(at("nearest"), percent(largest?.share));
    say(at("nearest-of"), largest ? `${largest.name} ${largest.what}` : "–");
    at("nearest").dataset.grade = grade(largest?.share);
  }

  drawLoop(frame) {
    const [p50, p99, p999, most] = (frame.late_us ?? []).map((value) => number(value, 3));
    const late = p50 === "–" || p50 === undefined ? "loop without a clock" : `loop answers within ${p50} µs (half), ${p99} µs (99 %), ${p999} µs (99.9 %), ${most} µs at most`;
    say(at("loop"), `${late} · late blocks ${frame.overruns ?? 0} · samples lost in a row ${frame.lost ?? 0} · part ${frame.part}`);
  }
}

/** How near to a limit: "", "near" from 80 %, "over" from 100 %. */
export const grade = (share) => (share >= 1 ? "over" : share >= 0.8 ? "near" : "");
