// What happened, the latest first.

const KEPT = 300;
const LOCK = { searching: "searching", acquiring: "closing the loop", locked: "locked", lost: "lock lost" };
const GUARD = { disarmed: "not armed", armed: "armed", ramping: "ramping down", off: "output at 0 V" };

export class Events {
  every = 200;

  constructor(list) {
    this.list = list;
    this.new = [];
  }

  reset({ facts }) {
    this.rate = facts?.sample_rate_hz ?? 1;
    this.anew = true;
    this.new = [];
    this.parts = 0;
  }

  take({ lines }) {
    for (const line of lines ?? []) this.new.push(...this.told(line));
    if (this.new.length > KEPT) this.new.splice(0, this.new.length - KEPT);
  }

  /** Entries of a line: time in s, kind, text in short and, of a point, in full. */
  told(line) {
    if (line.is === "part") {
      const remarks = (line.about?.remarks ?? []).map((text) => [0, "remark", text]);
      return [[0, "part", `part ${++this.parts} begins`], ...remarks];
    }
    if (line.is === "end") return [[null, line.tripped ? "bad" : "part", line.text]];
    if (line.is === "point") {
      const about = [line.reason, ...(line.warnings ?? [])].filter(Boolean);
      const kind = line.accepted ? (about.length ? "remark" : "point") : "bad";
      const name = `point ${line.number + 1} ${line.quality}`;
      const brief = about.map((text) => text.split(": ")[0]).join(", ");
      return [[line.end_sample / this.rate, kind, [name, brief].filter(Boolean).join(": "), [name, ...about].join(": ")]];
    }
    const text = { lock: LOCK, guard: GUARD }[line.what]?.[line.state] ?? line.text ?? [line.what, line.state].filter(Boolean).join(" ");
    return [[line.sample / this.rate, line.state === "lost" ? "bad" : line.what, text]];
  }

  draw() {
    if (this.anew) this.list.replaceChildren();
    this.anew = false;
    if (!this.new.length) return;
    const made = this.new.map(([time, kind, text, full = text]) => {
      const item = document.createElement("li");
      const when = document.createElement("time");
      when.textContent = Number.isFinite(time) ? `${time.toFixed(2)} s` : "";
      item.className = kind;
      const shown = kind === "bad" || kind === "remark" ? `! ${text}` : text;
      item.append(when, full === text ? shown : unfolding(shown, full));
      return item;
    });
    this.list.prepend(...made.reverse());
    this.new = [];
    while (this.list.childElementCount > KEPT) this.list.lastChild.remove();
  }
}

/** A text in short, which is opened to the full one. */
function unfolding(text, full) {
  const [details, summary] = [document.createElement("details"), document.createElement("summary")];
  summary.textContent = text;
  details.append(summary, full);
  return details;
}
