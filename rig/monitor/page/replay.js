// Pause, place and speed of a replay.

import { duration } from "./format.js";

const SPEEDS = [0.2, 0.5, 1, 2, 5, 10, 20, 50, 100];

export class Replay {
  every = 66;

  constructor(section, token) {
    this.section = section;
    this.token = token;
    [this.play, this.seek, this.time, this.speed] = ["play", "seek", "time", "speed"].map((name) => section.querySelector(`#replay-${name}`));
    this.speed.append(...SPEEDS.map((speed) => new Option(`${speed} ×`, speed)));
    this.play.addEventListener("click", () => this.ask(this.replay.playing ? "pause" : "play"));
    this.speed.addEventListener("change", () => this.ask("speed", this.speed.value));
    this.seek.addEventListener("input", () => {
      this.held = true;
      this.time.textContent = duration(Number(this.seek.value));
    });
    this.seek.addEventListener("change", () => {
      this.ask("seek", this.seek.value);
      this.held = false;
    });
  }

  reset() {}

  take({ replay }) {
    this.replay = replay ?? null;
  }

  draw() {
    this.section.hidden = !this.replay;
    document.body.dataset.replay = this.replay ? "yes" : "no"; // where a run begins instead, STOP comes back
    if (!this.replay) return;
    const { time_s: time, duration_s: whole, playing, speed } = this.replay;
    this.play.textContent = playing ? "pause" : "play";
    if (!this.held) {
      this.seek.max = whole;
      this.seek.value = time;
      this.time.textContent = `${duration(time)} of ${duration(whole)}`;
    }
    if (document.activeElement !== this.speed) this.choose(speed);
  }

  choose(speed) {
    if (![...this.speed.options].some((one) => Number(one.value) === speed)) this.speed.append(new Option(`${speed} ×`, speed));
    this.speed.value = String(speed);
  }

  ask(action, value = "") {
    const body = new URLSearchParams({ token: this.token, action, value });
    fetch("/replay", { method: "POST", body }).catch(() => {});
  }
}
