// How much of every range and limit is used.

import { percent, quantity } from "./format.js";
import { grade } from "./status.js";

export class Bars {
  every = 250;

  constructor(list) {
    this.list = list;
    this.shares = [];
  }

  reset() {
    this.shares = [];
  }

  take({ frame }) {
    this.shares = frame?.shares ?? [];
  }

  draw() {
    if (this.list.childElementCount !== this.shares.length) this.list.replaceChildren(...this.shares.map(row));
    this.shares.forEach((share, index) => {
      const item = this.list.children[index];
      const [name, bar, used] = item.children;
      set(name, `${share.name} `, share.what);
      bar.firstChild.style.transform = `scaleX(${Math.min(Math.max(share.share ?? 0, 0), 1)})`;
      item.dataset.grade = grade(share.share);
      set(used, percent(share.share), `of ${quantity(share.of, share.unit, 3)}`);
    });
  }
}

function row() {
  const item = document.createElement("li");
  item.innerHTML = '<span><b></b><i></i></span><span class="bar"><span></span></span><span><b></b> <i></i></span>';
  return item;
}

function set(element, strong, plain) {
  const [first, second] = [element.querySelector("b"), element.querySelector("i")];
  if (first.textContent !== strong) first.textContent = strong;
  if (second.textContent !== plain) second.textContent = plain;
}
