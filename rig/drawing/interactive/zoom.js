// Zoom: a rectangle of one panel; panels that share an axis follow, and the button shows the whole again.

function zoom(panel, made) {
  const { left, top, width, height } = made.select;
  if (width < 4 && height < 4) return;
  const [wide, high] = [made.over.clientWidth, made.over.clientHeight];
  const between = (from, to, scale) => [made.posToVal(from, scale), made.posToVal(to, scale)].sort((a, b) => a - b);
  if (width >= 4 && width < wide) setAcross(panel, between(left, left + width, "x"));
  if (height >= 4 && height < high) panel.view = { ...panel.view, y: panel.view.y.map((_, n) => between(top, top + height, `y${n}`)) };
  made.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
  redrawAll();
  document.getElementById("whole").disabled = false;
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
