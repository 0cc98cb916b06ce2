// Recordings and models in the folder, each with figure and table when it is opened.

export class Folder {
  constructor(section, token) {
    this.token = token;
    this.entries = section.querySelector("#entries");
    this.note = section.querySelector("#folder-note");
    section.hidden = false;
    section.querySelector("#folder-again").addEventListener("click", () => this.look());
    this.look();
  }

  ask(path) {
    return fetch(path, { headers: { "X-Token": this.token } }).then((answer) => {
      if (!answer.ok) throw new Error(`status ${answer.status}`);
      return answer;
    });
  }

  async look() {
    try {
      const { entries } = await (await this.ask("/folder")).json();
      this.note.textContent = entries.length ? "" : "nothing here yet";
      this.entries.replaceChildren(...entries.map((entry) => this.row(entry)));
    } catch (error) {
      this.note.textContent = `the folder cannot be read (${error.message})`;
    }
  }

  row(entry) {
    const item = document.createElement("details");
    const head = document.createElement("summary");
    const when = new Date(1000 * entry.modified);
    const texts = [entry.name, entry.kind, entry.summary, size(entry.size), when.toLocaleString()];
    head.append(
      ...texts.map((text) => {
        const part = document.createElement("span");
        part.textContent = text ?? "";
        return part;
      }),
    );
    item.append(head);
    item.addEventListener("toggle", () => item.open && item.childElementCount === 1 && this.fill(item, entry));
    return item;
  }

  async fill(item, entry) {
    const figure = document.createElement("img");
    figure.alt = `figure of ${entry.name}`;
    const table = document.createElement("pre");
    table.tabIndex = 0;
    table.textContent = "is being read";
    figure.addEventListener("error", () => figure.replaceWith("there is no figure of it"));
    figure.src = `/folder/${entry.n}/figure.png`;
    item.append(figure, table);
    try {
      table.textContent = await (await this.ask(`/folder/${entry.n}/table.txt`)).text();
    } catch (error) {
      table.textContent = `cannot be shown (${error.message})`;
    }
  }
}

const size = (bytes) => (bytes >= 1e6 ? `${(bytes / 1e6).toFixed(1)} MB` : `${Math.max(bytes / 1e3, 0.1).toFixed(1)} kB`);
