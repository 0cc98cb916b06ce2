// A figure in a browser: uPlot gives axes and the rectangle of a zoom; lines, points, bars and areas are painted here.
"use strict";
(() => {
  const contents = JSON.parse(document.getElementById("contents").textContent);
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const NEAR = 28; // pixels from a point within which it is told
  const LEAST_CONTRAST = 4.5; // of curves against the ground
  const plots = [];
  let ink = {};

  // Colours: those of the printed figure, made lighter on a dark ground until they are seen.

  const luminance = (rgb) =>
    rgb
      .map((part) => part / 255)
      .map((part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4))
      .reduce((sum, part, index) => sum + part * [0.2126, 0.7152, 0.0722][index], 0);
  const rgbOf = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));

  const contrast = (one, other) => (Math.max(one, other) + 0.05) / (Math.min(one, other) + 0.05);

  function shown(hex) {
    let rgb = rgbOf(hex);
    if (dark.matches)
      for (let step = 0; step < 20 && contrast(luminance(rgb), luminance(rgbOf(ink.ground))) < LEAST_CONTRAST; step++)
        rgb = rgb.map((part) => Math.round(part + 0.12 * (255 - part)));
    const alpha = hex.length > 7 ? parseInt(hex.slice(7, 9), 16) / 255 : 1;
    return `rgba(${rgb.join(",")},${alpha.toFixed(3)})`;
  }

  function readInk() {
    const style = getComputedStyle(document.documentElement);
    for (const name of ["ground", "text", "muted", "line"]) ink[name] = style.getPropertyValue(`--${name}`).trim();
  }

  // Numbers as texts

  const minus = (text) => text.replace("-", "\u2212");
  const plain = (value, digits = 6) => {
    const size = Math.abs(value);
    if (size !== 0 && (size < 1e-4 || size >= 1e7)) return minus(value.toExponential(digits - 2));
    return minus(String(Number(value.toPrecision(digits))));
  };

  function tickTexts(values) {
    const steps = values.slice(1).map((value, index) => value - values[index]);
    const digits = Math.max(0, Math.min(9, Math.ceil(-Math.log10(Math.min(...steps.filter((one) => one > 0), 1)) - 1e-9)));
    const longer = steps.some((step) => Math.abs(step - Number(step.toFixed(digits))) > 1e-3 * step) ? 1 : 0;
    return values.map((value) => (value == null ? "" : minus(value.toFixed(digits + longer))));
  }

  /** Width of an axis beside the panel, for the longest of its numbers. */
  const widthOf = (_, texts) => Math.max(40, 14 + 7.2 * Math.max(0, ...(texts ?? []).map((text) => text.length)));

  /** A label "name, unit" in its parts. */
  function parts(label) {
    const at = label.lastIndexOf(", ");
    return at < 0 ? [label, ""] : [label.slice(0, at), label.slice(at + 2)];
  }

  const told = (label, value) => {
    const [name, unit] = parts(label);
    return `${name || "value"}: ${plain(value)}${unit ? `\u202f${unit}` : ""}`;
  };

  // Painting, in pixels of the canvas

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

  // Legends

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
    plots.push({ redraw: draw });
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

  // Panels

  class Panel {
    constructor(panel, parent) {
      this.panel = panel;
      this.view = this.whole();
      const figure = document.createElement("figure");
      const head = document.createElement("figcaption");
      head.textContent = panel.title;
      const legend = document.createElement("ul");
      legend.className = "legend";
      fillLegend(legend, panel.legend);
      figure.append(head, legend);
      parent.append(figure);
      this.place = document.createElement("div");
      this.place.className = "plot";
      this.place.style.aspectRatio = String(1 / Math.min(Math.max(panel.ratio, 0.35), 1.1));
      figure.append(this.place);
      if (panel.picture) return this.showPicture();
      this.place.setAttribute("role", "img");
      this.place.setAttribute("aria-label", panel.y.map((y) => y.label).join(" and ") + " over " + panel.x.label);
      this.plot = this.make();
      this.points = this.collect();
      new ResizeObserver(() => this.plot.setSize(this.size())).observe(this.place);
    }

    showPicture() {
      const image = document.createElement("img");
      [image.src, image.alt] = [this.panel.picture, this.panel.alt];
      this.place.replaceWith(image);
    }

    whole() {
      return this.panel.picture ? null : { x: this.panel.x.limits, y: this.panel.y.map((y) => y.limits) };
    }

    size() {
      return { width: Math.max(this.place.clientWidth, 160), height: Math.max(this.place.clientHeight, 160) };
    }

    axis(about, more) {
      const { ticks } = about;
      const within = (made, values) => values.filter((value) => value >= Math.min(...made) && value <= Math.max(...made));
      return {
        label: about.label,
        stroke: () => ink.muted,
        font: "12px system-ui, sans-serif",
        labelFont: "13px system-ui, sans-serif",
        labelSize: 20,
        gap: 4,
        grid: { stroke: () => ink.line, width: 1 },
        ticks: { stroke: () => ink.line, width: 1, size: 4 },
        border: { show: true, stroke: () => ink.muted, width: 1 },
        values: (_, values) => (about.log ? values.map((value) => (value == null ? "" : plain(value))) : tickTexts(values)),
        ...(ticks && {
          splits: (made) => within([made.scales[more.scale].min, made.scales[more.scale].max], ticks.at),
          values: (_, values) => (ticks.texts ? values.map((value) => ticks.texts[ticks.at.indexOf(value)] ?? "") : tickTexts(values)),
        }),
        ...more,
      };
    }

    scale(about, range) {
      const [low, high] = about.limits;
      return { time: false, auto: true, distr: about.log ? 3 : 1, dir: high < low ? -1 : 1, range: () => [...range()].sort((a, b) => a - b) };
    }

    make() {
      const { x, y } = this.panel;
      const names = y.map((_, index) => `y${index}`);
      const scales = { x: this.scale(x, () => this.view.x) };
      names.forEach((name, index) => (scales[name] = this.scale(y[index], () => this.view.y[index])));
      const across = names.map((scale, index) =>
        this.axis(y[index], { scale, size: widthOf, side: index ? 1 : 3, space: 34, ...(index && { grid: { show: false } }) }),
      );
      const options = {
        ...this.size(),
        padding: [10, y.length > 1 ? 0 : 14, 0, 0],
        legend: { show: false },
        scales,
        axes: [this.axis(x, { scale: "x", size: 34, space: 64 }), ...across],
        series: [{}, ...names.map((scale) => ({ scale, stroke: "transparent", points: { show: false } }))],
        cursor: {
          points: { show: false },
          drag: { x: true, y: true, uni: 24, setScale: false },
          bind: { dblclick: () => () => showWhole() },
        },
        hooks: {
          draw: [(made) => this.paint(made)],
          setSelect: [(made) => this.zoom(made)],
          setCursor: [(made) => this.point(made)],
        },
      };
      return new uPlot(options, this.dummy(), this.place);
    }

    /** Two points that uPlot may look at; what is shown is painted by hand. */
    dummy() {
      return [[...this.view.x].sort((a, b) => a - b), ...this.panel.y.map((_, index) => [...this.view.y[index]])];
    }

    redraw() {
      this.plot?.setData(this.dummy());
    }

    recolour() {
      this.plot?.redraw(false, true);
    }

    /** Pixels of the canvas of a point on an ordinate, for coordinates of data or in parts of the panel. */
    at(made, shape) {
      const { left, top, width, height } = made.bbox;
      return (x, y) => [
        shape.inX ? made.valToPos(x, "x", true) : left + x * width,
        shape.inY ? made.valToPos(y, `y${shape.on ?? 0}`, true) : top + (1 - y) * height,
      ];
    }

    paint(made) {
      const { ctx, bbox } = made;
      const pixel = devicePixelRatio || 1;
      ctx.save();
      ctx.beginPath();
      ctx.rect(bbox.left - pixel, bbox.top - pixel, bbox.width + 2 * pixel, bbox.height + 2 * pixel);
      ctx.clip();
      ctx.lineJoin = "round";
      for (const shape of this.panel.shapes) paint(ctx, shape, this.at(made, shape), pixel);
      ctx.font = `${12 * pixel}px system-ui, sans-serif`;
      for (const text of this.panel.texts) {
        ctx.fillStyle = shown(text.colour);
        ctx.textAlign = text.across;
        ctx.textBaseline = { center: "middle", top: "top", bottom: "bottom" }[text.up] ?? "alphabetic";
        ctx.fillText(text.text, ...this.at(made, text)(text.x, text.y));
      }
      if (this.hovered) {
        ctx.strokeStyle = ink.text;
        ctx.lineWidth = 1.5 * pixel;
        ctx.beginPath();
        ctx.arc(...this.at(made, this.hovered.shape)(this.hovered.x, this.hovered.y), 8 * pixel, 0, 2 * Math.PI);
        ctx.stroke();
      }
      ctx.restore();
    }

    zoom(made) {
      const { left, top, width, height } = made.select;
      if (width < 4 && height < 4) return;
      const [wide, high] = [made.over.clientWidth, made.over.clientHeight];
      const between = (from, to, scale) => [made.posToVal(from, scale), made.posToVal(to, scale)].sort((a, b) => a - b);
      if (width >= 4 && width < wide) setAcross(this, between(left, left + width, "x"));
      if (height >= 4 && height < high) this.view = { ...this.view, y: this.view.y.map((_, n) => between(top, top + height, `y${n}`)) };
      made.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
      redrawAll();
      document.getElementById("whole").disabled = false;
    }

    /** All points that are told: those of lines in data, nearest to what is drawn. */
    collect() {
      const told = this.panel.shapes.filter((shape) => shape.kind === "line" && shape.inX && shape.inY && !shape.silent);
      return told.flatMap((shape) =>
        shape.x.map((x, index) => ({ shape, index, x, y: shape.y[index] })).filter(({ x, y }) => x != null && y != null),
      );
    }

    point(made) {
      const { left, top } = made.cursor;
      let [best, least] = [null, NEAR ** 2];
      if (left >= 0)
        for (const point of this.points) {
          const x = made.valToPos(point.x, "x") - left;
          const y = made.valToPos(point.y, `y${point.shape.on}`) - top;
          const noted = point.shape.notes?.[point.index] ? 0.5 : 1; // of two at one place, the one that says more
          const away = x * x + y * y + noted;
          if (away < least) [best, least] = [point, away];
        }
      if (best === this.hovered) return;
      this.hovered = best;
      made.redraw(false, false);
      tell(best && this.texts(best));
      if (best) placeAt(made, best, this);
    }

    texts({ shape, index, x, y }) {
      const texts = [shape.name, told(this.panel.x.label, x)];
      const half = shape.half?.[index];
      texts.push(told(this.panel.y[shape.on].label, y) + (half ? ` ± ${plain(half, 2)}` : ""), shape.notes?.[index]);
      return texts.filter(Boolean);
    }
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

  function placeAt(made, point, panel) {
    const over = made.over.getBoundingClientRect();
    const [x, y] = [over.left + made.valToPos(point.x, "x"), over.top + made.valToPos(point.y, `y${point.shape.on}`)];
    const right = x + 16 + box.offsetWidth > document.documentElement.clientWidth ? x - 16 - box.offsetWidth : x + 16;
    box.style.left = `${Math.max(right, 4) + scrollX}px`;
    box.style.top = `${Math.max(y - 12 - box.offsetHeight, 4) + scrollY}px`;
  }

  function setAcross(panel, limits) {
    const { group } = panel.panel;
    for (const one of panels) if (one === panel || (group != null && one.panel.group === group)) one.view = { ...one.view, x: limits };
  }

  function redrawAll() {
    for (const panel of panels) panel.redraw();
  }

  function showWhole() {
    for (const panel of panels) panel.view = panel.whole();
    redrawAll();
    document.getElementById("whole").disabled = true;
  }

  readInk();
  document.querySelector("h1").textContent = contents.title;
  document.getElementById("below").textContent = contents.below;
  const main = document.querySelector("main");
  main.style.setProperty("--columns", contents.columns);
  const panels = contents.panels.map((panel) => new Panel(panel, main));
  fillLegend(document.getElementById("legend"), contents.legend);
  document.getElementById("whole").addEventListener("click", showWhole);
  const recolour = () => {
    readInk();
    for (const panel of panels) panel.recolour();
    for (const swatch of plots) swatch.redraw();
  };
  dark.addEventListener("change", recolour);
  recolour();
})();
