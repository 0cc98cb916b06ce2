// Painting, in pixels of the canvas: lines, points, bars and areas, and the legends that show them.

const MARKS = {
  s: [[-1, -1], [1, -1], [1, 1], [-1, 1]],
  D: [[0, -1.3], [1.3, 0], [0, 1.3], [-1.3, 0]],
  "^": [[0, -1.15], [1.1, 1], [-1.1, 1]],
  v: [[0, 1.15], [1.1, -1], [-1.1, -1]],
  "<": [[-1.15, 0], [1, 1.1], [1, -1.1]],
  ">": [[1.15, 0], [-1, 1.1], [-1, -1.1]],
  P: [[-0.4, -1], [0.4, -1], [0.4, -0.4], [1, -0.4], [1, 0.4], [0.4, 0.4], [0.4, 1], [-0.4, 1], [-0.4, 0.4], [-1, 0.4], [-1, -0.4], [-0.4, -0.4]],
};
const STROKES = { x: [[-1, -1, 1, 1], [-1, 1, 1, -1]], "+": [[-1, 0, 1, 0], [0, -1, 0, 1]], "|": [[0, -1, 0, 1]], _: [[-1, 0, 1, 0]] };

function mark(ctx, looks, x, y, pixel) {
  const half = ((looks.marker === "." ? 0.5 : 1) * looks.size * pixel) / 2;
  ctx.beginPath();
  if (STROKES[looks.marker]) {
    for (const [x0, y0, x1, y1] of STROKES[looks.marker]) {
      ctx.moveTo(x + x0 * half, y + y0 * half);
      ctx.lineTo(x + x1 * half, y + y1 * half);
    }
  } else {
    const corners = MARKS[looks.marker];
    if (corners) corners.forEach(([dx, dy]) => ctx.lineTo(x + dx * half, y + dy * half));
    else ctx.arc(x, y, half, 0, 2 * Math.PI);
    ctx.closePath();
    ctx.fillStyle = looks.fill === "none" ? ink.ground : shown(looks.fill);
    ctx.fill();
  }
  ctx.stroke();
}

function paintLine(ctx, shape, at, pixel) {
  const path = (each) => shape.x.forEach((x, index) => each(x == null || shape.y[index] == null ? null : at(x, shape.y[index])));
  if (shape.width) {
    ctx.lineWidth = shape.width * pixel;
    ctx.setLineDash((shape.dash ?? []).map((one) => one * pixel));
    ctx.beginPath();
    let down = false;
    path((place) => {
      if (place) down ? ctx.lineTo(...place) : ctx.moveTo(...place);
      down = place != null;
    });
    ctx.stroke();
    ctx.setLineDash([]);
  }
  if (!shape.marker) return;
  ctx.lineWidth = 1.3 * pixel;
  ctx.strokeStyle = shown(shape.edge);
  path((place) => place && mark(ctx, shape, ...place, pixel));
}

function paint(ctx, shape, at, pixel) {
  ctx.strokeStyle = ctx.fillStyle = shown(shape.colour);
  if (shape.kind === "line") return paintLine(ctx, shape, at, pixel);
  ctx.beginPath();
  if (shape.kind === "bars") {
    ctx.lineWidth = shape.width * pixel;
    const [x0, y0, x1, y1] = shape.ends;
    x0.forEach((_, index) => {
      if ([x0, y0, x1, y1].some((end) => end[index] == null)) return;
      ctx.moveTo(...at(x0[index], y0[index]));
      ctx.lineTo(...at(x1[index], y1[index]));
    });
    return ctx.stroke();
  }
  for (const [xs, ys] of shape.rings) {
    xs.forEach((x, index) => x != null && ys[index] != null && ctx[index ? "lineTo" : "moveTo"](...at(x, ys[index])));
    ctx.closePath();
  }
  ctx.fill();
}

const swatches = []; // functions that paint the swatches of legends again

function swatch(looks) {
  const pixel = devicePixelRatio || 1;
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [28 * pixel, 14 * pixel];
  const draw = () => {
    const ctx = canvas.getContext("2d");
    ctx.clearRect(0, 0, canvas.width, canvas.height);
    const at = (x, y) => [x * canvas.width, y * canvas.height];
    const rings = [[[0, 1, 1, 0], [0.2, 0.2, 0.8, 0.8]]];
    paint(ctx, { ...looks, marker: undefined, x: [0.02, 0.98], y: [0.5, 0.5], rings }, at, pixel);
    if (looks.marker) paint(ctx, { ...looks, width: undefined, x: [0.5], y: [0.5] }, at, pixel);
  };
  if (looks.marker) looks = { ...looks, size: Math.min(looks.size, 9) };
  swatches.push(draw);
  return canvas;
}

function fillLegend(list, entries) {
  for (const { text, looks } of entries) {
    const item = document.createElement("li");
    if (looks) item.append(swatch(looks));
    item.append(text);
    list.append(item);
  }
  list.hidden = !entries.length;
}
