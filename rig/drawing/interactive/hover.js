// What is told at the point under the pointer: its name, its values with unit and interval, its quality.

const NEAR = 28; // pixels from a point within which it is told

/** All points that are told: those of lines in data, nearest to what is drawn. */
function pointsOf(panel) {
  const told = panel.panel.shapes.filter((shape) => shape.kind === "line" && shape.inX && shape.inY && !shape.silent);
  return told.flatMap((shape) =>
    shape.x.map((x, index) => ({ shape, index, x, y: shape.y[index] })).filter(({ x, y }) => x != null && y != null),
  );
}

function hover(panel, made) {
  const { left, top } = made.cursor;
  let [best, least] = [null, NEAR ** 2];
  if (left >= 0)
    for (const point of panel.points) {
      const x = made.valToPos(point.x, "x") - left;
      const y = made.valToPos(point.y, `y${point.shape.on}`) - top;
      const noted = point.shape.notes?.[point.index] ? 0.5 : 1; // of two at one place, the one that says more
      const away = x * x + y * y + noted;
      if (away < least) [best, least] = [point, away];
    }
  if (best === panel.hovered) return;
  panel.hovered = best;
  made.redraw(false, false);
  tell(best && textsOf(panel, best));
  if (best) placeAt(made, best);
}

function textsOf(panel, { shape, index, x, y }) {
  const texts = [shape.name, told(panel.panel.x.label, x)];
  const half = shape.half?.[index];
  texts.push(told(panel.panel.y[shape.on].label, y) + (half ? ` ± ${plain(half, 2)}` : ""), shape.notes?.[index]);
  return texts.filter(Boolean);
}

const box = document.getElementById("told");

function tell(texts) {
  box.hidden = !texts;
  box.replaceChildren(
    ...(texts ?? []).map((text) => {
      const line = document.createElement("p");
      line.textContent = text;
      return line;
    }),
  );
}

function placeAt(made, point) {
  const over = made.over.getBoundingClientRect();
  const [x, y] = [over.left + made.valToPos(point.x, "x"), over.top + made.valToPos(point.y, `y${point.shape.on}`)];
  const right = x + 16 + box.offsetWidth > document.documentElement.clientWidth ? x - 16 - box.offsetWidth : x + 16;
  box.style.left = `${Math.max(right, 4) + scrollX}px`;
  box.style.top = `${Math.max(y - 12 - box.offsetHeight, 4) + scrollY}px`;
}
