// A panel: axes by uPlot, in which everything else is painted.

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
    this.points = pointsOf(this);
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
      values: (_, values) => (about.log ? values.map(roundText) : tickTexts(values)),
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
        setSelect: [(made) => zoom(this, made)],
        setCursor: [(made) => hover(this, made)],
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
}
