// The magnified crop and the two small drawings beside it. Everything is made of numbers the server measured.

const SVG = "http://www.w3.org/2000/svg";

function make(parent, tag, attributes, text) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  parent.append(element);
  return element;
}

/** Draw the outlines of a pair over the crop's window. */
export function drawOutlines(svg, pair, zoom, shown) {
  svg.replaceChildren();
  if (!pair || !shown) return;
  const view = pair.windows[zoom];
  svg.setAttribute("viewBox", `${view.left} ${view.top} ${view.width} ${view.height}`);
  for (const style of ["halo", "grain"]) {
    pair.circles.forEach(([cx, cy, r], n) => make(svg, "circle", { cx, cy, r, class: n && style === "grain" ? "grain second" : style }));
    if (pair.wall) {
      const points = pair.wall.map((point) => point.join(",")).join(" ");
      make(svg, "polyline", { points, class: style === "grain" ? "grain second" : style });
    }
  }
}

/** Show a gap on its scale: where bodies touch, where the threshold is, and how sure the measurement is. */
export function drawScale(svg, pair) {
  svg.replaceChildren();
  if (!pair || !Number.isFinite(pair.gap_um)) return;
  const reach = Math.max(pair.threshold_um + 6 * pair.sigma_um, Math.min(pair.gap_um * 1.05, 40 * pair.threshold_um));
  const least = Math.min(-3 * pair.sigma_um, pair.gap_um - 1.5 * pair.sigma_um, -0.25 * reach);
  const x = (um) => 14 + 348 * Math.min(1, Math.max(0, (um - least) / (reach - least)));
  make(svg, "line", { x1: 14, x2: 362, y1: 12, y2: 12, class: "axis" });
  for (const [um, text] of [[0, "touching"], [pair.threshold_um, "threshold"]]) {
    make(svg, "line", { x1: x(um), x2: x(um), y1: 4, y2: 22, class: "mark" });
    make(svg, "text", { x: x(um), y: 34, "text-anchor": "middle" }, text);
  }
  const whisker = { x1: x(pair.gap_um - pair.sigma_um), x2: x(pair.gap_um + pair.sigma_um), y1: 12, y2: 12 };
  make(svg, "line", { ...whisker, class: "whisker" });
  make(svg, "circle", { cx: x(pair.gap_um), cy: 12, r: 5, class: "value" });
}

/** Show a share between 0 and 1 with its interval. */
export function drawInterval(svg, interval) {
  svg.replaceChildren();
  const x = (share) => 5 + 140 * share;
  make(svg, "line", { x1: 5, x2: 145, y1: 7, y2: 7, class: "track" });
  if (!interval) return;
  make(svg, "line", { x1: x(interval.low), x2: x(interval.high), y1: 7, y2: 7, class: "span" });
  make(svg, "circle", { cx: x(interval.value), cy: 7, r: 4.5, class: "value" });
}
