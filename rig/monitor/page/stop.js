// STOP: by the socket, which needs no new connection, and by the plain form, sent without leaving the page where that works;
// also by a key. Says when the output is at 0 V.

const PATIENCE_MS = 1500;
const LOOK_MS = 250;
const KEY = "Escape";
const DONE = ["off", "none"]; // states of the server in which nothing more will change
const HARDWARE = "USE THE HARDWARE STOP";

export class Stop {
  /** `ask` sends the request by the socket, if there is one. */
  constructor(form, words, ask) {
    this.form = form;
    this.words = words;
    this.bySocket = ask;
    this.asked = this.failed = false;
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.press();
    });
    document.addEventListener("keydown", (event) => {
      if (event.key !== KEY || event.repeat || !form.getClientRects().length) return;
      event.preventDefault();
      this.press();
    });
  }

  /** Forget what came of a stop of another run. */
  reset({ facts }) {
    const run = facts ? `${facts.process} ${facts.started}` : "";
    if (run === this.run) return;
    if (this.run !== undefined) {
      this.asked = this.failed = false;
      delete this.form.dataset.asked;
    }
    this.run = run;
  }

  take() {}

  draw() {}

  say(state, heading, text = "") {
    this.form.dataset.asked = state;
    const [large, small] = this.words.children;
    if (large.textContent !== heading) large.textContent = heading;
    if (small.textContent !== text) small.textContent = text;
  }

  async press() {
    if (this.asked) return;
    if (this.failed) return this.form.submit(); // the second time without this script
    this.asked = true;
    this.say("sent", "STOP SENT");
    try {
      this.bySocket();
    } catch {} // the form is sent all the same
    try {
      await this.send();
    } catch (error) {
      this.asked = false;
      this.failed = true;
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

  /** Show an answer: its first sentence in large letters, as on the server's own page. */
  show({ state, text }) {
    const [heading, ...more] = text.split(". ");
    this.say(state, heading, more.join(". "));
  }

  async follow() {
    const { run } = this;
    while (!DONE.includes(this.form.dataset.asked)) {
      await new Promise((done) => setTimeout(done, LOOK_MS));
      if (this.run !== run) return;
      try {
        this.show(await this.ask("/stopping"));
      } catch {
        this.say("failed", `NO ANSWER: ${HARDWARE}`);
      }
    }
    this.asked = false;
  }
}
