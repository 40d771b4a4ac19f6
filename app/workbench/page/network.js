// The force network over the photograph: widths by f_n, colours by what is asked, widest at the mean of the strongest.

import { digits } from "/page/dom.js";

// Perceptually even, dark to bright, told apart without red and green (cividis, viridis by ear).
const RAMP = ["#2c3e78", "#3f5b9e", "#4f86b5", "#5fb0a8", "#9ccb6b", "#e6d04a", "#ffef9a"];

const SHADES = 48; // of a ramp: the eye tells fewer apart

const hex = (text) => [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16));
export function ramp(t) {
  const at = Math.min(Math.max(t, 0), 1) * (RAMP.length - 1), k = Math.min(Math.floor(at), RAMP.length - 2), part = at - k;
  const a = hex(RAMP[k]), b = hex(RAMP[k + 1]);
  return `rgb(${a.map((value, n) => Math.round(value + (b[n] - value) * part)).join(",")})`;
}

export const COLOURINGS = {
  fn: { words: "normal force", unit: "N", of: (net, k) => net.fn[k], zero: true },
  ft: { words: "|tangential force|", unit: "N", of: (net, k) => Math.abs(net.ft[k]), zero: true },
  mobilised: { words: "|f_t| / f_n", unit: "", of: (net, k) => (net.fn[k] > 0 ? Math.abs(net.ft[k]) / net.fn[k] : null), zero: true },
  doubt: { words: "sd of f_n / mean f_n", unit: "", of: (net, k) => (net.fn_sd[k] === null ? null : net.fn_sd[k] / (net.mean_fn || 1)), zero: true },
  probability: { words: "P(touch)", unit: "", of: (net, k) => net.probability[k], low: 0, high: 1 },
  age: { words: "age", unit: "frames", of: (net, k) => net.age[k], zero: true },
};

/** The range of a colouring over a frame: from nothing, or the least, to what 2 % exceed. */
export function rangeOf(net, name) {
  const how = COLOURINGS[name], values = net.fn.map((_, k) => how.of(net, k)).filter((v) => v !== null && Number.isFinite(v)).sort((a, b) => a - b);
  if (how.high !== undefined) return [how.low, how.high];
  const high = values[Math.floor(0.98 * (values.length - 1))] ?? 1;
  return [how.zero ? 0 : values[0] ?? 0, high || 1];
}

export function drawNetwork(c, k, net, { by = "fn", chosen = null, range = null, faint = false } = {}) {
  const how = COLOURINGS[by], [low, high] = range ?? rangeOf(net, by), mean = net.mean_fn || 1;
  const size = net.rods.r.length ? net.rods.r.reduce((a, b) => a + b, 0) / net.rods.r.length : 30;
  const order = [...net.fn.keys()].sort((a, b) => net.fn[a] - net.fn[b]);
  c.lineCap = "round";
  const groups = new Map(); // lines that look alike are one stroke
  for (const n of order) {
    const fn = net.fn[n] ?? 0;
    const wide = Math.min(Math.max(0.16 * size * Math.max(fn, 0) / mean, 0), 0.8 * size);
    if (wide * k < 0.35 && n !== chosen) continue;
    const value = how.of(net, n), shade = value === null ? -1 : Math.round(SHADES * Math.min(Math.max((value - low) / (high - low || 1), 0), 1)), step = Math.max(1, Math.round(wide * k * 2));
    const name = step * 1000 + shade;
    if (!groups.has(name)) groups.set(name, { path: new Path2D(), wide: step / 2 / k, style: shade < 0 ? "#8a8f9a" : ramp(shade / SHADES) });
    const [x1, y1, x2, y2] = net.line[n], { path } = groups.get(name);
    path.moveTo(x1, y1); path.lineTo(x2, y2);
  }
  c.strokeStyle = "#000a";
  for (const { path, wide } of groups.values()) { c.lineWidth = wide + 2 / k; c.stroke(path); }
  c.globalAlpha = faint ? 0.45 : 1;
  for (const { path, wide, style } of groups.values()) { c.strokeStyle = style; c.lineWidth = wide; c.stroke(path); }
  c.globalAlpha = 1;
  c.lineCap = "butt";
  if (chosen !== null && net.line[chosen]) {
    const [x, y] = net.point[chosen];
    c.strokeStyle = "#000"; c.lineWidth = 5 / k; c.beginPath(); c.arc(x, y, 11 / k, 0, 7); c.stroke();
    c.strokeStyle = "#fff"; c.lineWidth = 2.2 / k; c.stroke();
  }
}

export function drawLegend(app, c, k, net, by) {
  const [low, high] = rangeOf(net, by), how = COLOURINGS[by], { stage } = app;
  const wide = 170 / k, tall = 9 / k, [x, y] = stage.toPhotograph(16, stage.boxHeight - 46);
  c.fillStyle = "#0c0e12e0"; c.beginPath(); c.roundRect(x - 6 / k, y - 24 / k, wide + 12 / k, 56 / k, 8 / k); c.fill();
  for (let n = 0; n < 34; n += 1) { c.fillStyle = ramp(n / 33); c.fillRect(x + n * wide / 34, y, wide / 34 + 0.5 / k, tall); }
  c.fillStyle = "#e9ebf0"; c.font = `${12 / k}px system-ui, "Noto Sans", "DejaVu Sans", sans-serif`;
  c.textAlign = "left"; c.fillText(how.words, x, y - 8 / k); c.fillText(digits(low, 3), x, y + 24 / k);
  c.textAlign = "right"; c.fillText(`${digits(high, 3)} ${how.unit}`, x + wide, y + 24 / k);
}

/** What changes in the network: more force in orange, less in blue, as wide as the change. */
export function drawChange(c, k, net, change) {
  const mean = net.mean_fn || 1, size = net.rods.r.reduce((a, b) => a + b, 0) / Math.max(net.rods.r.length, 1);
  c.lineCap = "round";
  net.line.forEach(([x1, y1, x2, y2], n) => {
    const by = change[n] ?? 0, wide = Math.min(0.3 * size * Math.abs(by) / mean, 0.8 * size);
    if (wide * k < 0.4) return;
    for (const [more, style] of [[2 / k, "#000c"], [0, by > 0 ? "#e69f00" : "#56b4e9"]]) { c.beginPath(); c.moveTo(x1, y1); c.lineTo(x2, y2); c.lineWidth = wide + more; c.strokeStyle = style; c.stroke(); }
  });
  c.lineCap = "butt";
}
