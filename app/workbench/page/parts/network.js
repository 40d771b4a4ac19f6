// The force network over the photograph: widths by f_n, colours by the chosen quantity.

import { digits, request } from "/page/dom.js";
import { layers } from "/page/parts/layers.js";

// Colours and widths of the recording; the range is that of the whole run, so that frames compare.
let look = null;
export async function loadLook() { look ??= await request("force_look"); }

const NEAR = 36; // [px] radius of a rod on the screen above which bars get thinner, so that they do not hide it

export const COLOURINGS = {
  fn: { words: "normal force", unit: "N", of: (net, k) => net.fn[k], force: true },
  ft: { words: "|tangential force|", unit: "N", of: (net, k) => Math.abs(net.ft[k]), force: true },
  mobilised: { words: "|f_t| / f_n", unit: "", of: (net, k) => (net.fn[k] > 0 ? Math.abs(net.ft[k]) / net.fn[k] : null), zero: true },
  uncertainty: { words: "sd of f_n / mean f_n", unit: "", of: (net, k) => (net.fn_sd[k] === null ? null : net.fn_sd[k] / (net.mean_fn || 1)), low: 0, high: 1, ramp: "uncertainty" },
  probability: { words: "P(touch)", unit: "", of: (net, k) => net.probability[k], low: 0, high: 1, ramp: "probability" },
  age: { words: "age", unit: "frames", of: (net, k) => net.age[k], zero: true },
};

const rampOf = (how) => look?.ramps[how.ramp ?? "force"] ?? ["#888888"];
const shadeOf = (ramp, t) => ramp[Math.round(Math.min(Math.max(t, 0), 1) * (ramp.length - 1))];

/** The range of a colouring: forces, of the whole run; others, of the frame, to the 98th percentile. */
export function rangeOf(net, name) {
  const how = COLOURINGS[name];
  if (how.force) return [net.range.weak, net.range.top];
  const values = net.fn.map((_, k) => how.of(net, k)).filter((v) => v !== null && Number.isFinite(v)).sort((a, b) => a - b);
  if (how.high !== undefined) return [how.low, how.high];
  const high = values[Math.floor(0.98 * (values.length - 1))] ?? 1;
  return [how.zero ? 0 : values[0] ?? 0, high || 1];
}

/** Widths by f_n, colours by the chosen quantity: as the recording draws them. */
export function drawNetwork(c, k, net, { by = "fn", faint = false } = {}) {
  if (!look || !layers.forces) return;
  const how = COLOURINGS[by], [low, high] = rangeOf(net, by), ramp = rampOf(how);
  const size = meanRadius(net), thin = Math.min(1, (NEAR / Math.max(size * k, 1e-9)) ** 0.75);
  const order = [...net.fn.keys()].sort((a, b) => net.fn[a] - net.fn[b]);
  const groups = new Map(); // lines that look alike are one stroke
  for (const n of order) {
    const fn = net.fn[n] ?? 0;
    const wide = thin * size * (look.thinnest + (look.thickest - look.thinnest) * Math.min(Math.max(fn / net.range.top, 0), 1));
    const value = how.of(net, n), step = Math.max(1, Math.round(wide * k * 2));
    const style = fn <= 0 ? look.open : value === null || (how.force && value < low) ? look.weak : shadeOf(ramp, (value - low) / (high - low || 1));
    const name = `${step} ${style}`;
    if (!groups.has(name)) groups.set(name, { path: new Path2D(), wide: step / 2 / k, style });
    const [x1, y1, x2, y2] = net.line[n], { path } = groups.get(name);
    path.moveTo(x1, y1); path.lineTo(x2, y2);
  }
  c.lineCap = "round";
  c.globalAlpha = layers.opacity * (faint ? 0.45 : 1);
  c.strokeStyle = "#000a";
  for (const { path, wide } of groups.values()) { c.lineWidth = wide + 2 / k; c.stroke(path); }
  for (const { path, wide, style } of groups.values()) { c.strokeStyle = style; c.lineWidth = wide; c.stroke(path); }
  c.globalAlpha = 1;
  c.lineCap = "butt";
}

const meanRadius = (net) => (net.rods.r.length ? net.rods.r.reduce((a, b) => a + b, 0) / net.rods.r.length : 30);

export function drawLegend(app, c, k, net, by) {
  if (!look || !layers.forces) return;
  const [low, high] = rangeOf(net, by), how = COLOURINGS[by], ramp = rampOf(how), { stage } = app;
  const wide = 170 / k, tall = 9 / k, [x, y] = stage.toPhotograph(16, stage.boxHeight - 46);
  c.fillStyle = "#0c0e12e0"; c.beginPath(); c.roundRect(x - 6 / k, y - 24 / k, wide + 12 / k, 56 / k, 8 / k); c.fill();
  for (let n = 0; n < 34; n += 1) { c.fillStyle = shadeOf(ramp, n / 33); c.fillRect(x + n * wide / 34, y, wide / 34 + 0.5 / k, tall); }
  c.fillStyle = "#e9ebf0"; c.font = `${12 / k}px system-ui, "Noto Sans", "DejaVu Sans", sans-serif`;
  c.textAlign = "left"; c.fillText(how.force ? `${how.words}, all frames` : how.words, x, y - 8 / k); c.fillText(`${how.force ? "grey below " : ""}${digits(low, 3)}`, x, y + 24 / k);
  c.textAlign = "right"; c.fillText(`${digits(high, 3)} ${how.unit}`, x + wide, y + 24 / k);
}

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
