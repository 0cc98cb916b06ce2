// Marks of points, in pixels of the canvas: told apart by their shapes.

function lines(ctx, ...ends) {
  ctx.beginPath();
  for (const [x0, y0, x1, y1] of ends) {
    ctx.moveTo(x0, y0);
    ctx.lineTo(x1, y1);
  }
  ctx.stroke();
}

/** A filled disc, or a ring of the stroke's colour filled with `inside`. */
export function disc(ctx, x, y, size, inside) {
  ctx.beginPath();
  ctx.arc(x, y, size, 0, 2 * Math.PI);
  if (inside) ctx.fillStyle = inside;
  ctx.fill();
  if (inside) ctx.stroke();
}

export function ring(ctx, x, y, size) {
  ctx.beginPath();
  ctx.arc(x, y, size, 0, 2 * Math.PI);
  ctx.stroke();
}

export function diamond(ctx, x, y, size) {
  lines(ctx, [x, y - size, x + size, y], [x + size, y, x, y + size], [x, y + size, x - size, y], [x - size, y, x, y - size]);
}

export function plus(ctx, x, y, size) {
  lines(ctx, [x - size, y, x + size, y], [x, y - size, x, y + size]);
}

export function crossed(ctx, x, y, size) {
  lines(ctx, [x - size, y - size, x + size, y + size], [x - size, y + size, x + size, y - size]);
}

/** Error bar beside a point. */
export function level(ctx, from, to, y, cap) {
  lines(ctx, [from, y, to, y], [from, y - cap, from, y + cap], [to, y - cap, to, y + cap]);
}

/** Error bar above and below a point. */
export function upright(ctx, x, from, to, cap) {
  lines(ctx, [x, from, x, to], [x - cap, from, x + cap, from], [x - cap, to, x + cap, to]);
}
