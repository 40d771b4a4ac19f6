// The magnified crop of a pair with its outlines, and the small drawings beside it, from measured numbers.

const SVG = "http://www.w3.org/2000/svg";
export const CROP = { columns: 752, rows: 564 }; // [px] twice the size on the page, for sharp screens

export function svg(parent, tag, attributes = {}, text) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  parent?.append(element);
  return element;
}

/** The part of the photograph that the crop shows [px]: left, top, width, height. */
export function cropWindow(pair, zoom) {
  const width = pair.crop_widths[zoom], height = width * CROP.rows / CROP.columns;
  return [pair.point[0] - width / 2, pair.point[1] - height / 2, width, height];
}

export const cropAddress = (at, pair, zoom) => `/crop?${new URLSearchParams({ at, frame: pair.frame, x: pair.point[0], y: pair.point[1], width: pair.crop_widths[zoom], ...CROP })}`;

/** Draw the outlines of a pair over the crop. */
export function drawOutlines(element, pair, zoom, shown) {
  element.replaceChildren();
  if (!pair || !shown) return;
  element.setAttribute("viewBox", cropWindow(pair, zoom).join(" "));
  for (const style of ["halo", "grain"]) {
    pair.circles.forEach(([cx, cy, r], n) => svg(element, "circle", { cx, cy, r, class: n && style === "grain" ? "grain second" : style }));
    if (pair.wall) svg(element, "polyline", { points: pair.wall.map((point) => point.join(",")).join(" "), class: style === "grain" ? "grain second" : style });
  }
}

/** The gap on a scale with the contact, the threshold, and its standard deviation. */
export function gapScale(pair) {
  const element = svg(null, "svg", { viewBox: "0 0 376 38", class: "gap-scale", role: "img", "aria-label": "The gap on its scale" });
  const reach = Math.max(pair.threshold_um + 6 * pair.gap_sd_um, Math.min(pair.gap_um * 1.05, 40 * pair.threshold_um));
  const least = Math.min(-3 * pair.gap_sd_um, pair.gap_um - 1.5 * pair.gap_sd_um, -0.25 * reach);
  const x = (um) => 14 + 348 * Math.min(1, Math.max(0, (um - least) / (reach - least)));
  svg(element, "line", { x1: 14, x2: 362, y1: 12, y2: 12, class: "axis" });
  for (const [um, text] of [[0, "contact"], [pair.threshold_um, "threshold"]]) {
    svg(element, "line", { x1: x(um), x2: x(um), y1: 4, y2: 22, class: "mark" });
    svg(element, "text", { x: x(um), y: 34, "text-anchor": "middle" }, text);
  }
  svg(element, "line", { x1: x(pair.gap_um - pair.gap_sd_um), x2: x(pair.gap_um + pair.gap_sd_um), y1: 12, y2: 12, class: "whisker" });
  svg(element, "circle", { cx: x(pair.gap_um), cy: 12, r: 5, class: "value" });
  return element;
}

/** A fraction between 0 and 1 with its interval. */
export function intervalBar(interval) {
  const element = svg(null, "svg", { viewBox: "0 0 110 14", class: "interval", "aria-hidden": "true" }), x = (fraction) => 5 + 100 * fraction;
  svg(element, "line", { x1: 5, x2: 105, y1: 7, y2: 7, class: "track" });
  if (!interval) return element;
  svg(element, "line", { x1: x(interval.low), x2: x(interval.high), y1: 7, y2: 7, class: "span" });
  svg(element, "circle", { cx: x(interval.value), cy: 7, r: 4.5, class: "value" });
  return element;
}
