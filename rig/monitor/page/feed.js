// What the server says: by a socket while there is one, else by asking twice a second.

const POLL_MS = 500; // a second would look stale
const SILENCE_MS = 750; // after which the page asks although there is a socket: before it looks stale
const PATIENCE_MS = 2000; // a socket that says nothing for so long is closed and opened anew
const RETRY_MS = [250, 500, 1000, 2000];

export class Feed {
  /** `take` gets every message; `heard` is the time of the last one, ms of the browser's own clock. */
  constructor(token, take) {
    this.token = token;
    this.take = take;
    this.heard = -Infinity;
    this.refused = false; // whether the last request found nobody
    this.tries = 0;
    this.socket = null;
    this.open();
    setInterval(() => this.look(), POLL_MS);
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}/feed?token=${encodeURIComponent(this.token)}`);
    this.socket = socket;
    this.since = performance.now();
    socket.onmessage = (event) => {
      if (socket !== this.socket) return;
      this.tries = 0;
      this.since = performance.now();
      this.polled = false;
      this.hear(JSON.parse(event.data));
    };
    socket.onclose = () => {
      if (socket !== this.socket) return;
      this.socket = null;
      setTimeout(() => this.open(), RETRY_MS[Math.min(this.tries++, RETRY_MS.length - 1)]);
      this.poll();
    };
  }

  /** Say something by the socket, if there is one. */
  send(word) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(word);
  }

  hear(message) {
    this.heard = performance.now();
    this.refused = false;
    this.take(message);
  }

  look() {
    const now = performance.now();
    if (this.socket && now - this.since > PATIENCE_MS && now - this.heard > PATIENCE_MS / 2) this.socket.close();
    if (!this.socket || now - this.heard > SILENCE_MS) this.poll();
  }

  async poll() {
    if (this.asking) return;
    this.asking = true;
    try {
      const asked = { headers: { "X-Token": this.token }, signal: AbortSignal.timeout(PATIENCE_MS) };
      const answer = await fetch("/state", asked);
      if (!answer.ok) throw new Error(`status ${answer.status}`);
      const message = await answer.json();
      this.polled = true;
      this.hear(message);
    } catch {
      this.refused = true;
    } finally {
      this.asking = false;
    }
  }
}
