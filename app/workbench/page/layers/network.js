// The force network over the photograph: widths by f_n, colours by the chosen quantity; the uncertainty as a band around it.

import { look, rangeOfValues, scaleOf } from "/page/layers/colours.js";
import { layers, paintLayer } from "/page/layers/settings.js";
import { shown } from "/page/units.js";

export { loadLook } from "/page/layers/colours.js";

const NEAR = 36; // [px] radius of a rod on the screen above which bars get thinner, so that they do not hide it

export const COLOURINGS = {
  fn: { words: "normal force", unit: "N", of: (net, k) => net.fn[k], force: true },
  ft: { words: "|tangential force|", unit: "N", of: (net, k) => Math.abs(net.ft[k]), force: true },
  mobilised: { words: "|f_t| / f_n", unit: "", of: (net, k) => (net.fn[k] > 0 ? Math.abs(net.ft[k]) / net.fn[k] : null), zero: true },
  uncertainty: { words: "sd of f_n / mean f_n", unit: "", of: (net, k) => (net.fn_sd[k] === null ? null : net.fn_sd[k] / (net.mean_fn || 1)), low: 0, high: 1, ramp: "uncertainty" },
  probability: { words: "P(touch)", unit: "", of: (net, k) => net.probability[k], low: 0, high: 1, ramp: "probability" },
  age: { words: "age", unit: "frames", of: (net, k) => net.age[k], zero: true },
};

/** The scale of a colouring: forces in the range of the whole run, as the recording; others in that of the photograph. */
export function scaleOfForces(net, by = layers.forces.by) {
  const how = COLOURINGS[by], [low, high] = how.force ? [net.range.weak, net.range.top] : how.high !== undefined ? [how.low, how.high] : rangeOfValues(net.fn.map((_, k) => how.of(net, k)), { zero: how.zero });
  return scaleOf("forces", { map: how.ramp ?? "force", low, high });
}

const scaleOfUncertainty = () => scaleOf("uncertainty", { map: "uncertainty", low: 0, high: 1 });

/** Widths of a photograph's bars [px of the photograph] for forces [N]. */
function widths(net, k) {
  const size = meanRadius(net), thin = Math.min(1, (NEAR / Math.max(size * k, 1e-9)) ** 0.75);
  return (fn) => thin * size * (look.thinnest + (look.thickest - look.thinnest) * Math.min(Math.max(fn / net.range.top, 0), 1));
}

/** Bars of the network; lines that look alike are one stroke. what: (row) → [width, colour], or null for no bar. */
function drawBars(c, k, stage, net, what, under) {
  const groups = new Map(), reach = meanRadius(net);
  for (const n of order(net)) {
    if (!stage.seesLine(net.line[n], reach)) continue;
    const bar = what(n);
    if (!bar) continue;
    const step = Math.max(1, Math.round(bar[0] * k * 2)), name = `${step} ${bar[1]}`;
    if (!groups.has(name)) groups.set(name, { path: new Path2D(), wide: step / 2 / k, style: bar[1] });
    const [x1, y1, x2, y2] = net.line[n], { path } = groups.get(name);
    path.moveTo(x1, y1); path.lineTo(x2, y2);
  }
  c.lineCap = "round";
  if (under) { c.strokeStyle = under; for (const { path, wide } of groups.values()) { c.lineWidth = wide + 2 / k; c.stroke(path); } }
  for (const { path, wide, style } of groups.values()) { c.strokeStyle = style; c.lineWidth = wide; c.stroke(path); }
  c.lineCap = "butt";
}

/** Rows of a network from the weakest to the strongest contact. */
function order(net) { return (net.order ??= [...net.fn.keys()].sort((a, b) => net.fn[a] - net.fn[b])); }

/** Draw the forces and, below them, their uncertainty. */
export function drawNetwork(c, k, stage, net, { faint = false } = {}) {
  if (!look) return;
  const { by } = layers.forces, how = COLOURINGS[by], scale = scaleOfForces(net, by), wide = widths(net, k), unsure = scaleOfUncertainty();
  paintLayer(c, "uncertainty", () => drawBars(c, k, stage, net, (n) => {
    const sd = net.fn_sd[n];
    return sd === null ? null : [wide(net.fn[n] ?? 0) + 2 * (wide(sd) - wide(0)) + 4 / k, unsure.colour(sd / (net.mean_fn || 1))];
  }, null), faint ? 0.45 : 1);
  paintLayer(c, "forces", () => drawBars(c, k, stage, net, (n) => {
    const fn = net.fn[n] ?? 0, value = how.of(net, n);
    return [wide(fn), fn <= 0 ? look.open : value === null || (how.force && value < scale.low) ? look.weak : scale.colour(value)];
  }, "#000a"), faint ? 0.45 : 1);
}

export function networkLegends(net) {
  if (!look) return [];
  const how = COLOURINGS[layers.forces.by], scale = scaleOfForces(net), found = [];
  if (layers.forces.on) found.push({ words: how.force ? `${how.words}, ${scale.own ? "all frames" : "not as in the recording"}` : how.words, unit: shown(how.unit), below: how.force ? "grey below " : "", scale });
  if (layers.uncertainty.on) found.push({ words: "band: sd of f_n / mean f_n", scale: scaleOfUncertainty() });
  return found;
}

export const meanRadius = (net) => (net.meanRadius ??= net.rods.r.length ? net.rods.r.reduce((a, b) => a + b, 0) / net.rods.r.length : 30);

/** Changes of the network: more force in orange, less in blue, widths by the change. */
export function drawChange(c, k, net, change) {
  const mean = net.mean_fn || 1, size = meanRadius(net);
  c.lineCap = "round";
  net.line.forEach(([x1, y1, x2, y2], n) => {
    const by = change[n] ?? 0, wide = Math.min(0.3 * size * Math.abs(by) / mean, 0.8 * size);
    if (wide * k < 0.4) return;
    for (const [more, style] of [[2 / k, "#000c"], [0, by > 0 ? "#e69f00" : "#56b4e9"]]) { c.beginPath(); c.moveTo(x1, y1); c.lineTo(x2, y2); c.lineWidth = wide + more; c.strokeStyle = style; c.stroke(); }
  });
  c.lineCap = "butt";
}
