// STOP: the plain form, sent without leaving the page where that works, and by a key. Says when the output is at 0 V.

const PATIENCE_MS = 1500;
const LOOK_MS = 250;
const KEY = "Escape";
const HARDWARE = "USE THE HARDWARE STOP";

export class Stop {
  constructor(form, words) {
    this.form = form;
    this.words = words;
    this.asked = false;
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.press();
    });
    document.addEventListener("keydown", (event) => {
      if (event.key !== KEY || event.repeat || form.hidden) return;
      event.preventDefault();
      this.press();
    });
  }

  say(state, text) {
    this.form.dataset.asked = state;
    if (this.words.textContent !== text) this.words.textContent = text;
  }

  async press() {
    if (this.asked) return;
    this.asked = true;
    this.say("sent", "STOP SENT");
    try {
      await this.send();
    } catch (error) {
      this.asked = false; // the next press tries again
      if (error instanceof TypeError) return this.say("failed", `NOT SENT: ${HARDWARE}`);
      return this.form.submit(); // no answer, or a refusal: the form without this script, and the server's own page
    }
    this.follow();
  }

  async send() {
    const body = new URLSearchParams(new FormData(this.form));
    this.show(await this.ask("/stop", { method: "POST", body }));
  }

  async ask(path, more = {}) {
    const headers = { Accept: "application/json" };
    const answer = await fetch(path, { ...more, headers, signal: AbortSignal.timeout(PATIENCE_MS) });
    if (!answer.ok) throw new Error(`status ${answer.status}`);
    return answer.json();
  }

  show({ state, text }) {
    this.say(state, text);
  }

  async follow() {
    while (this.form.dataset.asked !== "off") {
      await new Promise((done) => setTimeout(done, LOOK_MS));
      try {
        this.show(await this.ask("/stopping"));
      } catch {
        this.say("failed", `NO ANSWER: ${HARDWARE}`);
      }
    }
    this.asked = false;
  }
}
